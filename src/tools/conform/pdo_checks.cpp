// PDOs on CAN: rules of configuration, and transmission and reception.
#include <algorithm>

#include "tools/conform/check_tables.hpp"
#include "tools/conform/frames.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::pdo_group {
namespace {

using namespace std::chrono_literals;
using dictionary::AbortCode;

constexpr std::uint16_t first_rpdo = 0x1400;
constexpr std::uint16_t first_tpdo = 0x1800;
constexpr std::uint32_t statusword_entry = 0x60410010;
constexpr std::uint32_t position_entry = 0x60640020;

SdoClient& sdo(Trial& trial) { return trial.subject().can().sdo; }

PdoConfiguration need_pdo(Trial& trial, std::uint16_t index) {
  const auto pdo = read_pdo(sdo(trial), index);
  if (!pdo) Trial::skip(fmt::format("it has no {:04X}h", index));
  return *pdo;
}

std::uint32_t default_cob_id(Trial& trial, std::uint16_t index) {
  return (index < first_tpdo ? 0x200U : 0x180U) + sdo(trial).node_id();
}

// Sets up the PDO with this mapping and type on its default identifier, and makes it valid; ends the check if the drive
// refuses it.
PdoConfiguration set_up(Trial& trial, const PdoConfiguration& before, std::vector<std::uint32_t> mapping,
                        std::uint8_t type) {
  PdoConfiguration pdo = before;
  pdo.cob_id = (before.cob_id & 0x40000000) | default_cob_id(trial, before.index);
  pdo.mapping = std::move(mapping);
  pdo.parameters.clear();
  pdo.parameters[2] = {std::byte{type}};
  const auto refusal = Trial::refusal_of([&] { write_pdo(sdo(trial), pdo); });
  trial.require(!refusal, fmt::format("set up {:04X}h with type {}, by the procedure of 7.5.2.36", before.index, type),
                "taken", text_of(refusal));
  return pdo;
}

void start(Trial& trial) {
  trial.subject().master().command(NmtCommand::start, sdo(trial).node_id());
  trial.subject().can().bus.run_for(20ms);
}
// Starts the node; the destructor returns it to pre-operational.
class Started {
 public:
  explicit Started(Trial& trial) : trial_(trial) { start(trial); }
  ~Started() {
    try {
      trial_.subject().master().command(NmtCommand::enter_pre_operational, sdo(trial_).node_id());
      trial_.subject().can().bus.run_for(20ms);
    } catch (const MasterError&) {
      // The next access reports the error.
    }
  }
  Started(const Started&) = delete;
  Started& operator=(const Started&) = delete;

