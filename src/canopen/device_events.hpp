#pragma once

#include <array>

#include "canopen/profile.hpp"
#include "dictionary/abort_code.hpp"
#include "dictionary/entry.hpp"

namespace servodrome::canopen {

// NMT states with their values in a heartbeat (CiA 301 table 95).
enum class NmtState : std::uint8_t { initialising = 0, stopped = 4, operational = 5, pre_operational = 127 };

// NMT commands (CiA 301 7.2.8.2.1).
enum class NmtCommand : std::uint8_t {
  start = 0x01,
  stop = 0x02,
  enter_pre_operational = 0x80,
  reset_node = 0x81,
  reset_communication = 0x82,
};

enum class LossCause : std::uint8_t { life_guarding, heartbeat, rpdo_timeout, bus_off };

// Reaction of a node to a communication error, unless the device changes it.
struct LossReaction {
  std::uint16_t emergency_code = 0x8130;  // 0: no emergency, 1001h unchanged
  ErrorBehaviour behaviour = ErrorBehaviour::pre_operational;
};

// Answers to the LSS service "store configuration" (CiA 305, cs 17h).
enum class LssStore : std::uint8_t { done = 0, not_supported = 1, failed = 2 };

enum class BusState : std::uint8_t { error_active, error_passive, bus_off };

// Effects of the bus on a device. All calls come from within Node::start, receive, poll and bus_state.
class DeviceEvents {
 public:
  virtual void nmt_state_changed(NmtState /*state*/) {}

  // Reset node or reset communication: the device must set the objects in `restore` to their saved (or default) values.
  // `node_id` is the new node-ID, for defaults that add it. The node reads its configuration afterwards.
  virtual void reset(NmtCommand /*command*/, dictionary::Area /*restore*/, std::uint8_t /*node_id*/) {}

  // Objects 1010h and 1011h, after the check of the signature. Restored defaults take effect after the next reset or
  // power-on (CiA 301 7.5.2.14): the device deletes its saved values and changes no object.
  virtual dictionary::AbortCode store(dictionary::Area) { return dictionary::AbortCode::cannot_transfer_or_store; }
  virtual dictionary::AbortCode restore_defaults(dictionary::Area) {
    return dictionary::AbortCode::cannot_transfer_or_store;
  }

  // A SYNC arrived. Called after the synchronous RPDOs were written and the synchronous TPDOs sampled. `counter` is 0
  // without 1019h.
  virtual void sync(std::uint8_t /*counter*/, Time /*now*/) {}
  // An RPDO (0 is the first) was written to the objects.
  virtual void rpdo_written(std::uint16_t /*number*/) {}

  // Returns the reaction; `standard` is the reaction of CiA 301 and object 1029h.
  virtual LossReaction communication_lost(LossCause /*cause*/, LossReaction standard) { return standard; }
  virtual void communication_restored(LossCause /*cause*/) {}
  // A node of object 1016h has sent a new state. Its boot-up message is reported as `initialising`.
  virtual void heartbeat_state(std::uint8_t /*node_id*/, NmtState /*state*/) {}

  // TIME: milliseconds after midnight and days since 1 January 1984.
  virtual void time_of_day(std::uint32_t /*milliseconds*/, std::uint16_t /*days*/) {}

  // An EMCY with a COB-ID of object 1028h was received (sub-index `entry`).
  virtual void emergency_received(std::uint8_t /*entry*/, std::uint16_t /*code*/, std::uint8_t /*error_register*/,
                                  const std::array<std::uint8_t, 5>& /*vendor*/) {}

  // LSS. `index` is a row of CiA 305 table 1 (0: 1 Mbit/s, 1: 800, 2: 500, 3: 250, 4: 125, 6: 50, 7: 20, 8: 10 kbit/s,
  // 9: automatic).
  virtual bool lss_bit_timing_supported(std::uint8_t /*index*/) { return false; }
  // `node_id` 255 is "not configured".
  virtual LssStore lss_store(std::uint8_t /*node_id*/, std::uint8_t /*bit_timing_index*/) {
    return LssStore::not_supported;
  }
  // The bit rate must be switched: no frame may be sent until `delay` has passed, then the device sets the new rate and
  // waits another `delay` before sending (CiA 305 "activate bit timing parameters"). The node sends nothing during that
  // time.
  virtual void lss_activate_bit_timing(std::uint8_t /*index*/, Time /*delay*/, Time /*now*/) {}

 protected:
  ~DeviceEvents() = default;
};

}  // namespace servodrome::canopen
