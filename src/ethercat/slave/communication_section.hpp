#pragma once

#include "dictionary/numbered_names.hpp"
#include "dictionary/table.hpp"
#include "ethercat/slave/communication_objects.hpp"

// The objects 1000h..1FFFh as a table section over a CommunicationObjects<...> (ETG.1000.6 clause 5.6.7, ETG.1020
// clauses 12 and 17). A product sets the default values and removes the objects that it does not have. It adds
// 1008h..100Ah itself.
namespace servodrome::ethercat {

namespace section {

using dictionary::Access;
using dictionary::element;
using dictionary::Entry;
using dictionary::highest_sub;
using dictionary::number_constant;
using dictionary::NumberedNames;
using dictionary::ObjectCode;
using dictionary::Options;
using dictionary::Owner;
using dictionary::Pdo;
using dictionary::Type;
using dictionary::var;

template <std::size_t Count>
inline constexpr NumberedNames<Count> rx_mapping_names{"RxPDO ", " mapping"};
template <std::size_t Count>
inline constexpr NumberedNames<Count> tx_mapping_names{"TxPDO ", " mapping"};
template <std::size_t Count>
inline constexpr NumberedNames<Count> mapped_object_names{"Mapped object ", ""};
template <std::size_t Count>
inline constexpr NumberedNames<Count> assigned_pdo_names{"Assigned PDO ", ""};

constexpr Options owned(Options options = {}) {
  options.owner = Owner::communication;
  return options;
}

inline constexpr std::size_t sync_parameter_count = 15;

template <typename Objects>
constexpr auto communication() {
  constexpr auto record = ObjectCode::record;
  constexpr auto array = ObjectCode::array;
  constexpr std::size_t rx = Objects::rx_pdos;
  constexpr std::size_t tx = Objects::tx_pdos;
  constexpr std::size_t mapped = Objects::mapping_entries;
  constexpr std::size_t assigned = Objects::assigned;
  using Mapping = typename Objects::Mapping;
  using Assignment = typename Objects::Assignment;
  std::array<Entry, 15 + (rx + tx) * (1 + mapped) + 2 * (1 + assigned) + 2 * sync_parameter_count> table{};
  std::size_t n = 0;
  const auto add = [&](Entry entry) { table[n++] = entry; };

  add(var(0x1000, "Device type", SERVODROME_FIELD(Objects, device_type), Access::ro));
  add(var(0x1001, "Error register", SERVODROME_FIELD(Objects, error_register), Access::ro));
  add(highest_sub(0x1018, record, "Identity object", 4));
  add(element(0x1018, 1, record, "Vendor-ID", SERVODROME_FIELD(Objects, vendor_id), Access::ro));
  add(element(0x1018, 2, record, "Product code", SERVODROME_FIELD(Objects, product_code), Access::ro));
  add(element(0x1018, 3, record, "Revision number", SERVODROME_FIELD(Objects, revision_number), Access::ro));
  add(element(0x1018, 4, record, "Serial number", SERVODROME_FIELD(Objects, serial_number), Access::ro));
  add(highest_sub(0x10F1, record, "Error settings", 2));
  add(element(0x10F1, 1, record, "Local error reaction", SERVODROME_FIELD(Objects, local_error_reaction), Access::rw,
              Pdo::none, owned({.default_value = 1})));
  add(element(0x10F1, 2, record, "Sync error counter limit", SERVODROME_FIELD(Objects, sync_error_limit), Access::rw,
              Pdo::none, {.default_value = 4}));

  const auto mapping = [&](std::size_t i, std::uint16_t first, std::size_t at, const char* name) {
    const auto index = static_cast<std::uint16_t>(first + i);
    const std::size_t base = at + i * sizeof(Mapping);
    add(element(index, 0, record, name, dictionary::field_at<std::uint8_t>(base + offsetof(Mapping, count)), Access::rw,
                Pdo::none, owned({.minimum = 0, .maximum = static_cast<std::int64_t>(mapped)})));
    for (std::size_t k = 0; k < mapped; ++k) {
      add(element(index, static_cast<std::uint8_t>(k + 1), record, mapped_object_names<mapped>[k],
                  dictionary::field_at<std::uint32_t>(base + offsetof(Mapping, entry) + k * sizeof(std::uint32_t)),
                  Access::rw, Pdo::none, owned()));
    }
  };
  for (std::size_t i = 0; i < rx; ++i) mapping(i, 0x1600, offsetof(Objects, rx_mapping), rx_mapping_names<rx>[i]);
  for (std::size_t i = 0; i < tx; ++i) mapping(i, 0x1A00, offsetof(Objects, tx_mapping), tx_mapping_names<tx>[i]);

  add(highest_sub(0x1C00, array, "Sync manager communication type", 4));
  constexpr const char* channel_names[] = {"Sync manager 0", "Sync manager 1", "Sync manager 2", "Sync manager 3"};
  for (std::uint8_t i = 0; i < 4; ++i) {
    add(number_constant(0x1C00, static_cast<std::uint8_t>(i + 1), array, channel_names[i], Type::unsigned8, i + 1));
  }

  const auto assignment = [&](std::uint16_t index, std::size_t base, const char* name) {
    add(element(index, 0, array, name, dictionary::field_at<std::uint8_t>(base + offsetof(Assignment, count)),
                Access::rw, Pdo::none, owned({.minimum = 0, .maximum = static_cast<std::int64_t>(assigned)})));
    for (std::size_t k = 0; k < assigned; ++k) {
      add(element(index, static_cast<std::uint8_t>(k + 1), array, assigned_pdo_names<assigned>[k],
                  dictionary::field_at<std::uint16_t>(base + offsetof(Assignment, pdo) + k * sizeof(std::uint16_t)),
                  Access::rw, Pdo::none, owned()));
    }
  };
  assignment(0x1C12, offsetof(Objects, rx_assignment), "Sync manager 2 PDO assignment");
  assignment(0x1C13, offsetof(Objects, tx_assignment), "Sync manager 3 PDO assignment");

  const auto synchronisation = [&](std::uint16_t index, std::size_t base, const char* name) {
    const auto sub = [&]<typename T>(std::uint8_t number, const char* what, std::size_t offset, Access access, T,
                                     const char* unit = "") {
      add(element(index, number, record, what, dictionary::field_at<T>(base + offset), access, Pdo::none,
                  owned({.unit = unit})));
    };
    using S = SyncParameters;
    constexpr std::uint16_t u16 = 0;
    constexpr std::uint32_t u32 = 0;
    add(highest_sub(index, record, name, sync_parameter::sync_error));
    sub(sync_parameter::type, "Synchronization type", offsetof(S, type), Access::rw, u16);
    sub(sync_parameter::cycle_time, "Cycle time", offsetof(S, cycle_time_ns), Access::rw, u32, "ns");
    sub(sync_parameter::shift_time, "Shift time", offsetof(S, shift_time_ns), Access::rw, u32, "ns");
    sub(sync_parameter::types_supported, "Synchronization types supported", offsetof(S, types_supported), Access::ro,
        u16);
    sub(sync_parameter::least_cycle_time, "Minimum cycle time", offsetof(S, least_cycle_time_ns), Access::ro, u32,
        "ns");
    sub(sync_parameter::calc_and_copy_time, "Calc and copy time", offsetof(S, calc_and_copy_time_ns), Access::ro, u32,
        "ns");
    sub(sync_parameter::least_delay_time, "Minimum delay time", offsetof(S, least_delay_time_ns), Access::ro, u32,
        "ns");
    sub(sync_parameter::get_cycle_time, "Get cycle time", offsetof(S, get_cycle_time), Access::rw, u16);
    sub(sync_parameter::delay_time, "Delay time", offsetof(S, delay_time_ns), Access::ro, u32, "ns");
    sub(sync_parameter::sync0_cycle_time, "Sync0 cycle time", offsetof(S, sync0_cycle_time_ns), Access::ro, u32, "ns");
    sub(sync_parameter::events_missed, "SM event missed counter", offsetof(S, events_missed), Access::ro, u16);
    sub(sync_parameter::cycle_too_short, "Cycle time too small counter", offsetof(S, cycle_too_short), Access::ro, u16);
    sub(sync_parameter::shift_too_short, "Shift time too short counter", offsetof(S, shift_too_short), Access::ro, u16);
    sub(sync_parameter::sync_error, "Sync error", offsetof(S, sync_error), Access::ro, false);
  };
  synchronisation(0x1C32, offsetof(Objects, output_sync), "SM output parameter");
  synchronisation(0x1C33, offsetof(Objects, input_sync), "SM input parameter");
  return table;
}

// 1010h and 1011h, for devices that store on command. Reading them returns 1 (bit 0: stores on command); writing needs
// the signature.
inline constexpr auto storage = [] {
  constexpr const char* store_names[] = {"Save all parameters", "Save communication parameters",
                                         "Save application parameters", "Save manufacturer defined parameters"};
  constexpr const char* restore_names[] = {"Restore all default parameters", "Restore communication default parameters",
                                           "Restore application default parameters",
                                           "Restore manufacturer defined default parameters"};
  std::array<Entry, 10> table{};
  std::size_t n = 0;
  table[n++] = highest_sub(0x1010, ObjectCode::array, "Store parameters", 4);
  table[n++] = highest_sub(0x1011, ObjectCode::array, "Restore default parameters", 4);
  for (std::uint8_t i = 0; i < 4; ++i) {
    const auto sub = static_cast<std::uint8_t>(i + 1);
    table[n++] = element(0x1010, sub, ObjectCode::array, store_names[i], {Type::unsigned32}, Access::rw, Pdo::none,
                         owned({.default_value = 1}));
    table[n++] = element(0x1011, sub, ObjectCode::array, restore_names[i], {Type::unsigned32}, Access::rw, Pdo::none,
                         owned({.default_value = 1}));
  }
  return table;
}();

}  // namespace section

inline constexpr auto storage_section = section::storage;

template <typename Objects>
inline constexpr auto communication_section = section::communication<Objects>();

}  // namespace servodrome::ethercat