 private:
  Trial& trial_;
};

void mapping_while_valid(Trial& trial, int row) {
  const PdoConfiguration before = need_pdo(trial, row == 0 ? first_rpdo : first_tpdo);
  const PdoGuard guard(sdo(trial), before);
  PdoConfiguration pdo = before;
  pdo.cob_id = (before.cob_id & 0x40000000) | default_cob_id(trial, before.index);
  write_pdo(sdo(trial), pdo);
  const std::uint16_t mapping = pdo.mapping_index();
  if (pdo.mapping.empty()) Trial::skip("its mapping is empty");
  trial.expect_refused(fmt::format("write {:04X}h sub 0 = 0 while the PDO is valid", mapping), {},
                       [&] { sdo(trial).write<std::uint8_t>(mapping, 0, 0); });
  const auto count = sdo(trial).read<std::uint8_t>(mapping, 0);
  trial.expect(count == pdo.mapping.size(), fmt::format("read {:04X}h sub 0", mapping),
               fmt::format("{}, as before", pdo.mapping.size()), fmt::format("{}", count));
}

void mapping_while_counted(Trial& trial, int) {
  const PdoConfiguration before = need_pdo(trial, first_tpdo);
  const PdoGuard guard(sdo(trial), before);
  if (before.mapping.empty()) Trial::skip("its mapping is empty");
  sdo(trial).write<std::uint32_t>(first_tpdo, 1, before.cob_id | pdo_invalid);
  trial.expect_refused(fmt::format("write {:04X}h sub 1 while sub 0 is not 0", before.mapping_index()), {},
                       [&] { sdo(trial).write<std::uint32_t>(before.mapping_index(), 1, position_entry); });
}

void identifier_while_valid(Trial& trial, int row) {
  const PdoConfiguration before = need_pdo(trial, row == 0 ? first_rpdo : first_tpdo);
  const PdoGuard guard(sdo(trial), before);
  const std::uint32_t present = (before.cob_id & 0x40000000) | default_cob_id(trial, before.index);
  PdoConfiguration pdo = before;
  pdo.cob_id = present;
  write_pdo(sdo(trial), pdo);
  trial.expect_refused(fmt::format("write {:04X}h sub 1 = {:08X}h while it is valid", before.index, present + 0x10), {},
                       [&] { sdo(trial).write<std::uint32_t>(before.index, 1, present + 0x10); });
  const auto after = sdo(trial).read<std::uint32_t>(before.index, 1);
  trial.expect((after & 0x7FF) == (present & 0x7FF), fmt::format("read {:04X}h sub 1", before.index),
               fmt::format("{:08X}h, as before", present), fmt::format("{:08X}h", after));
}

void mapping_errors(Trial& trial, int) {
  const PdoConfiguration before = need_pdo(trial, first_tpdo);
  const PdoGuard guard(sdo(trial), before);
  const std::uint16_t mapping = before.mapping_index();
  sdo(trial).write<std::uint32_t>(first_tpdo, 1, before.cob_id | pdo_invalid);
  if (Trial::refusal_of([&] { sdo(trial).write<std::uint8_t>(mapping, 0, 0); })) Trial::skip("its mapping is fixed");
  trial.expect_refused("map 5FFE:00, which is not there", {AbortCode::object_does_not_exist, AbortCode::not_mappable},
                       [&] { sdo(trial).write<std::uint32_t>(mapping, 1, 0x5FFE0010); });
  trial.expect_refused("map 1018:01, a constant", {AbortCode::not_mappable},
                       [&] { sdo(trial).write<std::uint32_t>(mapping, 1, 0x10180120); });
  // 12 bytes, more than a PDO can have.
  const auto refusal = Trial::refusal_of([&] {
    for (const std::uint8_t sub : {std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{3}})
      sdo(trial).write<std::uint32_t>(mapping, sub, position_entry);
    sdo(trial).write<std::uint8_t>(mapping, 0, 3);
  });
  trial.expect(refusal && refusal->code == AbortCode::mapping_exceeds_pdo_length, "map 6064h three times, 12 bytes",
               "refused with " + text_of(AbortCode::mapping_exceeds_pdo_length), text_of(refusal));
}

void reserved_type(Trial& trial, int) {
  const PdoConfiguration before = need_pdo(trial, first_tpdo);
  const PdoGuard guard(sdo(trial), before);
  sdo(trial).write<std::uint32_t>(first_tpdo, 1, before.cob_id | pdo_invalid);
  trial.expect_refused("write 1800h sub 2 = 245, reserved",
                       {AbortCode::value_invalid, AbortCode::value_too_high, AbortCode::value_too_low},
                       [&] { sdo(trial).write<std::uint8_t>(first_tpdo, 2, 245); });
}

unsigned count_for(Trial& trial, std::uint32_t can_id, Time span) {
  Bus& bus = trial.subject().can().bus;
  const Watch watch(bus, can_id);
  bus.run_for(span);
  return static_cast<unsigned>(watch.arrivals().size());
}

// Type n: sent at every n-th SYNC, with the values of that moment.
void synchronous(Trial& trial, int) {
  const PdoConfiguration before = need_pdo(trial, first_tpdo);
  const PdoGuard guard(sdo(trial), before);
  Bus& bus = trial.subject().can().bus;
  for (const std::uint8_t type : {std::uint8_t{1}, std::uint8_t{3}}) {
    const PdoConfiguration pdo = set_up(trial, before, {statusword_entry}, type);
    const Started started(trial);
    bus.run_for(50ms);
    const Watch watch(bus, pdo.can_id());
    bus.run_for(50ms);
    trial.expect(watch.arrivals().empty(), fmt::format("type {}, no SYNC", type), "no TPDO",
                 fmt::format("{}", watch.arrivals().size()));
    for (int i = 0; i < 6; ++i) {
      trial.subject().master().send_sync();
      bus.run_for(10ms);
    }
    const std::size_t wanted = 6U / type;
    trial.expect(watch.arrivals().size() == wanted, fmt::format("type {}, 6 SYNCs", type),
                 fmt::format("{} TPDOs", wanted), fmt::format("{}", watch.arrivals().size()));
    if (!watch.arrivals().empty()) {
      const Frame& frame = watch.arrivals().back().frame;
      const auto value = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
      const std::uint16_t wordnow = trial.statusword();
      trial.expect(frame.length == 2 && value == wordnow, "6041h mapped", fmt::format("2 bytes, {:04X}h", wordnow),
                   fmt::format("{} bytes, {:04X}h", frame.length, value));
    }
  }
}

void only_in_operational(Trial& trial, int) {
  const PdoConfiguration before = need_pdo(trial, first_tpdo);
  const PdoGuard guard(sdo(trial), before);
  const PdoConfiguration pdo = set_up(trial, before, {statusword_entry}, 1);
  Bus& bus = trial.subject().can().bus;
  trial.subject().master().command(NmtCommand::enter_pre_operational, sdo(trial).node_id());
  bus.run_for(50ms);
  const Watch watch(bus, pdo.can_id());
  for (int i = 0; i < 3; ++i) {
    trial.subject().master().send_sync();
    bus.run_for(10ms);
  }
  trial.expect(watch.arrivals().empty(), "3 SYNCs in pre-operational", "no TPDO",
               fmt::format("{}", watch.arrivals().size()));
}

void invalid_is_silent(Trial& trial, int) {
  const PdoConfiguration before = need_pdo(trial, first_tpdo);
  const PdoGuard guard(sdo(trial), before);
  const PdoConfiguration pdo = set_up(trial, before, {statusword_entry}, 1);
  sdo(trial).write<std::uint32_t>(first_tpdo, 1, pdo.cob_id | pdo_invalid);
  Bus& bus = trial.subject().can().bus;
  const Started started(trial);
  const Watch watch(bus, pdo.can_id());
  for (int i = 0; i < 3; ++i) {
    trial.subject().master().send_sync();
    bus.run_for(10ms);
  }
  trial.expect(watch.arrivals().empty(), "1800h sub 1 bit 31 = 1, 3 SYNCs", "no TPDO",
               fmt::format("{}", watch.arrivals().size()));
}

void event_timer(Trial& trial, int) {
  const PdoConfiguration before = need_pdo(trial, first_tpdo);
  if (!before.parameters.contains(5)) Trial::skip("it has no event timer, 1800h sub 5");
  const PdoGuard guard(sdo(trial), before);
  PdoConfiguration pdo = set_up(trial, before, {statusword_entry}, 255);
  sdo(trial).write<std::uint32_t>(first_tpdo, 1, pdo.cob_id | pdo_invalid);
  if (before.parameters.contains(3)) sdo(trial).write<std::uint16_t>(first_tpdo, 3, 0);
  const auto refusal = Trial::refusal_of([&] { sdo(trial).write<std::uint16_t>(first_tpdo, 5, 20); });
  if (refusal) Trial::skip("it takes no event timer of 20 ms: " + refusal->text);
  sdo(trial).write<std::uint32_t>(first_tpdo, 1, pdo.cob_id);
  const Started started(trial);
  trial.subject().can().bus.run_for(50ms);
  const unsigned count = count_for(trial, pdo.can_id(), 400ms);
  trial.expect(count >= 17 && count <= 23, "1800h sub 5 = 20 ms, 400 ms long", "20 TPDOs", fmt::format("{}", count));
}

void inhibit_time(Trial& trial, int) {
  const PdoConfiguration before = need_pdo(trial, first_tpdo);
  if (!before.parameters.contains(3) || !before.parameters.contains(5))
    Trial::skip("it has not both inhibit time and event timer");
  const PdoGuard guard(sdo(trial), before);
  PdoConfiguration pdo = set_up(trial, before, {statusword_entry}, 255);
  sdo(trial).write<std::uint32_t>(first_tpdo, 1, pdo.cob_id | pdo_invalid);
  const auto refusal = Trial::refusal_of([&] {
    sdo(trial).write<std::uint16_t>(first_tpdo, 3, 500);  // in units of 100 us: 50 ms
    sdo(trial).write<std::uint16_t>(first_tpdo, 5, 10);
  });
  if (refusal) Trial::skip("it takes no inhibit time of 50 ms: " + refusal->text);
  sdo(trial).write<std::uint32_t>(first_tpdo, 1, pdo.cob_id);
  const Started started(trial);
  Bus& bus = trial.subject().can().bus;
  const Watch watch(bus, pdo.can_id());
  bus.run_for(500ms);
  Time shortest = 1s;
  for (std::size_t i = 1; i < watch.arrivals().size(); ++i)
    shortest = std::min(shortest, watch.arrivals()[i].at - watch.arrivals()[i - 1].at);
  trial.expect(shortest >= 47ms, "1800h sub 3 = 50 ms, sub 5 = 10 ms", "50 ms between TPDOs at least",
               fmt::format("{:.1f} ms", std::chrono::duration<double, std::milli>(shortest).count()));
}

// The checks of RPDOs write the profile velocity, which has no effect on an axis at rest.
constexpr std::uint32_t harmless_entry = 0x60810020;

std::uint32_t harmless(Trial& trial) { return trial.objects().read<std::uint32_t>(0x6081); }

void send_number(Trial& trial, std::uint32_t can_id, std::uint32_t value, std::size_t bytes) {
  const std::array<std::uint8_t, 8> data{static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value >> 8),
                                         static_cast<std::uint8_t>(value >> 16),
                                         static_cast<std::uint8_t>(value >> 24)};
  trial.subject().master().send_pdo(can_id, std::span(data).first(bytes));
  trial.subject().can().bus.run_for(20ms);
}

