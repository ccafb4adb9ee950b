#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "ethercat/segment.hpp"
#include "links/time.hpp"

namespace servodrome::links {

// Changes or drops frames on their way, to test how a master handles that. EthercatBus::pass() makes all calls; they
// must not send frames. An interposer changes the bytes of a frame in place. ethercat::Segment::parse() finds the
// datagrams of a frame. A frame whose datagrams no longer fit into it is malformed.
class EthercatInterposer {
 public:
  using Encapsulation = ethercat::Segment::Encapsulation;

  // What happens to a frame on its way in.
  struct Entry {
    bool lost = false;  // no slave sees it
    // How often the frame passes the segment, at least 1. With 2 the segment executes each datagram twice, like a frame
    // that circulates in a ring. The second pass begins when the frame would be back at the master, and before the
    // slaves' applications have done their work. A datagram with a position address was incremented on the first pass,
    // so it addresses no slave on the second (ETG.1000.4 clause 5.4).
    unsigned passes = 1;
  };
  // What happens to a frame on its way back.
  struct Return {
    bool lost = false;                    // every slave has seen it, the master does not get it
    Time delay{};                         // additional delay of the frame; frames sent after it may overtake it
    std::optional<std::size_t> length{};  // the number of bytes that come back
    // Whole frames that come back directly behind this one, or in its place if it is lost. They must stay in place
    // until the next call.
    std::span<const std::vector<std::uint8_t>> behind{};
  };

  // A frame that a master sent, before the first slave; `at` is the time at which it enters the segment.
  virtual Entry enters(std::span<std::uint8_t> /*frame*/, Encapsulation, Time /*at*/) { return {}; }
  // A frame behind the last slave; `at` is the time at which it would be back at the master. Not called for a frame
  // that was lost before.
  virtual Return returns(std::span<std::uint8_t> /*frame*/, Encapsulation, Time /*at*/) { return {}; }

 protected:
  ~EthercatInterposer() = default;
};

}  // namespace servodrome::links
