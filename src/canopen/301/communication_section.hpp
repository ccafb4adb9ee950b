#pragma once

#include "canopen/301/communication_objects.hpp"
#include "dictionary/numbered_names.hpp"
#include "dictionary/table.hpp"

// The objects 1000h..1FFFh as table sections (CiA 301 7.5.2) over a CommunicationObjects<...>. A product adds the
// sections that it needs (TableBuilder::add, append, pick) and removes or overrides single objects; the node works with
// the remaining ones. The product defines 1008h..100Ah itself (dictionary::text_constant).
namespace servodrome::canopen {

namespace section {

using dictionary::Access;
using dictionary::element;
using dictionary::Entry;
using dictionary::Field;
using dictionary::highest_sub;
using dictionary::NumberedNames;
using dictionary::ObjectCode;
using dictionary::Options;
using dictionary::Owner;
using dictionary::Pdo;
using dictionary::Type;
using dictionary::var;

template <std::size_t Count>
inline constexpr NumberedNames<Count> rpdo_parameter_names{"RPDO ", " communication parameter"};
template <std::size_t Count>
inline constexpr NumberedNames<Count> rpdo_mapping_names{"RPDO ", " mapping parameter"};
template <std::size_t Count>
inline constexpr NumberedNames<Count> tpdo_parameter_names{"TPDO ", " communication parameter"};
template <std::size_t Count>
inline constexpr NumberedNames<Count> tpdo_mapping_names{"TPDO ", " mapping parameter"};
template <std::size_t Count>
inline constexpr NumberedNames<Count> mapped_object_names{"Mapped object ", ""};
template <std::size_t Count>
inline constexpr NumberedNames<Count> error_field_names{"Standard error field ", ""};
template <std::size_t Count>
inline constexpr NumberedNames<Count> heartbeat_names{"Consumer heartbeat time ", ""};
template <std::size_t Count>
inline constexpr NumberedNames<Count> emergency_consumer_names{"Emergency consumer ", ""};

constexpr Options owned(Options options = {}) {
  options.owner = Owner::communication;
  return options;
}
constexpr Options kept(Options options = {}) {
  options.saved = true;
  return owned(options);
}

template <typename Objects>
constexpr auto general() {
  constexpr std::size_t errors = Objects::error_history;
  constexpr std::size_t consumers = Objects::heartbeat_consumer_count;
  constexpr auto array = ObjectCode::array;
  constexpr auto record = ObjectCode::record;
  std::array<Entry, 34 + errors + 2 * (1 + consumers)> table{};
  std::size_t n = 0;
  const auto add = [&](Entry entry) { table[n++] = entry; };
  const auto u32_in = [](std::size_t offset, std::size_t i) {
    return dictionary::field_at<std::uint32_t>(offset + i * sizeof(std::uint32_t));
  };

  add(var(0x1000, "Device type", SERVODROME_FIELD(Objects, device_type), Access::ro));
  add(var(0x1001, "Error register", SERVODROME_FIELD(Objects, error_register), Access::ro, Pdo::tpdo));
  add(var(0x1002, "Manufacturer status register", SERVODROME_FIELD(Objects, manufacturer_status_register), Access::ro,
          Pdo::tpdo));
  add(element(0x1003, 0, array, "Pre-defined error field", SERVODROME_FIELD(Objects, predefined_error_count),
              Access::rw, Pdo::none, owned()));
  for (std::size_t i = 0; i < errors; ++i) {
    add(element(0x1003, static_cast<std::uint8_t>(i + 1), array, error_field_names<errors>[i],
                u32_in(offsetof(Objects, predefined_error_field), i), Access::ro));
  }
  add(var(0x1005, "COB-ID SYNC message", SERVODROME_FIELD(Objects, cob_id_sync), Access::rw, Pdo::none,
          kept({.default_value = 0x80})));
  add(var(0x1006, "Communication cycle period", SERVODROME_FIELD(Objects, communication_cycle_period_us), Access::rw,
          Pdo::none, kept({.unit = "us"})));
  add(var(0x1007, "Synchronous window length", SERVODROME_FIELD(Objects, synchronous_window_length_us), Access::rw,
          Pdo::none, kept({.unit = "us"})));
  add(var(0x100C, "Guard time", SERVODROME_FIELD(Objects, guard_time_ms), Access::rw, Pdo::none, kept({.unit = "ms"})));
  add(var(0x100D, "Life time factor", SERVODROME_FIELD(Objects, life_time_factor), Access::rw, Pdo::none, kept()));
  // Reading 1010h and 1011h returns "saves on command" (bit 0), and writing needs a signature, so they have no storage.
  constexpr const char* store_names[] = {"Save all parameters", "Save communication parameters",
                                         "Save application parameters", "Save manufacturer defined parameters"};
  constexpr const char* restore_names[] = {"Restore all default parameters", "Restore communication default parameters",
                                           "Restore application default parameters",
                                           "Restore manufacturer defined default parameters"};
  add(highest_sub(0x1010, array, "Store parameters", 4));
  for (std::uint8_t i = 0; i < 4; ++i) {
    add(element(0x1010, static_cast<std::uint8_t>(i + 1), array, store_names[i], {Type::unsigned32}, Access::rw,
                Pdo::none, owned({.default_value = 1})));
  }
  add(highest_sub(0x1011, array, "Restore default parameters", 4));
  for (std::uint8_t i = 0; i < 4; ++i) {
    add(element(0x1011, static_cast<std::uint8_t>(i + 1), array, restore_names[i], {Type::unsigned32}, Access::rw,
                Pdo::none, owned({.default_value = 1})));
  }
  add(var(0x1012, "COB-ID time stamp object", SERVODROME_FIELD(Objects, cob_id_time), Access::rw, Pdo::none,
          kept({.default_value = 0x80000100})));
  add(var(0x1014, "COB-ID EMCY", SERVODROME_FIELD(Objects, cob_id_emergency), Access::rw, Pdo::none,
          kept({.default_value = 0x80, .adds_node_id = true})));
  add(var(0x1015, "Inhibit time EMCY", SERVODROME_FIELD(Objects, emergency_inhibit_time), Access::rw, Pdo::none,
          kept({.unit = "100 us"})));
  add(highest_sub(0x1016, array, "Consumer heartbeat time", static_cast<std::uint8_t>(consumers)));
  for (std::size_t i = 0; i < consumers; ++i) {
    add(element(0x1016, static_cast<std::uint8_t>(i + 1), array, heartbeat_names<consumers>[i],
                u32_in(offsetof(Objects, consumer_heartbeat_time), i), Access::rw, Pdo::none, kept()));
  }
  add(var(0x1017, "Producer heartbeat time", SERVODROME_FIELD(Objects, producer_heartbeat_time_ms), Access::rw,
          Pdo::none, kept({.unit = "ms"})));
  add(highest_sub(0x1018, record, "Identity object", 4));
  add(element(0x1018, 1, record, "Vendor-ID", SERVODROME_FIELD(Objects, vendor_id), Access::ro));
  add(element(0x1018, 2, record, "Product code", SERVODROME_FIELD(Objects, product_code), Access::ro));
  add(element(0x1018, 3, record, "Revision number", SERVODROME_FIELD(Objects, revision_number), Access::ro));
  add(element(0x1018, 4, record, "Serial number", SERVODROME_FIELD(Objects, serial_number), Access::ro));
  add(var(0x1019, "Synchronous counter overflow value", SERVODROME_FIELD(Objects, synchronous_counter_overflow),
          Access::rw, Pdo::none, kept()));
  add(highest_sub(0x1020, array, "Verify configuration", 2));
  add(element(0x1020, 1, array, "Configuration date", SERVODROME_FIELD(Objects, configuration_date), Access::rw,
              Pdo::none, {.saved = true}));
  add(element(0x1020, 2, array, "Configuration time", SERVODROME_FIELD(Objects, configuration_time), Access::rw,
              Pdo::none, {.saved = true}));
  add(highest_sub(0x1028, array, "Emergency consumer object", static_cast<std::uint8_t>(consumers)));
  for (std::size_t i = 0; i < consumers; ++i) {
    add(element(0x1028, static_cast<std::uint8_t>(i + 1), array, emergency_consumer_names<consumers>[i],
                u32_in(offsetof(Objects, emergency_consumer), i), Access::rw, Pdo::none,
                kept({.default_value = 0x80000000})));
  }
  add(highest_sub(0x1029, array, "Error behaviour", 1));
  add(element(0x1029, 1, array, "Communication error", SERVODROME_FIELD(Objects, communication_error_behaviour),
              Access::rw, Pdo::none, kept()));
  return table;
}

template <typename Objects>
constexpr auto sdo_server() {
  constexpr auto record = ObjectCode::record;
  return std::array<Entry, 3>{
      highest_sub(0x1200, record, "SDO server parameter", 2),
      element(0x1200, 1, record, "COB-ID client -> server", SERVODROME_FIELD(Objects, sdo_cob_id_client_to_server),
              Access::ro, Pdo::none, {.default_value = 0x600, .adds_node_id = true}),
      element(0x1200, 2, record, "COB-ID server -> client", SERVODROME_FIELD(Objects, sdo_cob_id_server_to_client),
              Access::ro, Pdo::none, {.default_value = 0x580, .adds_node_id = true}),
  };
}

}  // namespace section

// Sub-indices of 1400h.. or 1800h.. besides 1 (COB-ID) and 2 (transmission type).
struct PdoSubIndices {
  bool inhibit_time = true;      // 3
  bool event_timer = true;       // 5
  bool sync_start_value = true;  // 6
  std::uint8_t highest_sub = 0;  // value of sub-index 0; 0: the highest existing sub-index
};
inline constexpr PdoSubIndices rpdo_sub_indices{.inhibit_time = false, .event_timer = true, .sync_start_value = false};
inline constexpr PdoSubIndices tpdo_sub_indices{};

namespace section {

// The pre-defined connection set has four PDOs per direction (CiA 301 table 39); the default of all others is invalid.
constexpr std::int64_t default_pdo_cob_id(std::size_t pdo, std::int64_t first) {
  return pdo < 4 ? first + static_cast<std::int64_t>(pdo) * 0x100 : std::int64_t{0x80000000};
}

template <std::size_t Count, std::size_t MappingEntries>
struct PdoSection {
  std::array<Entry, Count*(6 + MappingEntries + 1)> entries{};
  std::size_t count = 0;
};

template <std::size_t Count, std::size_t MappingEntries>
constexpr auto pdos(std::uint16_t parameter_index, std::int64_t first_cob_id, std::size_t parameters_at,
                    std::size_t mappings_at, const NumberedNames<Count>& parameter_names,
                    const NumberedNames<Count>& mapping_names, PdoSubIndices subs) {
  PdoSection<Count, MappingEntries> section;
  const auto add = [&](Entry entry) { section.entries[section.count++] = entry; };
  constexpr auto record = ObjectCode::record;
  const std::uint8_t highest = subs.highest_sub != 0   ? subs.highest_sub
                               : subs.sync_start_value ? std::uint8_t{6}
                               : subs.event_timer      ? std::uint8_t{5}
                               : subs.inhibit_time     ? std::uint8_t{3}
                                                       : std::uint8_t{2};
  for (std::size_t i = 0; i < Count; ++i) {
    const auto index = static_cast<std::uint16_t>(parameter_index + i);
    const std::size_t base = parameters_at + i * sizeof(PdoParameters);
    const auto at = [base](Field field) {
      field.offset += static_cast<std::uint32_t>(base);
      return field;
    };
    add(highest_sub(index, record, parameter_names[i], highest));
    add(element(index, 1, record, "COB-ID used by PDO", at(SERVODROME_FIELD(PdoParameters, cob_id)), Access::rw,
                Pdo::none, kept({.default_value = default_pdo_cob_id(i, first_cob_id), .adds_node_id = i < 4})));
    add(element(index, 2, record, "Transmission type", at(SERVODROME_FIELD(PdoParameters, transmission_type)),
                Access::rw, Pdo::none, kept({.default_value = 255})));
    if (subs.inhibit_time) {
      add(element(index, 3, record, "Inhibit time", at(SERVODROME_FIELD(PdoParameters, inhibit_time)), Access::rw,
                  Pdo::none, kept({.unit = "100 us"})));
    }
    if (subs.event_timer) {
      add(element(index, 5, record, "Event timer", at(SERVODROME_FIELD(PdoParameters, event_timer)), Access::rw,
                  Pdo::none, kept({.unit = "ms"})));
    }
    if (subs.sync_start_value) {
      add(element(index, 6, record, "SYNC start value", at(SERVODROME_FIELD(PdoParameters, sync_start_value)),
                  Access::rw, Pdo::none, kept()));
    }
  }
  using Mapping = PdoMapping<MappingEntries>;
  for (std::size_t i = 0; i < Count; ++i) {
    const auto index = static_cast<std::uint16_t>(parameter_index + 0x200 + i);
    const std::size_t base = mappings_at + i * sizeof(Mapping);
    add(element(index, 0, record, mapping_names[i], dictionary::field_at<std::uint8_t>(base + offsetof(Mapping, count)),
                Access::rw, Pdo::none, kept()));
    for (std::size_t entry = 0; entry < MappingEntries; ++entry) {
      const std::size_t offset = base + offsetof(Mapping, objects) + entry * sizeof(std::uint32_t);
      add(element(index, static_cast<std::uint8_t>(entry + 1), record, mapped_object_names<MappingEntries>[entry],
                  dictionary::field_at<std::uint32_t>(offset), Access::rw, Pdo::none, kept()));
    }
  }
  return section;
}

// Dummy objects for RPDO mapping (CiA 301 7.4.7.1). Their indices are those of the data types; they store nothing.
constexpr auto dummies() {
  using dictionary::var;
  constexpr auto dummy = [](Type type, const char* name) {
    return var(static_cast<std::uint16_t>(type), name, {type}, Access::wo, Pdo::rpdo);
  };
  return std::array{
      dummy(Type::boolean, "Dummy BOOLEAN"),       dummy(Type::integer8, "Dummy INTEGER8"),
      dummy(Type::integer16, "Dummy INTEGER16"),   dummy(Type::integer32, "Dummy INTEGER32"),
      dummy(Type::unsigned8, "Dummy UNSIGNED8"),   dummy(Type::unsigned16, "Dummy UNSIGNED16"),
      dummy(Type::unsigned32, "Dummy UNSIGNED32"), dummy(Type::integer64, "Dummy INTEGER64"),
      dummy(Type::unsigned64, "Dummy UNSIGNED64"),
  };
}

}  // namespace section

// All objects 1000h..1029h. `Objects` is a CommunicationObjects<...>; pass the offset of that member in the device's
// objects struct as `base` of TableBuilder::add or append.
template <typename Objects>
inline constexpr auto general_section = section::general<Objects>();

// 1200h
template <typename Objects>
inline constexpr auto sdo_server_section = section::sdo_server<Objects>();

// 1400h.. with 1600h.., and 1800h.. with 1A00h..: valid as in the pre-defined connection set, type 255, empty mapping.
template <typename Objects, PdoSubIndices Subs = rpdo_sub_indices>
inline constexpr auto rpdo_section = dictionary::make_table<[] {
  return section::pdos<Objects::rpdo_count, Objects::mapping_entries>(
      0x1400, 0x200, offsetof(Objects, rpdo_parameters), offsetof(Objects, rpdo_mappings),
      section::rpdo_parameter_names<Objects::rpdo_count>, section::rpdo_mapping_names<Objects::rpdo_count>, Subs);
}>();
template <typename Objects, PdoSubIndices Subs = tpdo_sub_indices>
inline constexpr auto tpdo_section = dictionary::make_table<[] {
  return section::pdos<Objects::tpdo_count, Objects::mapping_entries>(
      0x1800, 0x180, offsetof(Objects, tpdo_parameters), offsetof(Objects, tpdo_mappings),
      section::tpdo_parameter_names<Objects::tpdo_count>, section::tpdo_mapping_names<Objects::tpdo_count>, Subs);
}>();

// 0001h..0007h, 0015h, 001Bh. The product selects the entries that may be mapped.
inline constexpr auto dummy_section = section::dummies();

}  // namespace servodrome::canopen
