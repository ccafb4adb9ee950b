// Profile position mode: set-point handshake, target reached, halt.
#include <cmath>

#include "axis/cia402_words.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::profile_position_group {
namespace {

using namespace std::chrono_literals;

// Enables the axis at rest, with a profile of `speed_factor` revolutions per second.
void prepare(Trial& trial, double speed_factor = 1.0) {
  trial.units();
  trial.enable(OperationMode::profile_position);
  trial.require_no_wrap(trial.position());
  trial.gentle_profile(speed_factor);
  trial.control(command_word::enable_operation);
}

void set_point(Trial& trial, std::int32_t target, std::uint16_t bits = change_immediately) {
  trial.objects().write<std::int32_t>(0x607A, 0, target);
  trial.control(command_word::enable_operation | new_set_point | bits);
}

std::string text_of_set_point(std::int32_t target, std::uint16_t bits) {
  return fmt::format("607Ah = {}, 6040h = {:04X}h", target, command_word::enable_operation | new_set_point | bits);
}

// Without 6067h the position window is specific to the maker; a hundredth of a revolution is used instead.
bool close_to(Trial& trial, std::int32_t position, std::int32_t target) {
  const auto window = trial.objects().read_if_present<std::uint32_t>(0x6067);
  const double revolution = trial.units().position;
  const double tolerance = window && *window < revolution ? *window + revolution / 500.0 : revolution / 100.0;
  return std::abs(static_cast<double>(position) - target) <= tolerance;
}

// Waits until bit 10 is cleared, and then until it is set; it may still be set from the motion before.
bool arrives(Trial& trial) {
  trial.wait_for(status_bit::target_reached, 0, 100ms);
  return trial.wait_for(status_bit::target_reached, status_bit::target_reached, trial.patience_of_way());
}

void acknowledge(Trial& trial, int) {
  prepare(trial);
  const std::uint16_t before = trial.statusword();
  trial.expect((before & set_point_acknowledge) == 0, "operation enabled, bit 4 of 6040h = 0", "bit 12 of 6041h = 0",
               fmt::format("{:04X}h", before));
  const std::int32_t target = trial.position() + trial.distance();
  set_point(trial, target);
  const bool came = trial.wait_for(set_point_acknowledge, set_point_acknowledge, 500ms);
  trial.expect(came, text_of_set_point(target, change_immediately), "bit 12 of 6041h = 1, set-point acknowledged",
               fmt::format("{:04X}h", trial.statusword()));
  trial.control(command_word::enable_operation);
  const bool went = trial.wait_for(set_point_acknowledge, 0, 500ms);
  trial.expect(went, "6040h = 000Fh, bit 4 taken away", "bit 12 of 6041h = 0",
               fmt::format("{:04X}h", trial.statusword()));
}

void moves_to_target(Trial& trial, int) {
  prepare(trial);
  const std::int32_t target = trial.position() + trial.distance();
  set_point(trial, target);
  const bool arrived = arrives(trial);
  const std::int32_t position = trial.position();
  trial.require(arrived, text_of_set_point(target, change_immediately), "bit 10 of 6041h = 1, target reached",
                fmt::format("{:04X}h at position {}", trial.statusword(), position));
  trial.expect(close_to(trial, position, target), text_of_set_point(target, change_immediately),
               fmt::format("6064h = {} when bit 10 comes", target), fmt::format("{}", position));
  trial.control(command_word::enable_operation);
  trial.wait_for_rest();
  trial.expect(close_to(trial, trial.position(), target), "afterwards", fmt::format("6064h = {}", target),
               fmt::format("{}", trial.position()));
  set_point(trial, target - trial.distance());
  trial.expect(arrives(trial), text_of_set_point(target - trial.distance(), change_immediately),
               "and back: bit 10 of 6041h = 1", fmt::format("{:04X}h", trial.statusword()));
}

// Only a rising edge of bit 4 starts a new set-point.
void edge_only(Trial& trial, int) {
  prepare(trial);
  const std::int32_t start = trial.position();
  set_point(trial, start + trial.distance());
  trial.require(arrives(trial), text_of_set_point(start + trial.distance(), change_immediately), "bit 10 of 6041h = 1",
                fmt::format("{:04X}h", trial.statusword()));
  trial.wait_for_rest();
  const std::int32_t before = trial.position();
  trial.objects().write<std::int32_t>(0x607A, 0, start);
  trial.wait(300ms);
  const std::int32_t after = trial.position();
  trial.expect(close_to(trial, after, before), fmt::format("607Ah = {} while bit 4 stays 1", start),
               fmt::format("6064h = {}, no motion", before), fmt::format("{}", after));
  trial.control(command_word::enable_operation);
  set_point(trial, start);
  trial.expect(arrives(trial), "bit 4 0, then 1", "the motion begins and ends: bit 10 of 6041h = 1",
               fmt::format("{:04X}h", trial.statusword()));
}

void relative_motion(Trial& trial, int) {
  prepare(trial);
  const std::int32_t start = trial.position();
  set_point(trial, start + trial.distance());
  trial.require(arrives(trial), text_of_set_point(start + trial.distance(), change_immediately), "bit 10 of 6041h = 1",
                fmt::format("{:04X}h", trial.statusword()));
  trial.control(command_word::enable_operation);
  trial.wait_for_rest();
  set_point(trial, -trial.distance(), change_immediately | relative_move);
  const bool arrived = arrives(trial);
  trial.wait_for_rest();
  const std::int32_t position = trial.position();
  trial.expect(arrived && close_to(trial, position, start),
               text_of_set_point(-trial.distance(), change_immediately | relative_move),
               fmt::format("6064h = {}, the target counts from the last one", start), fmt::format("{}", position));
}

// Bit 5 = 0: the second set-point waits until the first is reached.
void queue(Trial& trial, int) {
  prepare(trial, 1.0);
  const std::int32_t start = trial.position();
  const std::int32_t first = start + trial.distance();
  set_point(trial, first, 0);
  trial.wait_for(set_point_acknowledge, set_point_acknowledge, 500ms);
  trial.control(command_word::enable_operation);
  trial.require(trial.wait_for(set_point_acknowledge, 0, 500ms), text_of_set_point(first, 0) + ", then bit 4 = 0",
                "bit 12 of 6041h = 0, there is room for another", fmt::format("{:04X}h", trial.statusword()));
  set_point(trial, start, 0);
  trial.wait_for(set_point_acknowledge, set_point_acknowledge, 500ms);
  trial.control(command_word::enable_operation);
  std::int32_t furthest = start;
  const Time end = trial.now() + trial.patience_of_way();
  while (trial.now() < end) {
    const std::int32_t position = trial.position();
    furthest = std::max(furthest, position);
    if (close_to(trial, furthest, first) && close_to(trial, position, start)) break;
    trial.wait(trial.settings().poll_interval);
  }
  trial.expect(close_to(trial, furthest, first), text_of_set_point(first, 0) + fmt::format(", then 607Ah = {}", start),
               fmt::format("the first target {} is reached before", first), fmt::format("{} at most", furthest));
  trial.expect(close_to(trial, trial.position(), start), "afterwards", fmt::format("6064h = {}", start),
               fmt::format("{}", trial.position()));
}

// Bit 5 = 1: the second set-point replaces the first at once.
void change_at_once(Trial& trial, int) {
  prepare(trial, 0.5);
  const std::int32_t start = trial.position();
  const std::int32_t first = start + trial.distance();
  set_point(trial, first);
  trial.wait_for(set_point_acknowledge, set_point_acknowledge, 500ms);
  trial.control(command_word::enable_operation);
  trial.wait_for(set_point_acknowledge, 0, 500ms);
  const Time deadline = trial.now() + trial.patience_of_way();
  while (trial.position() < start + trial.distance() / 4 && trial.now() < deadline) trial.wait(2ms);
  set_point(trial, start);
  std::int32_t furthest = start;
  const Time end = trial.now() + trial.patience_of_way();
  do {
    trial.wait(trial.settings().poll_interval);
    furthest = std::max(furthest, trial.position());
  } while (!close_to(trial, trial.position(), start) && trial.now() < end);
  const std::int32_t position = trial.position();
  trial.expect(!close_to(trial, furthest, first) && close_to(trial, position, start),
               text_of_set_point(start, change_immediately) + " on the way to another target",
               fmt::format("it turns round before {} and goes to {}", first, start),
               fmt::format("{} at most, then {}", furthest, position));
}

void not_reached_under_way(Trial& trial, int) {
  prepare(trial, 0.5);
  const std::int32_t start = trial.position();
  const std::int32_t target = start + trial.distance();
  set_point(trial, target);
  const Time deadline = trial.now() + trial.patience_of_way();
  while (trial.position() < start + trial.distance() / 2 && trial.now() < deadline) trial.wait(2ms);
  const std::uint16_t word = trial.statusword();
  const std::int32_t position = trial.position();
  trial.expect((word & status_bit::target_reached) == 0,
               fmt::format("{}, halfway at {}", text_of_set_point(target, change_immediately), position),
               "bit 10 of 6041h = 0", fmt::format("{:04X}h", word));
  arrives(trial);
  trial.control(command_word::enable_operation);
  set_point(trial, start);
  arrives(trial);
}

void halts(Trial& trial, int) {
  prepare(trial, 0.5);
  const std::int32_t start = trial.position();
  const std::int32_t target = start + trial.distance();
  set_point(trial, target);
  const Time deadline = trial.now() + trial.patience_of_way();
  while (trial.position() < start + trial.distance() / 4 && trial.now() < deadline) trial.wait(2ms);
  trial.control(command_word::enable_operation | new_set_point | change_immediately | control_bit::halt);
  const bool reached = trial.wait_for(status_bit::target_reached, status_bit::target_reached);
  trial.wait_for_rest();
  const std::int32_t position = trial.position();
  const std::uint16_t word = trial.statusword();
  trial.expect(!close_to(trial, position, target), "6040h bit 8 = 1 under way", "it stands before the target",
               fmt::format("{} of {}", position, target));
  trial.expect(state_of(word) == PowerState::operation_enabled, "halted", "operation enabled, as before",
               text_of_state(word));
  trial.expect(reached, "halted", "bit 10 of 6041h = 1: with halt it says that the velocity is 0",
               fmt::format("{:04X}h", word));
}

constexpr auto handover = "CiA 402-2, profile position mode, set-points";
constexpr auto bits = "CiA 402-2, profile position mode, statusword";

constexpr std::array rows{
    Check{"pp.acknowledge", handover, "A set-point is acknowledged, and the acknowledgement is cleared with bit 4",
          Demand::motion, buses::all, acknowledge},
    Check{"pp.target-reached", bits, "Target reached is set at the target", Demand::motion, buses::all,
          moves_to_target},
    Check{"pp.not-reached-under-way", bits, "Target reached is not set during the motion", Demand::motion, buses::all,
          not_reached_under_way},
    Check{"pp.edge", handover, "Only the edge of bit 4 starts a motion", Demand::motion, buses::all, edge_only},
    Check{"pp.relative", "CiA 402-2, profile position mode, controlword bit 6",
          "A relative target counts from the last", Demand::motion, buses::all, relative_motion},
    Check{"pp.queue", handover, "Bit 5 = 0: a second set-point waits for the first", Demand::motion, buses::all, queue},
    Check{"pp.change-at-once", handover, "Bit 5 = 1: a second set-point replaces the first", Demand::motion, buses::all,
          change_at_once},
    Check{"pp.halt", "CiA 402-2, controlword bit 8, object 605Dh", "Halt stops the axis, and bit 10 reports it",
          Demand::motion, buses::all, halts},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::profile_position_group
