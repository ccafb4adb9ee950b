#pragma once

#include <array>

#include "canopen/profile.hpp"
#include "dictionary/abort_code.hpp"
#include "dictionary/entry.hpp"

namespace servodrome::canopen {

// NMT states by the value a heartbeat carries (CiA 301 table 95).
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

// What a node does about a communication error unless the device decides otherwise.
struct LossReaction {
  std::uint16_t emergency_code = 0x8130;  // 0: no emergency, 1001h untouched
  ErrorBehaviour behaviour = ErrorBehaviour::pre_operational;
};

// Answers to the LSS service "store configuration" (CiA 305, cs 17h).
enum class LssStore : std::uint8_t { done = 0, not_supported = 1, failed = 2 };

enum class BusState : std::uint8_t { error_active, error_passive, bus_off };

// What the bus does to a device. All calls come from inside Node::start, receive, poll and bus_state.
class DeviceEvents {
 public:
  virtual void nmt_state_changed(NmtState /*state*/) {}

  // Reset node or reset communication: bring the objects of `restore` to their saved (or default) values. `node_id` is
  // the one the node has from now on, for defaults that add it. The node reads its configuration afterwards.
  virtual void reset(NmtCommand /*command*/, dictionary::Area /*restore*/, std::uint8_t /*node_id*/) {}

  // Objects 1010h and 1011h, signature checked. Restored defaults act after the next reset or power-on (CiA 301
  // 7.5.2.14), so the device forgets what it has saved and changes no object.
  virtual dictionary::AbortCode store(dictionary::Area) { return dictionary::AbortCode::cannot_transfer_or_store; }
  virtual dictionary::AbortCode restore_defaults(dictionary::Area) {
    return dictionary::AbortCode::cannot_transfer_or_store;
  }

  // A SYNC, after the synchronous RPDOs were taken over and the synchronous TPDOs sampled. `counter` is 0 without
  // 1019h.
  virtual void sync(std::uint8_t /*counter*/, Time /*now*/) {}
  // An RPDO (0 is the first) was written to the objects.
  virtual void rpdo_written(std::uint16_t /*number*/) {}

  // Return what shall be done; `standard` is what CiA 301 and object 1029h would do.
  virtual LossReaction communication_lost(LossCause /*cause*/, LossReaction standard) { return standard; }
  virtual void communication_restored(LossCause /*cause*/) {}
  // A node of object 1016h was heard in a new state. Its boot-up message arrives as `initialising`.
  virtual void heartbeat_state(std::uint8_t /*node_id*/, NmtState /*state*/) {}

  // TIME: milliseconds after midnight and days since 1 January 1984.
  virtual void time_of_day(std::uint32_t /*milliseconds*/, std::uint16_t /*days*/) {}

  // An EMCY of a COB-ID of object 1028h (sub-index `entry`).
  virtual void emergency_received(std::uint8_t /*entry*/, std::uint16_t /*code*/, std::uint8_t /*error_register*/,
                                  const std::array<std::uint8_t, 5>& /*vendor*/) {}

  // LSS. `index` is a row of CiA 305 table 1 (0: 1 Mbit/s, 1: 800, 2: 500, 3: 250, 4: 125, 6: 50, 7: 20, 8: 10 kbit/s,
  // 9: automatic).
  virtual bool lss_bit_timing_supported(std::uint8_t /*index*/) { return false; }
  // `node_id` 255 is "not configured".
  virtual LssStore lss_store(std::uint8_t /*node_id*/, std::uint8_t /*bit_timing_index*/) {
    return LssStore::not_supported;
  }
  // The bit rate is to be switched: no frame may be sent until `delay` has passed, then the new rate is set, and
  // another `delay` passes before sending (CiA 305 "activate bit timing parameters"). The node keeps silent meanwhile.
  virtual void lss_activate_bit_timing(std::uint8_t /*index*/, Time /*delay*/) {}

 protected:
  ~DeviceEvents() = default;
};

}  // namespace servodrome::canopen
