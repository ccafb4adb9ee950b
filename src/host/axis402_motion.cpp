#include <fmt/format.h>

#include "host/axis402.hpp"

namespace servodrome::host {
namespace {

namespace controlword = drive::controlword;
namespace statusword_bit = drive::statusword;

constexpr std::uint16_t enabled = 0x000F;
constexpr std::uint16_t new_set_point = controlword::mode_bit_4;
constexpr std::uint16_t change_immediately = controlword::mode_bit_5;
constexpr std::uint16_t relative_move = controlword::mode_bit_6;
constexpr std::uint16_t set_point_acknowledge = statusword_bit::mode_bit_12;

// A drive takes back "target reached" some cycles after it took an order over; until then it may be the last order's.
constexpr Time settling = std::chrono::milliseconds(20);

}  // namespace

void Axis402::require_enabled(const char* doing) {
  if (state() != PowerState::operation_enabled) {
    fail(fmt::format("the drive is not enabled and cannot {}", doing), "enable it first");
  }
  // Another master may have left a halt behind, which holds back a move that is not to go on.
  if (controlword_ == 0) controlword_ = objects_.read<std::uint16_t>(0x6040);
}

void Axis402::write_profile(const MotionProfile& profile) {
  write_if_given(0x6081, 0, profile.velocity);
  write_if_given(0x6083, 0, profile.acceleration);
  write_if_given(0x6084, 0, profile.deceleration);
}

void Axis402::follow(Time timeout, const Progress& progress, const std::string& doing,
                     const std::function<bool(std::uint16_t)>& done) {
  const Time start = objects_.now();
  for (;;) {
    const bool settled = objects_.now() - start >= settling;
    std::uint16_t word = 0;
    if (progress) {
      const AxisStatus present = status();
      progress(present);
      word = present.statusword;
    } else {
      word = statusword();
    }
    if (state_of(word) != PowerState::operation_enabled) {
      fail(fmt::format("the drive left operation enabled while {}", doing),
           "look at the error code; then reset the fault (`--reset-fault`) and enable again");
    }
    if (settled && done(word)) return;
    if (objects_.now() - start >= timeout) {
      const std::int32_t at = position();
      stop();
      fail(fmt::format("{} took longer than {:g} s and was stopped; position was {}", doing,
                       std::chrono::duration<double>(timeout).count(), at),
           "check speeds, limits and load, or give a longer --timeout");
    }
    objects_.wait(options_.poll_interval);
  }
}

void Axis402::home(const HomingRequest& request, Time timeout, const Progress& progress) {
  require_enabled("home");
  write_controlword(enabled);  // no order left from before
  set_mode(OperationMode::homing);
  write_if_given(0x6098, 0, request.method);
  write_if_given(0x6099, 1, request.switch_speed);
  write_if_given(0x6099, 2, request.zero_speed);
  write_if_given(0x609A, 0, request.acceleration);
  write_if_given(0x607C, 0, request.offset);
  write_controlword(enabled | controlword::mode_bit_4);
  const HomingSignals& signals = options_.dialect.homing_signals;
  const std::string doing = fmt::format("homing by method {}", objects_.read<std::int8_t>(0x6098));
  follow(timeout, progress, doing, [&](std::uint16_t word) {
    if ((word & signals.error) != 0) {
      write_controlword(enabled);
      fail(doing + " ended with an error",
           "check that the switches of the method are there and wired, and that homing speeds and acceleration are not "
           "0");
    }
    const std::uint16_t done =
        static_cast<std::uint16_t>(signals.attained | (signals.target_reached ? statusword_bit::target_reached : 0U));
    return (word & done) == done;
  });
  write_controlword(enabled);
}

void Axis402::move(std::int32_t target, bool relative, const MotionProfile& profile, Time timeout,
                   const Progress& progress) {
  require_enabled("move");
  set_mode(OperationMode::profile_position);
  write_profile(profile);
  // A halted move would go on as soon as halt is released: replace it in the same write.
  const std::uint16_t halt = controlword_ & controlword::halt;
  const std::uint16_t order =
      static_cast<std::uint16_t>(enabled | (relative ? relative_move : 0U) | (halt != 0 ? change_immediately : 0U));
  write_controlword(order | halt);
  if (!wait_for_bits(set_point_acknowledge, 0, options_.state_timeout)) {
    fail("the drive has no room for a set-point (statusword bit 12 stays set)", "stop the motion under way first");
  }
  objects_.write<std::int32_t>(0x607A, 0, target);
  write_controlword(order | new_set_point);
  // Some drives take the acknowledgement back by themselves: that they took target reached back proves as much.
  const Time deadline = objects_.now() + options_.state_timeout;
  for (;;) {
    const std::uint16_t word = statusword();
    if ((word & set_point_acknowledge) != 0 || (word & statusword_bit::target_reached) == 0) break;
    if (objects_.now() >= deadline) {
      write_controlword(order);
      fail(fmt::format("the drive did not take over target position {}", target),
           "check that target, profile velocity and accelerations are within the drive's limits and not 0");
    }
  }
  write_controlword(order);
  const std::string doing = relative ? fmt::format("moving by {}", target) : fmt::format("moving to {}", target);
  follow(timeout, progress, doing, [](std::uint16_t word) { return (word & statusword_bit::target_reached) != 0; });
}

void Axis402::move_to(std::int32_t position, const MotionProfile& profile, Time timeout, const Progress& progress) {
  move(position, false, profile, timeout, progress);
}

void Axis402::move_by(std::int32_t distance, const MotionProfile& profile, Time timeout, const Progress& progress) {
  require_enabled("move");
  if ((controlword_ & controlword::halt) == 0) return move(distance, true, profile, timeout, progress);
  // To the drive, relative would be relative to the target that was given up.
  const std::int64_t target = std::int64_t{position()} + distance;
  if (target != static_cast<std::int32_t>(target)) {
    fail(fmt::format("{} is no position", target), "move by less, or home the axis");
  }
  move(static_cast<std::int32_t>(target), false, profile, timeout, progress);
}

void Axis402::run_at(std::int32_t velocity, const MotionProfile& profile, Time timeout, const Progress& progress) {
  require_enabled("run");
  set_mode(OperationMode::profile_velocity);
  write_profile(profile);
  objects_.write<std::int32_t>(0x60FF, 0, velocity);
  write_controlword(enabled);
  follow(timeout, progress, fmt::format("running up to velocity {}", velocity),
         [](std::uint16_t word) { return (word & statusword_bit::target_reached) != 0; });
}

void Axis402::stop() {
  if (state() != PowerState::operation_enabled) return;
  const auto mode = static_cast<OperationMode>(this->mode());
  const std::uint16_t halted = enabled | controlword::halt;
  write_controlword(halted);
  // With halt, target reached means standstill (CiA 402-2 table 29).
  objects_.wait(settling);
  if (!wait_for_bits(statusword_bit::target_reached, statusword_bit::target_reached, options_.state_timeout)) {
    fail("the axis does not come to rest on halt", "use quick stop, and check halt option code and decelerations");
  }
  if (mode == OperationMode::profile_velocity) {
    objects_.write<std::int32_t>(0x60FF, 0, 0);
    write_controlword(enabled);
  } else if (mode == OperationMode::homing) {
    write_controlword(enabled);  // bit 4 is 0: broken off
  }
}

}  // namespace servodrome::host
