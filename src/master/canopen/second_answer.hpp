#pragma once

#include <array>
#include <chrono>
#include <optional>
#include <utility>

#include "canopen/frame.hpp"
#include "canopen/time.hpp"
#include "master/object_client.hpp"

namespace servodrome::master {

// Detects two devices with the same node-ID by a second, different answer to one request (CiA 301 7.2.4.2: one
// confirmation for each request). A second answer that is equal to one of the last answers is a frame that was doubled,
// perhaps with a delay, and is not reported.
//
// Another answer is not counted if it may belong to another request: of another client (for `doubt` after its request),
// of this program's other clients, or to a request that got no answer in time (for `doubt` as well).
class SecondAnswer {
 public:
  static constexpr canopen::Time doubt = std::chrono::seconds(10);

  // A transfer begins. Two answers for one object cannot be told apart from answers to two requests.
  void begin(ObjectAddress object, bool block);
  // The transfer has ended with `answer`. `others_sent`: number of frames sent by this program's other clients.
  void end(const canopen::Frame& answer, canopen::Time now, std::uint64_t others_sent);
  // From now on an answer may belong to another request.
  void doubt_until(canopen::Time time);
  // A frame of the node's SDO channel to clients.
  void see(const canopen::Frame& answer, std::uint64_t others_sent);

  // Returns true if a second answer was seen since the last call.
  bool take() { return std::exchange(seen_, false); }

 private:
  bool is_recent(const canopen::Frame& answer) const;

  std::optional<canopen::Frame> answer_{};    // the last one, as long as a different one shows a second device
  std::uint64_t others_sent_ = 0;             // when it came
  std::array<canopen::Frame, 128> recent_{};  // the last answers to this client (some 10 ms), a ring buffer
  std::size_t next_ = 0;
  canopen::Time certain_from_{};
  bool seen_ = false;
};

}  // namespace servodrome::master