void rpdo_acts(Trial& trial, int row) {
  const PdoConfiguration before = need_pdo(trial, first_rpdo);
  if (!trial.objects().read_if_present<std::uint32_t>(0x6081)) Trial::skip("it has no 6081h to be written by an RPDO");
  trial.objects().keep({0x6081, 0});
  const PdoGuard guard(sdo(trial), before);
  const bool with_sync = row == 1;
  const PdoConfiguration pdo = set_up(trial, before, {harmless_entry}, with_sync ? 1 : 255);
  const std::uint32_t old = harmless(trial);
  const std::uint32_t value = old + 1;
  const Started started(trial);
  send_number(trial, pdo.can_id(), value, 4);
  const std::uint32_t at_once = harmless(trial);
  if (!with_sync) {
    trial.expect(at_once == value, fmt::format("RPDO with {}, type 255", value), fmt::format("6081h = {}", value),
                 fmt::format("{}", at_once));
    return;
  }
  trial.expect(at_once == old, fmt::format("RPDO with {}, type 1, before the SYNC", value),
               fmt::format("6081h = {}, as before", old), fmt::format("{}", at_once));
  trial.subject().master().send_sync();
  trial.subject().can().bus.run_for(20ms);
  const std::uint32_t after = harmless(trial);
  trial.expect(after == value, "SYNC", fmt::format("6081h = {}", value), fmt::format("{}", after));
}

