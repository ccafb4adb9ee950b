#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "canopen/frame.hpp"
#include "links/heard_clients.hpp"
#include "studio/heard_values.hpp"
#include "tools/sniff/sdo_conversation.hpp"

namespace servodrome::studio {

// Observes the SDO channels of the drives on a CAN bus and collects the writes of other masters, each with the value
// before if it has passed on the bus, read or written by any master (HeardValues). A write counts when the drive has
// confirmed it. This program and another master can each have a request under way on the same channel: a response
// belongs to the request for its object, to the earlier one if both are for the same. Responses that name no object (of
// segments) count for the other master only while this program has no request under way.
class ForeignWrites {
 public:
  struct Node {
    unsigned id;
    std::string product;
  };
  // Observes the default SDO channels of these nodes (CiA 301 table 39).
  explicit ForeignWrites(std::span<const Node> nodes);

  // For a bus that is opened now: values that passed before are not known any more. Passes all messages on to `next`
  // and observes them, in the thread of the bus; this object must outlive the clients of the bus.
  links::Heard heard(links::Heard next);

  struct Write {
    std::size_t drive;  // its place in `nodes`
    master::ObjectAddress object;
    std::vector<std::byte> before;  // empty: not known
    std::vector<std::byte> value;
  };
  // The writes since the last call. Callable from any thread.
  std::vector<Write> take();

 private:
  using Clock = std::chrono::steady_clock;
  struct Channel {
    std::size_t drive;
    HeardValues values;
    std::optional<master::ObjectAddress> own{};      // of this program's request under way
    std::vector<std::byte> own_value{};              // that it writes; empty: not known, or a read
    std::optional<master::ObjectAddress> foreign{};  // of the other master's
    Clock::time_point heard{};                       // its last request
    bool own_is_first = false;
    bool in_block = false;                   // the other master sends a block: its messages have no command byte
    master::SdoConversation conversation{};  // of the other master
  };

  void hear(bool sent, const canopen::Frame& frame);
  static bool is_own(Channel& channel, const canopen::Frame& response);
  static void hear_own_answer(Channel& channel, const canopen::Frame& response);

  std::map<std::uint32_t, Channel> channels_;  // by node-ID
  std::mutex mutex_;
  std::vector<Write> writes_;
};

}  // namespace servodrome::studio
