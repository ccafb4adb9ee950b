// The homing mode: bits 10, 12 and 13, and the home offset. Uses methods that do not move the axis.
#include <algorithm>
#include <cmath>

#include "axis/cia402_words.hpp"
#include "catalogue/product.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::homing_group {
namespace {

using namespace std::chrono_literals;

// Method 35; or 37 if 60E3h lists it or 35 is refused: the present position becomes home. Skips the check if the drive
// has neither.
std::int8_t choose_method(Trial& trial) {
  const auto listed = [&](std::int8_t method) {
    const auto count = trial.objects().read_if_present<std::uint8_t>(0x60E3, 0).value_or(0);
    for (unsigned sub = 1; sub <= count; ++sub) {
      if (trial.objects().read<std::int8_t>(0x60E3, static_cast<std::uint8_t>(sub)) == method) return true;
    }
    return false;
  };
  const bool has_37 = listed(37);
  for (const std::int8_t method : {std::int8_t{35}, std::int8_t{37}}) {
    if (method == 35 && has_37) continue;
    if (!Trial::refusal_of([&] { trial.objects().write<std::int8_t>(0x6098, 0, method); })) return method;
  }
  Trial::skip("it has neither homing method 37 nor 35, which do not move the axis");
}

// Enables homing mode with speeds and acceleration above 0, because some drives treat 0 as an error.
void prepare(Trial& trial) {
  trial.units();
  trial.enable(OperationMode::homing);
  choose_method(trial);
  const AxisUnits unit = trial.units();
  for (const std::uint8_t sub : {std::uint8_t{1}, std::uint8_t{2}}) {
    if (trial.objects().read_if_present<std::uint32_t>(0x6099, sub).value_or(1) != 0) continue;
    trial.objects().write<std::uint32_t>(0x6099, sub, static_cast<std::uint32_t>(Trial::whole(unit.velocity * 0.2)));
  }
  if (trial.objects().read_if_present<std::uint32_t>(0x609A).value_or(1) == 0) {
    trial.objects().write<std::uint32_t>(0x609A, 0, static_cast<std::uint32_t>(Trial::whole(unit.acceleration)));
  }
  trial.control(command_word::enable_operation);
}

struct Bits {
  std::uint16_t attained;
  std::uint16_t error;
};
Bits bits_of(Trial& trial) {
  const catalogue::HomingSignals& signals = trial.settings().product->dialect.homing_signals;
  return {signals.attained, signals.error};
}

// True if the axis stays where it is at the end of homing, and 607Ch shifts its zero.
bool offset_shifts_zero(Trial& trial) {
  const catalogue::HomeOffset& offset = trial.settings().product->dialect.home_offset;
  if (!offset.travels) return true;
  if (!offset.stays_with_1) return false;
  const ObjectAddress stays = *offset.stays_with_1;
  return !Trial::refusal_of([&] { trial.objects().write<std::uint8_t>(stays.index, stays.sub, 1); });
}

// The master cannot write the position. So the axis is homed again at its present position, with an offset that
// restores the former position. Editions and makers differ in the sign of the offset.
void home_to(Trial& trial, std::int64_t position) {
  if (!offset_shifts_zero(trial)) return;
  for (const std::int64_t sign : {1, -1}) {
    const auto offset = static_cast<std::int32_t>(sign * position);
    trial.control(command_word::enable_operation);
    if (Trial::refusal_of([&] { trial.objects().write<std::int32_t>(0x607C, 0, offset); })) return;
    trial.control(command_word::enable_operation | start_homing);
    trial.wait_for(bits_of(trial).attained, bits_of(trial).attained);
    trial.wait(50ms);
    const double error = trial.way(position, trial.position());
    if (std::abs(error) <= trial.units().position / 100.0) break;
  }
  trial.control(command_word::enable_operation);
}

// False if the axis is not enabled, or does not come to rest: then it cannot be homed.
bool stops(Trial& trial) {
  if (trial.state() != PowerState::operation_enabled) return false;
  trial.control(command_word::enable_operation | control_bit::halt);
  return trial.wait_for_rest() && trial.state() == PowerState::operation_enabled;
}

// Runs a check that homes the axis. Then stops the axis and restores the position value, also if the check ends early
// or is cancelled. `check` returns the distance that the axis has travelled.
template <typename Homing>
void with_position_restored(Trial& trial, const Homing& check) {
  const std::int32_t before = trial.position();
  const auto restore = [&](std::int64_t travelled) {
    trial.subject().expect_position(before + travelled, trial.units().position / 50.0);
    const auto uninterrupted = trial.objects().without_cancellation();
    try {
      if (stops(trial)) home_to(trial, before + travelled);
    } catch (const MasterError&) {
      // Subject::settle() reports a position value that is not restored.
    }
  };
  std::int32_t travelled = 0;
  try {
    travelled = check();
  } catch (...) {
    restore(0);
    throw;
  }
  restore(travelled);
}

void attained(Trial& trial, int) {
  prepare(trial);
  with_position_restored(trial, [&] {
    const Bits bits = bits_of(trial);
    trial.objects().write<std::int32_t>(0x607C, 0, 0);
    trial.control(command_word::enable_operation | start_homing);
    const bool done = trial.wait_for(bits.attained | bits.error, bits.attained);
    const std::uint16_t word = trial.statusword();
    trial.require(done, fmt::format("6098h = {}, 6040h = 001Fh", trial.objects().read<std::int8_t>(0x6098)),
                  fmt::format("homing attained, bit {} of 6041h = 1, without error", bits.attained == 0x8000 ? 15 : 12),
                  fmt::format("{:04X}h", word));
    trial.expect(bits.attained == 0x1000, "homed", "homing attained is bit 12 of 6041h",
                 bits.attained == 0x1000 ? "bit 12" : "bit 15, and bit 12 is an error");
    trial.expect(trial.wait_for(status_bit::target_reached, status_bit::target_reached, 500ms), "homing attained",
                 "bit 10 of 6041h = 1 as well", fmt::format("{:04X}h", trial.statusword()));
    const std::int32_t position = trial.position();
    trial.expect(std::abs(trial.way(0, position)) <= trial.units().position / 50.0, "607Ch = 0, homed",
                 "6064h = 0 there", fmt::format("{}", position));
    return 0;
  });
}

void not_by_itself(Trial& trial, int) {
  prepare(trial);
  const Bits bits = bits_of(trial);
  const std::int32_t before = trial.position();
  trial.wait(200ms);
  const std::int32_t after = trial.position();
  trial.expect(std::abs(trial.way(before, after)) <= trial.units().position / 100.0, "homing mode, bit 4 of 6040h = 0",
               fmt::format("6064h = {}, no homing", before), fmt::format("{}", after));
  trial.expect((trial.statusword() & bits.error) == 0, "homing mode, bit 4 of 6040h = 0", "no homing error",
               fmt::format("{:04X}h", trial.statusword()));
}

// Revolutions per second, for a search of 0.3 s.
double slow_search(const Trial& trial) { return std::min(0.1, 2.0 * trial.settings().revolutions); }

// Starting a new homing clears the old result: a search for a switch that does not exist continues or fails.
void not_attained_while_searching(Trial& trial, int) {
  trial.units();
  trial.enable(OperationMode::homing);
  if (Trial::refusal_of([&] { trial.objects().write<std::int8_t>(0x6098, 0, 19); })) {
    Trial::skip("it has no homing method 19, a search for the home switch");
  }
  const AxisUnits unit = trial.units();
  const auto slow = static_cast<std::uint32_t>(std::max(1, Trial::whole(unit.velocity * slow_search(trial))));
  const auto ramp = static_cast<std::uint32_t>(std::max(1, Trial::whole(unit.acceleration * 5.0)));
  trial.objects().write<std::uint32_t>(0x6099, 1, slow);
  trial.objects().write<std::uint32_t>(0x6099, 2, slow);
  trial.write_if_present<std::uint32_t>(0x609A, 0, ramp);
  const Bits bits = bits_of(trial);
  const std::int32_t start = trial.position();
  trial.subject().expect_position(start, unit.position / 4.0);  // the search moves the axis by less
  trial.control(command_word::enable_operation);
  trial.control(command_word::enable_operation | start_homing);
  const Time end = trial.now() + 300ms;
  bool told = false;
  bool moved = false;
  while (trial.now() < end && !told) {
    trial.wait(trial.settings().poll_interval);
    const std::uint16_t word = trial.statusword();
    moved = moved || std::abs(trial.way(start, trial.position())) > unit.position / 200.0;
    told = moved && (word & bits.attained) != 0 && (word & status_bit::target_reached) != 0 &&
           std::abs(trial.velocity()) > unit.velocity * slow_search(trial) / 5.0;
  }
  if (!moved && !told)
    Trial::skip("the axis did not move: its home switch may be active, or the method needs other settings");
  trial.expect(!told, "6098h = 19, 6040h = 001Fh, while the axis moves", "homing is not attained",
               told ? fmt::format("6041h = {:04X}h", trial.statusword()) : "not attained");
}

void offset(Trial& trial, int) {
  prepare(trial);
  with_position_restored(trial, [&] {
    const std::int32_t wanted = trial.distance() / 10;
    const Bits bits = bits_of(trial);
    trial.objects().write<std::int32_t>(0x607C, 0, wanted);
    trial.control(command_word::enable_operation | start_homing);
    trial.require(trial.wait_for(bits.attained, bits.attained), fmt::format("607Ch = {}, homed", wanted),
                  "homing attained", fmt::format("{:04X}h", trial.statusword()));
    trial.wait(50ms);
    const std::int32_t position = trial.position();
    const double tolerance = trial.units().position / 50.0;
    // CiA 402-2 figure "home offset": the offset is the distance between zero and home. Editions and makers differ in
    // its sign.
    const bool is_shifted = trial.expect(std::abs(std::abs(trial.way(0, position)) - wanted) <= tolerance,
                                         fmt::format("607Ch = {}, homed", wanted),
                                         fmt::format("6064h = {0} or -{0}", wanted), fmt::format("{}", position));
    return !is_shifted && trial.settings().product->dialect.home_offset.travels ? wanted : 0;
  });
}

constexpr auto contract = "CiA 402-2, homing mode, statusword";

constexpr std::array rows{
    Check{"homing.not-by-itself", "CiA 402-2, homing mode, controlword bit 4", "Homing does not start without bit 4",
          Demand::enable, buses::all, not_by_itself},
    Check{"homing.attained", contract, "Homing attained and target reached are set, and the position is zero",
          Demand::enable, buses::all, attained},
    Check{"homing.offset", "CiA 402-2, object 607Ch", "The home offset shifts the zero position", Demand::motion,
          buses::all, offset},
    Check{"homing.not-attained-while-searching", contract, "Homing attained is not set during the search",
          Demand::motion, buses::all, not_attained_while_searching},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::homing_group