void rpdo_length(Trial& trial, int) {
  const PdoConfiguration before = need_pdo(trial, first_rpdo);
  if (!trial.objects().read_if_present<std::uint32_t>(0x6081)) Trial::skip("it has no 6081h to be written by an RPDO");
  trial.objects().keep({0x6081, 0});
  const PdoGuard guard(sdo(trial), before);
  const PdoConfiguration pdo = set_up(trial, before, {harmless_entry}, 255);
  const std::uint32_t old = harmless(trial);
  const Started started(trial);
  const Watch emergencies(trial.subject().can().bus, 0x80U + sdo(trial).node_id());
  send_number(trial, pdo.can_id(), old + 7, 2);
  const std::uint32_t after = harmless(trial);
  trial.expect(after == old, "RPDO of 2 bytes where 4 are mapped", fmt::format("6081h = {}, as before", old),
               fmt::format("{}", after));
  const auto first =
      emergencies.arrivals().empty() ? std::nullopt : parse_emergency(emergencies.arrivals().front().frame);
  trial.expect(first && first->code == 0x8210, "RPDO of 2 bytes where 4 are mapped", "an emergency 8210h",
               first ? text_of(*first) : "none");
}

constexpr auto procedure = "CiA 301 7.5.2.36 and 7.5.2.38, mapping procedure";
constexpr auto cob_id = "CiA 301 7.5.2.35 and 7.5.2.37, sub-index 1";
constexpr auto type = "CiA 301 7.5.2.37, sub-index 2, and 7.2.2.2";

