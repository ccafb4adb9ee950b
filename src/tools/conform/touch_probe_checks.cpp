// Touch probes: 60B8h to 60BDh. The event is the encoder's index, which needs no wiring.
#include <algorithm>
#include <cmath>

#include "axis/cia402_words.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::touch_probe_group {
namespace {

using namespace std::chrono_literals;

// Bits of 60B8h for probe 1; those of probe 2 are 8 positions higher.
constexpr std::uint16_t on = 0x0001;
constexpr std::uint16_t by_index = 0x0004;
constexpr std::uint16_t rising = 0x0010;
constexpr std::uint16_t armed = on | by_index | rising;
// Bits of 60B9h.
constexpr std::uint16_t is_on = 0x0001;
constexpr std::uint16_t has_rising = 0x0002;
constexpr std::uint16_t all_of_probe = 0x0007;
constexpr std::uint16_t position_of_probe_1 = 0x60BA;

std::uint16_t status(Trial& trial) { return trial.objects().read<std::uint16_t>(0x60B9); }
std::string text_of_status(std::uint16_t word) { return fmt::format("60B9h = {:04X}h", word); }
std::string text_of_function(std::uint16_t word) { return fmt::format("60B8h = {:04X}h", word); }

void set_function(Trial& trial, std::uint16_t function) {
  const auto refusal = Trial::refusal_of([&] { trial.objects().write<std::uint16_t>(0x60B8, 0, function); });
  if (refusal) Trial::skip(fmt::format("it does not take {}: {}", text_of_function(function), refusal->text));
}

bool status_becomes(Trial& trial, unsigned mask, unsigned value) {
  const Time deadline = trial.now() + 200ms;
  while ((status(trial) & mask) != value) {
    if (trial.now() >= deadline) return false;
    trial.wait(trial.settings().poll_interval);
  }
  return true;
}

void need_probe(Trial& trial, int row) {
  if (!trial.objects().read_if_present<std::uint16_t>(0x60B8)) Trial::skip("it has no touch probe, 60B8h");
  if (row == 1 && !trial.objects().read_if_present<std::int32_t>(0x60BC)) Trial::skip("it has no second touch probe");
}

void switches_on(Trial& trial, int row) {
  need_probe(trial, row);
  const unsigned shift = row == 0 ? 0 : 8;
  const auto function = static_cast<std::uint16_t>(armed << shift);
  set_function(trial, 0);
  trial.expect(status_becomes(trial, 0x0707, 0), text_of_function(0), "bits 0 to 2 and 8 to 10 of 60B9h = 0",
               text_of_status(status(trial)));
  set_function(trial, function);
  const bool came = status_becomes(trial, 0x0707U, static_cast<unsigned>(is_on << shift));
  trial.expect(came, text_of_function(function), fmt::format("of these only bit {} of 60B9h = 1", shift),
               text_of_status(status(trial)));
  set_function(trial, 0);
  trial.expect(status_becomes(trial, 0x0707, 0), text_of_function(0), "bits 0 to 2 and 8 to 10 of 60B9h = 0",
               text_of_status(status(trial)));
}

void prepare(Trial& trial) {
  need_probe(trial, 0);
  trial.units();
  trial.enable(OperationMode::profile_position);
  trial.require_no_wrap(trial.position());
  trial.gentle_profile(0.5);
  trial.control(command_word::enable_operation);
}

// Moves to `target` and calls `look` at each poll.
void move(Trial& trial, std::int32_t target, const std::function<void()>& look) {
  trial.objects().write<std::int32_t>(0x607A, 0, target);
  trial.control(command_word::enable_operation | new_set_point | change_immediately);
  const Time end = trial.now() + trial.patience_of_way();
  const double close = trial.units().position / 100.0;
  do {
    look();
    trial.wait(trial.settings().poll_interval);
  } while (std::abs(static_cast<double>(trial.position()) - target) > close && trial.now() < end);
  trial.wait_for_rest();
  look();
  trial.control(command_word::enable_operation);
}

// Moves back and forth around the present position by the distance that the user permits. With at least half a
// revolution either way the motion passes the index.
void sweep(Trial& trial, std::int32_t start, const std::function<void()>& look) {
  for (const std::int32_t target : {start + trial.distance(), start - trial.distance(), start})
    move(trial, target, look);
}

void latches(Trial& trial, int) {
  if (trial.settings().revolutions < 0.5) Trial::skip("the index may lie beyond --revolutions: give 0.5 or more");
  prepare(trial);
  const std::int32_t start = trial.position();
  set_function(trial, 0);
  set_function(trial, armed);
  std::optional<std::int32_t> latched;
  std::int32_t before = start;
  std::int32_t after = start;
  bool lost = false;
  std::int32_t last = 0;
  sweep(trial, start, [&] {
    const std::uint16_t word = status(trial);
    const std::int32_t position = trial.position();
    if (latched) {
      lost = lost || (word & has_rising) == 0;
      last = trial.objects().read<std::int32_t>(position_of_probe_1);
      return;
    }
    before = after;
    after = position;
    if ((word & has_rising) != 0) last = *(latched = trial.objects().read<std::int32_t>(position_of_probe_1));
  });
  const std::string sent = text_of_function(armed) + ", and a revolution in all";
  trial.require(latched.has_value(), sent, "bit 1 of 60B9h = 1, the index was met", text_of_status(status(trial)));
  const double window = trial.units().position / 50.0;
  trial.expect(
      *latched >= std::min(before, after) - window && *latched <= std::max(before, after) + window, sent,
      fmt::format("60BAh between {} and {}, where the axis was then", std::min(before, after), std::max(before, after)),
      fmt::format("60BAh = {}", *latched));
  trial.expect(!lost && last == *latched, "the index is met again, bit 1 of 60B8h = 0: the first event only",
               fmt::format("bit 1 of 60B9h stays 1, 60BAh = {}", *latched),
               fmt::format("{}, 60BAh = {}", text_of_status(status(trial)), last));
  set_function(trial, 0);
  trial.expect(status_becomes(trial, all_of_probe, 0), text_of_function(0), "bits 0 to 2 of 60B9h = 0",
               text_of_status(status(trial)));
  set_function(trial, armed);
  trial.expect(status_becomes(trial, all_of_probe, is_on), text_of_function(armed) + " again",
               "bit 0 of 60B9h = 1 and bit 1 = 0, it waits for the next event", text_of_status(status(trial)));
}

void off_is_off(Trial& trial, int) {
  prepare(trial);
  set_function(trial, 0);
  std::uint16_t seen = 0;
  sweep(trial, trial.position(), [&] { seen = static_cast<std::uint16_t>(seen | status(trial)); });
  trial.expect((seen & 0x0707) == 0, text_of_function(0) + ", and the axis moves",
               "bits 0 to 2 and 8 to 10 of 60B9h stay 0", text_of_status(seen));
}

constexpr auto clause = "CiA 402-2, touch probe, objects 60B8h, 60B9h";

constexpr std::array rows{
    Check{"probe.first", clause, "Probe 1 reports that it is on, and clears its status when it is off", Demand::nothing,
          buses::all, switches_on, 0},
    Check{"probe.second", clause, "Probe 2 reports that it is on, and clears its status when it is off",
          Demand::nothing, buses::all, switches_on, 1},
    Check{"probe.latch", "CiA 402-2, touch probe, objects 60B8h to 60BAh",
          "Only the first index is latched, at its position", Demand::motion, buses::all, latches},
    Check{"probe.off", clause, "A probe that is off captures nothing", Demand::motion, buses::all, off_is_off},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::touch_probe_group
