#include "tools/conform/trial.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "axis/cia402_words.hpp"
#include "links/time.hpp"

namespace servodrome::master::conform {

using namespace std::chrono_literals;
using dictionary::AbortCode;

const char* name(Verdict verdict) {
  switch (verdict) {
    case Verdict::pass: return "pass";
    case Verdict::fail: return "FAIL";
    case Verdict::departure: return "departure";
    case Verdict::skipped: return "skipped";
  }
  return "";
}

const char* name(Demand demand) {
  switch (demand) {
    case Demand::nothing: return "nothing";
    case Demand::enable: return "enable";
    case Demand::motion: return "motion";
  }
  return "";
}

std::string text_of_controlword(std::uint16_t word) {
  const char* command = "";
  switch (word & 0x8F) {
    case 0x06: command = " (shutdown)"; break;
    case 0x07: command = " (switch on)"; break;
    case 0x0F: command = " (enable operation)"; break;
    case 0x00: command = " (disable voltage)"; break;
    case 0x02: command = " (quick stop)"; break;
    case 0x80: command = " (fault reset)"; break;
    default: break;
  }
  return fmt::format("6040h = {:04X}h{}", word, command);
}

std::string text_of_state(std::uint16_t statusword) {
  return fmt::format("6041h = {:04X}h, {}", statusword, drive::name(state_of(statusword)));
}

std::string text_of(AbortCode code) {
  const auto number = static_cast<std::uint32_t>(code);
  return fmt::format("{:04X} {:04X}h ({})", number >> 16, number & 0xFFFF, dictionary::text(code));
}

bool Trial::expect(bool met, std::string sent, std::string expected, std::string seen) {
  outcome_.observations.push_back({std::move(sent), std::move(expected), std::move(seen), met});
  if (!met) outcome_.verdict = Verdict::fail;
  return met;
}

void Trial::require(bool met, std::string sent, std::string expected, std::string seen) {
  if (!expect(met, std::move(sent), std::move(expected), std::move(seen))) throw Ended{};
}

void Trial::wait(Time span) {
  constexpr Time between_looks = 10ms;
  const Time end = now() + span;
  for (Time left = span; left > Time{}; left = end - now()) {
    objects().wait(way_ ? std::min(between_looks, left) : left);
    if (way_) require_on_way(position());
  }
}

// ---- Objects ----

Refusal Trial::refusal_in(const ObjectError& error) {
  if (!error.answered()) throw MasterError(error.happened(), error.where(), error.remedy());
  if (const auto* sdo = dynamic_cast<const SdoError*>(&error)) return {sdo->code(), text_of(sdo->code())};
  if (const auto* coe = dynamic_cast<const CoeError*>(&error)) return {coe->code(), text_of(coe->code())};
  return {std::nullopt, error.happened()};
}

void Trial::expect_refused(const std::string& sent, std::initializer_list<AbortCode> codes,
                           const std::function<void()>& access) {
  const auto refusal = refusal_of(access);
  std::string expected = "refused";
  if (subject_.bus_kind() != buses::modbus) {
    const char* before = " with ";
    for (const AbortCode code : codes) {
      expected += before + text_of(code);
      before = " or ";
    }
  }
  const bool right = refusal && (!refusal->code || codes.size() == 0 ||
                                 std::find(codes.begin(), codes.end(), *refusal->code) != codes.end());
  expect(right, sent, expected, text_of(refusal));
}

bool Trial::expect_taken(const std::string& sent, const std::function<void()>& access) {
  const auto refusal = refusal_of(access);
  return expect(!refusal, sent, "taken", text_of(refusal));
}

// ---- Power ----

void Trial::control(std::uint16_t word) {
  if (commands_operation(word) && !operates(state())) {
    Axis402 axis(objects(), {.product = settings().product});
    const auto mode = static_cast<OperationMode>(objects().read_if_present<std::int8_t>(0x6061).value_or(0));
    const bool has_torque_mode =
        mode == OperationMode::profile_torque || mode == OperationMode::cyclic_synchronous_torque;
    // The mode is from before, and with a torque of 0 a hanging load would sink.
    if (!has_chosen_mode_ && has_torque_mode && has_mode(OperationMode::profile_position))
      axis.set_mode(OperationMode::profile_position);
    axis.take_back_targets_before_enabling();
    const bool has_position =
        objects().read_if_present<std::int32_t>(0x6064) || objects().read_if_present<std::int32_t>(0x6063);
    if (has_position && !is_homing_) begin_way(position());
  }
  objects().write<std::uint16_t>(0x6040, 0, word);
}

bool Trial::wait_for(std::uint16_t mask, std::uint16_t value, std::optional<Time> patience) {
  const Time deadline = now() + patience.value_or(settings().patience);
  while ((statusword() & mask) != value) {
    if (now() >= deadline) return false;
    wait(settings().poll_interval);
  }
  return true;
}

bool Trial::wait_for(PowerState wanted, std::optional<Time> patience) {
  const Time deadline = now() + (patience ? *patience : subject_.patience_of_power());
  while (state() != wanted) {
    if (now() >= deadline) return false;
    wait(settings().poll_interval);
  }
  return true;
}

bool Trial::stays(PowerState wanted, Time span) {
  const Time end = now() + span;
  while (now() < end) {
    wait(settings().poll_interval);
    if (state() != wanted) return false;
  }
  return true;
}

void Trial::step(PowerState from, std::uint16_t word, PowerState to) {
  if (state() == to) return;
  control(word);
  const bool arrived = wait_for(to);
  if (!arrived) {
    require(false, fmt::format("{} in {}", text_of_controlword(word), drive::name(from)), drive::name(to),
            text_of_state(statusword()));
  }
}

void Trial::bring_to(PowerState wanted) {
  if (state() == PowerState::fault_reaction_active) wait_for(PowerState::fault);
  if (state() == PowerState::fault) {
    // The cause of the fault may persist until the axis stands still, so the reset is repeated.
    const Time deadline = now() + settings().patience;
    do {
      control(0x0000);
      wait(20ms);
      control(command_word::fault_reset);
    } while (!wait_for(PowerState::switch_on_disabled, 200ms) && now() < deadline);
    if (state() == PowerState::fault) {
      skip(fmt::format("the drive is in fault, 603Fh = {:04X}h, and cannot be reset: remove its cause first",
                       objects().read_if_present<std::uint16_t>(0x603F).value_or(0)));
    }
  }
  if (state() == wanted) return;
  step(state(), 0x0000, PowerState::switch_on_disabled);
  if (wanted == PowerState::switch_on_disabled) return;
  step(PowerState::switch_on_disabled, command_word::shutdown, PowerState::ready_to_switch_on);
  if (wanted == PowerState::ready_to_switch_on) return;
  step(PowerState::ready_to_switch_on, command_word::switch_on, PowerState::switched_on);
  if (wanted == PowerState::switched_on) return;
  step(PowerState::switched_on, command_word::enable_operation, PowerState::operation_enabled);
  if (wanted == PowerState::operation_enabled) return;
  // The drive stays in quick stop active only with 605Ah = 5 to 8.
  write_if_present<std::int16_t>(0x605A, 0, 6);
  step(PowerState::operation_enabled, command_word::quick_stop, PowerState::quick_stop_active);
}

void Trial::enable(OperationMode mode) {
  bring_to(PowerState::switch_on_disabled);
  set_mode(mode);
  bring_to(PowerState::operation_enabled);
}

// ---- Motion ----

bool Trial::has_mode(OperationMode mode) {
  const auto supported = objects().read_if_present<std::uint32_t>(0x6502);
  return !supported || (*supported >> (static_cast<int>(mode) - 1) & 1) != 0;
}

void Trial::set_mode(OperationMode mode) {
  if (!has_mode(mode)) skip(fmt::format("6502h says that it has no {} mode", master::name(mode)));
  const auto number = static_cast<std::int8_t>(mode);
  has_chosen_mode_ = true;
  is_homing_ = mode == OperationMode::homing;
  if (is_homing_) way_.reset();
  if (const auto refusal = refusal_of([&] { objects().write<std::int8_t>(0x6060, 0, number); })) {
    if (!objects().read_if_present<std::uint32_t>(0x6502)) skip(fmt::format("it has no {} mode", master::name(mode)));
    require(false, fmt::format("6060h = {}", number), "taken, since 6502h has the mode", refusal->text);
  }
  const Time deadline = now() + settings().patience;
  while (objects().read_if_present<std::int8_t>(0x6061).value_or(number) != number) {
    if (now() >= deadline) {
      require(false, fmt::format("6060h = {}", number), fmt::format("6061h = {}", number),
              fmt::format("6061h = {}", objects().read<std::int8_t>(0x6061)));
    }
    wait(settings().poll_interval);
  }
}

AxisUnits Trial::units() {
  const auto units = subject_.units();
  if (!units) skip("neither 608Fh, 6091h and 6092h nor --units-per-revolution give the units per revolution");
  return *units;
}

const PositionRange& Trial::range() {
  if (!range_) range_ = subject_.position_range();
  return *range_;
}

void Trial::require_no_wrap(std::int32_t position) {
  const std::int64_t most = distance();
  if (position - most >= range().lowest && position + most <= range().highest) return;
  skip(fmt::format("the position wraps around at {} or {} (607Bh), within the permitted way from {}", range().lowest,
                   range().highest, position));
}

Time Trial::patience_of_way() const { return settings().patience + links::from_seconds(8.0 * settings().revolutions); }

void Trial::begin_way(std::int32_t position) {
  constexpr double tolerance = 0.02;  // revolutions
  const auto units = subject_.units();
  if (!units) return;
  way_ = Way{.begin = position, .distance = units->position * (settings().revolutions + tolerance), .last = position};
}

void Trial::require_on_way(std::int32_t position) {
  if (!way_) return;
  way_->travelled += way(way_->last, position);
  way_->last = position;
  if (std::abs(way_->travelled) <= way_->distance) return;
  const Way left = *std::exchange(way_, std::nullopt);
  require(false, "the commands of this check", fmt::format("6064h within {:.0f} of {}", left.distance, left.begin),
          fmt::format("6064h = {}, {:.0f} away", position, left.travelled));
}

std::int32_t Trial::position() {
  const auto position = objects().read_if_present<std::int32_t>(0x6064);
  return position ? *position : objects().read<std::int32_t>(0x6063);
}

void Trial::gentle_profile(double speed_factor) {
  const AxisUnits unit = units();
  auto speed = static_cast<std::uint32_t>(whole(unit.velocity * std::min(speed_factor, 4.0 * settings().revolutions)));
  const auto greatest = objects().read_if_present<std::uint32_t>(0x607F).value_or(0);
  if (greatest != 0) speed = std::min(speed, greatest);
  const auto acceleration = static_cast<std::uint32_t>(whole(unit.acceleration * 10.0));
  objects().write<std::uint32_t>(0x6081, 0, speed);
  objects().write<std::uint32_t>(0x6083, 0, acceleration);
  write_if_present<std::uint32_t>(0x6084, 0, acceleration);
  write_if_present<std::uint32_t>(0x6085, 0, acceleration);
}

bool Trial::wait_for_rest() {
  const Time deadline = now() + settings().patience;
  std::int32_t last = position();
  unsigned still = 0;
  while (still < 3) {
    if (now() >= deadline) return false;
    wait(20ms);
    const std::int32_t present = position();
    const double tolerance = units().position / 20000.0 + 1.0;
    still = std::abs(way(last, present)) <= tolerance ? still + 1 : 0;
    last = present;
  }
  return true;
}

bool Trial::cause_following_error() {
  if (!objects().read_if_present<std::uint32_t>(0x6065)) return false;
  enable(OperationMode::profile_position);
  gentle_profile(2.0);
  const std::int32_t start = position();
  const auto most = std::int64_t{distance()};
  const std::int64_t ahead = std::min(most, range().highest - start);
  const std::int64_t behind = std::min(most, start - range().lowest);
  const auto target = static_cast<std::int32_t>(start + (ahead >= behind ? ahead : -behind));
  if (refusal_of([&] { objects().write<std::uint32_t>(0x6065, 0, 1); })) return false;
  if (objects().read_if_present<std::uint16_t>(0x6066)) {
    if (refusal_of([&] { objects().write<std::uint16_t>(0x6066, 0, 0); })) return false;
  }
  objects().write<std::int32_t>(0x607A, 0, target);
  control(command_word::enable_operation | new_set_point | change_immediately);
  return wait_for(PowerState::fault, 1s);
}

bool Trial::lose_heartbeat() {
  if (subject_.bus_kind() != buses::can) return false;
  if (!objects().read_if_present<std::uint32_t>(0x1016, 1)) return false;
  subject_.end_watch();  // it uses the same sub-index
  bring_to(PowerState::operation_enabled);
  if (objects().read_if_present<std::int16_t>(0x6007)) {
    if (refusal_of([&] { objects().write<std::int16_t>(0x6007, 0, 1); })) return false;
  }
  if (refusal_of([&] { objects().write<std::uint32_t>(0x1016, 1, heartbeat_producer << 16 | 100); })) return false;
  send_heartbeat();
  has_lost_heartbeat_ = true;
  return wait_for(PowerState::fault, 1s);
}

void Trial::send_heartbeat() { subject_.can().bus.send(0x700 + heartbeat_producer, {0x05}); }

void Trial::end_cause_of_fault() {
  wait_for_rest();  // until then a following error may persist
  wait(200ms);
  if (!std::exchange(has_lost_heartbeat_, false)) return;
  send_heartbeat();
  wait(20ms);
  objects().write<std::uint32_t>(0x1016, 1, 0);
}

bool Trial::cause_fault() { return cause_following_error() || lose_heartbeat(); }

}  // namespace servodrome::master::conform
