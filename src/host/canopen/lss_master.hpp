#pragma once

#include <array>

#include "host/canopen/bus.hpp"

namespace servodrome::host {

// The LSS address: what object 1018h holds.
struct LssAddress {
  std::uint32_t vendor_id = 0;
  std::uint32_t product_code = 0;
  std::uint32_t revision_number = 0;
  std::uint32_t serial_number = 0;
  friend bool operator==(const LssAddress&, const LssAddress&) = default;
};

// LSS master (CiA 305): finds nodes that have no node-ID, and gives them node-ID and bit rate. Everything but finding
// and selecting goes to the nodes in configuration state; throws HostError if none answers in time or it refuses.
class LssMaster {
 public:
  // `timeout` is for one answer.
  explicit LssMaster(Bus& bus, Time timeout = std::chrono::milliseconds(100)) : bus_(bus), timeout_(timeout) {}

  // Is there a node without node-ID ("identify non-configured remote slave")?
  bool any_unconfigured();
  // Does a node of this vendor and product exist with revision and serial number within the ranges?
  bool identify(const LssAddress& lowest, std::uint32_t highest_revision, std::uint32_t highest_serial);
  // Finds one node without node-ID and leaves it in configuration state; nothing if there is none.
  std::optional<LssAddress> fastscan();

  // Puts the one node of that address into configuration state. False: it does not answer.
  bool select(const LssAddress& address);
  // All nodes: for a bus with one node. Has no answer.
  void switch_all_to_configuration();
  // Back to normal operation; a node that got its first node-ID boots now.
  void switch_all_to_waiting();

  // 1..127, or 255 for none. Acts from the next reset communication on.
  void set_node_id(std::uint8_t node_id);
  // A row of CiA 305 table 1: 0 1 Mbit/s, 1 800, 2 500, 3 250, 4 125, 6 50, 7 20, 8 10 kbit/s.
  void set_bit_timing(std::uint8_t index);
  // Switches the bit rate after `delay`, silent for that time twice; this end of the bus must follow.
  void activate_bit_timing(std::chrono::milliseconds delay);
  // Keeps node-ID and bit rate over power-off.
  void store();

  std::uint8_t inquire_node_id();
  LssAddress inquire_address();

 private:
  using Data = std::array<std::uint8_t, 8>;
  // The answer that begins with `expected`, or nothing in time.
  std::optional<Frame> ask(const Data& request, std::uint8_t expected);
  Frame demand(const Data& request, const char* what);
  void configure(const Data& request, const char* what);
  bool scan_step(std::uint32_t number, std::uint8_t bit_check, std::uint8_t sub, std::uint8_t next);

  Bus& bus_;
  Time timeout_;
};

}  // namespace servodrome::host
