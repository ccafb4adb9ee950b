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
// A second answer does not count if it may be the answer to another request: to one of another program, or to one of
// this client that got no answer in time (both for the time `doubt`), or to one of this program's other clients.
class SecondAnswer {
 public:
  static constexpr canopen::Time doubt = std::chrono::seconds(10);

  // A transfer begins. Forgets the last answer if a second answer to it could be an answer to this transfer: if both
  // access the same object, or in a block transfer.
  void begin(ObjectAddress object, bool block);
  // The transfer has ended with `answer`. `others_sent`: number of frames sent by this program's other clients.
  void end(const canopen::Frame& answer, canopen::Time now, std::uint64_t others_sent);
  // Until `time` a second answer does not count.
  void doubt_until(canopen::Time time);
  // A frame of the node's SDO channel to clients.
  void see(const canopen::Frame& answer, std::uint64_t others_sent);

  // Returns true if a second answer was seen since the last call.
  bool take() { return std::exchange(seen_, false); }

 private:
  bool is_recent(const canopen::Frame& answer) const;

  std::optional<canopen::Frame> answer_{};    // the last answer; nullopt: a second answer would not count
  std::uint64_t others_sent_ = 0;             // value of others_sent at that answer
  std::array<canopen::Frame, 128> recent_{};  // ring buffer of the last answers to this client
  std::size_t next_ = 0;
  canopen::Time certain_from_{};
  bool seen_ = false;
};

}  // namespace servodrome::master
