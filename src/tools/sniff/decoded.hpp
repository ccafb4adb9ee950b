#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "axis/object_catalogue.hpp"
#include "links/time.hpp"
#include "master/object_address.hpp"

// Common types of the decoders of all buses.
namespace servodrome::master {

using links::Time;

// Kinds of frame; their names are the keywords of `sniff --filter kind=`.
enum class FrameKind : std::uint8_t {
  nmt,
  sync,
  time,
  emcy,
  pdo,
  sdo,
  heartbeat,
  guarding,
  lss,
  can,           // a CAN frame that belongs to no CANopen service
  state,         // AL control and AL status
  registers,     // other registers of a slave controller
  mailbox,       // mailbox message other than SDO and EMCY
  process_data,  // EtherCAT process data
  modbus,        // RTU or TCP
  serial10,      // the 10-byte protocol of the iSMK
  error,         // an error on the wire, reported by the link
  garbage,       // not a frame of this bus's protocol
};
inline constexpr std::size_t frame_kinds = 18;
std::string_view name(FrameKind kind);
std::optional<FrameKind> parse_frame_kind(std::string_view word);

// An object and its value from a frame.
struct DecodedValue {
  ObjectAddress object;
  std::string name;  // for example "6041:00 Statusword"
  std::string text;  // for example "567 (0237h) operation enabled"
};

// A decoded frame, or on EtherCAT a decoded datagram.
struct Decoded {
  Time time{};
  FrameKind kind = FrameKind::garbage;
  std::optional<unsigned> node;  // node-ID, station number, station address or position
  std::string source;            // the station concerned: "node 5", "slave 1001h"; empty: none
  std::string text;
  std::vector<DecodedValue> values;
  std::vector<ObjectAddress> objects;  // objects that it refers to, with or without a value
  bool error = false;                  // EMCY, abort, exception, lost frame, or invalid frame
  std::string raw;                     // bytes of the frame

  bool names(ObjectAddress object, bool whole_object) const;
};

// A value as text, with its meaning where a standard defines one (statusword's state, modes, error codes).
std::string value_text(ObjectAddress object, std::span<const std::byte> bytes, const ObjectCatalogue& catalogue);
DecodedValue decoded_value(ObjectAddress object, std::span<const std::byte> bytes, const ObjectCatalogue& catalogue);
// For example "6041:00 Statusword = 567 (0237h) operation enabled".
std::string text_of(const DecodedValue& value);

// For example "4B 41 60 00".
std::string hex_text(std::span<const std::uint8_t> bytes, std::size_t at_most = 64);

}  // namespace servodrome::master
