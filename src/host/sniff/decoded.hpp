#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host/object_address.hpp"
#include "host/object_catalogue.hpp"
#include "links/time.hpp"

// What the decoders of all buses have in common.
namespace servodrome::host {

using links::Time;

// What a frame is about; the words of `sniff --filter kind=`.
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
  can,           // a CAN frame of no CANopen service
  state,         // AL control and AL status
  registers,     // other registers of slave controllers
  mailbox,       // in an EtherCAT mailbox: neither SDO nor EMCY
  process_data,  // EtherCAT
  modbus,        // RTU or TCP
  serial10,      // the 10-byte protocol of the iSMK
  error,         // an error on the wire, as the link tells it
  garbage,       // not what its bus speaks
};
inline constexpr std::size_t frame_kinds = 18;
std::string_view name(FrameKind kind);
std::optional<FrameKind> parse_frame_kind(std::string_view word);

// An object with the value that a frame carries for it.
struct DecodedValue {
  ObjectAddress object;
  std::string name;  // "6041:00 Statusword"
  std::string text;  // "567 (0237h) operation enabled"
};

// A frame, or on EtherCAT a datagram, in words.
struct Decoded {
  Time time{};
  FrameKind kind = FrameKind::garbage;
  std::optional<unsigned> node;  // node-ID, station, station address or position
  std::string source;            // which station it is about: "node 5", "slave 1001h"; empty: none
  std::string text;
  std::vector<DecodedValue> values;
  std::vector<ObjectAddress> objects;  // it names, with a value or without
  bool error = false;                  // an EMCY, abort, exception, lost frame, or no frame at all
  std::string raw;                     // its bytes

  bool names(ObjectAddress object, bool whole_object) const;
};

// A value of an object as people read it: numbers with their meaning where a standard gives one (state of the
// statusword, modes, error codes).
std::string value_text(ObjectAddress object, std::span<const std::byte> bytes, const ObjectCatalogue& catalogue);
DecodedValue decoded_value(ObjectAddress object, std::span<const std::byte> bytes, const ObjectCatalogue& catalogue);
// "6041:00 Statusword = 567 (0237h) operation enabled"
std::string text_of(const DecodedValue& value);

// "4B 41 60 00"
std::string hex_text(std::span<const std::uint8_t> bytes, std::size_t at_most = 64);

}  // namespace servodrome::host
