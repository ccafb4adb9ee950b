#pragma once

#include <span>

#include "canopen/time.hpp"
#include "dictionary/entry.hpp"

// Features of a product's CANopen interface and its deviations from CiA 301. Objects are not listed here: a service
// whose object is missing from the product's dictionary does not exist.
namespace servodrome::canopen {

// Transmission types of PDOs (CiA 301 tables 67 and 72).
struct TransmissionTypes {
  bool acyclic_synchronous = true;        // 0
  bool cyclic_synchronous = true;         // 1..240
  bool reserved = false;                  // 241..251: as 254, in products that accept them
  bool synchronous_remote = true;         // 252, TPDO only
  bool asynchronous_remote = true;        // 253, TPDO only
  bool manufacturer_event_driven = true;  // 254
  bool profile_event_driven = true;       // 255

  constexpr bool contains(std::uint8_t type) const {
    if (type == 0) return acyclic_synchronous;
    if (type <= 240) return cyclic_synchronous;
    if (type <= 251) return reserved;
    switch (type) {
      case 252: return synchronous_remote;
      case 253: return asynchronous_remote;
      case 254: return manufacturer_event_driven;
      case 255: return profile_event_driven;
      default: return false;
    }
  }
  // The type that `type` acts as.
  static constexpr std::uint8_t in_force(std::uint8_t type) { return type > 240 && type <= 251 ? 254 : type; }
};

// A PDO with a limited range of CAN-IDs; `index` is that of its communication parameter.
struct CobIdRange {
  std::uint16_t index;
  std::uint16_t lowest;
  std::uint16_t highest;
};

// Node guarding besides the heartbeat (CiA 301 7.2.8.2.2.1: a node uses one of the two).
enum class NodeGuarding : std::uint8_t {
  absent,          // remote frames on 700h + node-ID are not answered
  heartbeat_wins,  // guarding only while object 1017h is 0, as in the standard
  simultaneous,    // both at once
};

// Values of object 1029h: effect of a communication error on the NMT state.
enum class ErrorBehaviour : std::uint8_t { pre_operational = 0, no_change = 1, stopped = 2 };

struct Profile {
  // PDO
  TransmissionTypes rpdo_types{.synchronous_remote = false, .asynchronous_remote = false};
  TransmissionTypes tpdo_types{};
  bool remote_frames = true;                     // TPDOs respond to RTR
  bool valid_pdo_may_be_remapped = false;        // otherwise 0601 0000h while bit 31 of the COB-ID is 0
  bool valid_pdo_parameters_may_change = false;  // inhibit time, SYNC start value; otherwise 0609 0030h
  bool valid_pdo_cob_id_may_change = false;      // CAN-ID without setting bit 31 before; otherwise 0609 0030h
  bool mapped_length_may_exceed_object = false;  // a longer length pads with zeros; otherwise 0604 0041h
  // Mapping entries that are accepted although they are longer than their object; they are padded with zeros.
  std::span<const std::uint32_t> padded_mappings{};
  std::span<const CobIdRange> cob_id_ranges{};  // other CAN-IDs: 0609 0030h
  bool rpdo_excess_length_is_reported = true;   // EMCY 8220h; the first bytes are used nevertheless
  bool type_254_sends_on_change = true;         // otherwise by event timer and trigger_tpdo() only
  bool type_255_sends_on_change = true;
  Time inhibit_time_unit = std::chrono::microseconds(100);  // of sub-index 3 of 1800h..; object 1015h is always 100 us

  // SDO
  bool sdo_segmented = true;                       // otherwise 0504 0001h
  bool sdo_block = true;                           // otherwise 0504 0001h
  Time sdo_timeout = std::chrono::seconds(5);      // between frames of a transfer, then 0504 0000h; 0: no timeout
  bool sdo_download_response_echoes_data = false;  // bytes 4..7 repeat the request instead of being 0
  bool sdo_expedited_upload_sign_extends = false;  // unused bytes repeat the highest bit instead of being 0

  // SYNC, TIME, EMCY
  bool sync_producer = true;                     // otherwise bit 30 of 1005h is refused with 0609 0030h
  bool sync_cob_id_fixed = false;                // the CAN-ID of 1005h cannot be changed
  bool time_consumer = true;                     // consumes TIME on 100h even without object 1012h
  bool emergency_on_error_reset = true;          // code 0000h (or 00xxh) when errors end
  bool error_reset_tells_the_last_only = false;  // ... and only when no error is left
  bool bus_off_is_reported_on_recovery = true;   // EMCY 8140h; otherwise the device reports it as its own error
  std::uint16_t frame_length_code = 0;           // EMCY for an NMT or SDO frame of wrong length; 0: none
  bool consumers_have_possible_nodes = false;    // 1016h: refuses a node above 127 with 0609 0030h; else ignores it
  bool errors_clear_on_restored_communication = true;  // error ends with the next heartbeat; else on NMT reset

  // Error control and NMT
  NodeGuarding node_guarding = NodeGuarding::heartbeat_wins;
  ErrorBehaviour error_behaviour = ErrorBehaviour::pre_operational;  // used without object 1029h
  bool starts_operational = false;                                   // enters operational after boot-up by itself
  // Objects restored to their saved values. CiA 301 7.3.2.2.1: reset node restores all, reset communication
  // 1000h..1FFFh.
  dictionary::Area reset_node_restores = dictionary::Area::all;
  dictionary::Area reset_communication_restores = dictionary::Area::communication;

  // LSS (CiA 305)
  bool lss = true;
};

}  // namespace servodrome::canopen
