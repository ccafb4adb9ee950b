#pragma once

#include <array>

#include "master/canopen/bus.hpp"

namespace servodrome::master {

// The LSS address: the values of object 1018h.
struct LssAddress {
  std::uint32_t vendor_id = 0;
  std::uint32_t product_code = 0;
  std::uint32_t revision_number = 0;
  std::uint32_t serial_number = 0;
  friend bool operator==(const LssAddress&, const LssAddress&) = default;
};

// LSS master (CiA 305): finds nodes without node-ID and assigns node-ID and bit rate. The services that find, select or
// switch nodes address all nodes. The other services address the nodes in configuration state and throw MasterError if
// a node refuses or no node answers in time.
class LssMaster {
 public:
  // `timeout`: for each answer.
  explicit LssMaster(Bus& bus, Time timeout = std::chrono::milliseconds(100)) : bus_(bus), timeout_(timeout) {}

  // True if a node without node-ID exists ("identify non-configured remote slave").
  bool any_unconfigured();
  // True if a node of this vendor and product exists whose revision and serial number are within the ranges.
  bool identify(const LssAddress& lowest, std::uint32_t highest_revision, std::uint32_t highest_serial);
  // Finds one node without node-ID and leaves it in configuration state; nullopt if there is none.
  std::optional<LssAddress> fastscan();

  // Puts the node with that address into configuration state. Returns false if it does not answer.
  bool select(const LssAddress& address);
  // Puts all nodes into configuration state; for a bus with one node. The service has no answer.
  void switch_all_to_configuration();
  // Returns all nodes to normal operation; a node that has received its first node-ID boots now.
  void switch_all_to_waiting();

  // 1..127, or 255 for none. Takes effect at the next reset communication.
  void set_node_id(std::uint8_t node_id);
  // `index`: row of CiA 305 table 1. 0: 1 Mbit/s, 1: 800, 2: 500, 3: 250, 4: 125, 6: 50, 7: 20, 8: 10 kbit/s.
  void set_bit_timing(std::uint8_t index);
  // The nodes send nothing for `delay`, switch the bit rate, and send nothing for `delay` again. The master's interface
  // must switch as well.
  void activate_bit_timing(std::chrono::milliseconds delay);
  // Saves node-ID and bit rate in non-volatile memory.
  void store();

  std::uint8_t inquire_node_id();
  LssAddress inquire_address();

 private:
  using Data = std::array<std::uint8_t, 8>;
  // Returns the answer with the command specifier `expected`; nullopt after the timeout.
  std::optional<Frame> ask(const Data& request, std::uint8_t expected);
  Frame demand(const Data& request, const char* what);
  void configure(const Data& request, const char* what);
  bool scan_step(std::uint32_t number, std::uint8_t bit_check, std::uint8_t sub, std::uint8_t next);

  Bus& bus_;
  Time timeout_;
};

}  // namespace servodrome::master