constexpr std::array rows{
    Check{"pdo.rpdo-mapping-while-valid", procedure, "The mapping of a valid RPDO cannot be changed", Demand::nothing,
          buses::can, mapping_while_valid, 0},
    Check{"pdo.tpdo-mapping-while-valid", procedure, "The mapping of a valid TPDO cannot be changed", Demand::nothing,
          buses::can, mapping_while_valid, 1},
    Check{"pdo.mapping-while-counted", procedure, "A mapping entry cannot be written unless sub-index 0 is 0",
          Demand::nothing, buses::can, mapping_while_counted},
    Check{"pdo.rpdo-identifier-while-valid", cob_id, "The identifier of a valid RPDO cannot be changed",
          Demand::nothing, buses::can, identifier_while_valid, 0},
    Check{"pdo.tpdo-identifier-while-valid", cob_id, "The identifier of a valid TPDO cannot be changed",
          Demand::nothing, buses::can, identifier_while_valid, 1},
    Check{"pdo.mapping-errors", "CiA 301 table 22",
          "Objects that cannot be mapped are refused with the right abort code", Demand::nothing, buses::can,
          mapping_errors},
    Check{"pdo.reserved-type", type, "A reserved transmission type is refused", Demand::nothing, buses::can,
          reserved_type},
    Check{"pdo.synchronous", type, "A TPDO of type n is sent with every n-th SYNC, and only then", Demand::nothing,
          buses::can, synchronous},
    Check{"pdo.only-in-operational", "CiA 301 7.3.2.4, table 37", "There are no PDOs in pre-operational",
          Demand::nothing, buses::can, only_in_operational},
    Check{"pdo.invalid", cob_id, "A TPDO that is not valid is not sent", Demand::nothing, buses::can,
          invalid_is_silent},
    Check{"pdo.event-timer", "CiA 301 7.5.2.37, sub-index 5", "The event timer sends with its period", Demand::nothing,
          buses::can, event_timer},
    Check{"pdo.inhibit-time", "CiA 301 7.5.2.37, sub-index 3", "The inhibit time separates TPDOs", Demand::nothing,
          buses::can, inhibit_time},
    Check{"pdo.rpdo", "CiA 301 7.2.2.2", "An RPDO of type 255 takes effect immediately", Demand::nothing, buses::can,
          rpdo_acts, 0},
    Check{"pdo.rpdo-synchronous", "CiA 301 7.2.2.2", "A synchronous RPDO takes effect with the next SYNC",
          Demand::nothing, buses::can, rpdo_acts, 1},
    Check{"pdo.rpdo-length", "CiA 301 7.2.7.1, table 26, 8210h",
          "A short RPDO is ignored and reported by emergency 8210h", Demand::nothing, buses::can, rpdo_length},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::pdo_group
