#pragma once

#include <array>

#include "canopen/connection_set.hpp"
#include "canopen/device_events.hpp"
#include "canopen/link.hpp"
#include "dictionary/dictionary.hpp"

namespace servodrome::canopen {

inline constexpr std::uint8_t unconfigured_node_id = 255;

// LSS slave (CiA 305): configures node-ID and bit timing. The LSS address is the identity object 1018h.
class LssSlave {
 public:
  LssSlave(Link& link, dictionary::Dictionary& dictionary, DeviceEvents& events)
      : link_(link), dictionary_(dictionary), events_(events) {}

  static constexpr std::uint16_t request_can_id = connection_set::lss_request;
  static constexpr std::uint16_t response_can_id = connection_set::lss_response;

  enum class Mode : std::uint8_t { waiting, configuration };

  // The node has this node-ID now, or from the next reset communication on; 255: none.
  void start(std::uint8_t node_id);
  void set_active_node_id(std::uint8_t node_id) { active_node_id_ = node_id; }
  void set_pending_node_id(std::uint8_t node_id) { pending_node_id_ = node_id; }
  std::uint8_t pending_node_id() const { return pending_node_id_; }
  Mode mode() const { return mode_; }

  // Returns true if a node without node-ID has received one and must boot now (CiA 305 "switch state global").
  bool receive(const Frame& request);

 private:
  using Address = std::array<std::uint32_t, 4>;  // vendor-ID, product code, revision number, serial number

  void respond(std::uint8_t command, std::uint8_t first = 0, std::uint8_t second = 0);
  void respond(std::uint8_t command, std::uint32_t value);
  Address address() const;
  bool switch_global(std::uint8_t mode);
  void switch_selective(std::uint8_t part, std::uint32_t number);
  void identify_remote(std::uint8_t part, std::uint32_t number);
  void fastscan(const Frame& request);
  void configure(const Frame& request);
  void inquire(std::uint8_t command);

  Link& link_;
  dictionary::Dictionary& dictionary_;
  DeviceEvents& events_;
  Mode mode_ = Mode::waiting;
  std::uint8_t active_node_id_ = unconfigured_node_id;
  std::uint8_t pending_node_id_ = unconfigured_node_id;
  std::uint8_t bit_timing_index_ = no_bit_timing;
  std::uint8_t selected_ = 0;    // parts of the address that matched so far
  std::uint8_t identified_ = 0;  // the same for identify
  std::uint8_t scanned_ = 0;     // part of the address that fastscan searches

  static constexpr std::uint8_t no_bit_timing = 0xFF;
};

}  // namespace servodrome::canopen
