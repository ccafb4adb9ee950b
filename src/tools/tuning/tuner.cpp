#include "tools/tuning/tuner.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "axis/cia402_words.hpp"
#include "catalogue/product.hpp"
#include "links/time.hpp"

namespace servodrome::master::tuning {
namespace {

constexpr unsigned excitation_lines = 80;
constexpr double excitation_share = 0.8;  // relative to the bias velocity; below 1, so that the axis does not reverse
                                          // and the friction is constant
constexpr double settling_share = 0.3;    // relative to the torque limit; maximum torque due to the excitation
constexpr unsigned over_torque_cycles = 20;
constexpr unsigned tolerated_losses = 20;
constexpr double ramp_s = 0.3;
constexpr double good_coherence = 0.9;
constexpr std::size_t fewest_frequencies = 12;  // minimum of frequencies with a good coherence
constexpr double travel_slack = 0.25;           // revolutions
constexpr double look_s = 0.5;                  // period of the check whether the axis follows
constexpr double least_look = 0.005;            // revolutions; a shorter command is not checked
constexpr unsigned step_repeats = 8;
const Time slice = std::chrono::milliseconds(20);

ProcessObject mapped(std::optional<ProcessObject> object, ObjectAddress address, const std::string& where,
                     const char* pdo) {
  if (object) return *object;
  throw MasterError(
      fmt::format("{} is not in its process data, but is needed to measure the velocity loop", text_of(address)), where,
      fmt::format("map it into {}", pdo));
}

std::int32_t whole_number(double value) {
  return static_cast<std::int32_t>(std::lround(std::clamp(value, -2147483647.0, 2147483647.0)));
}

}  // namespace

CanDrive tuning_drive(const ObjectClient& objects, const catalogue::TuningDialect& dialect) {
  return {.node_id = static_cast<std::uint8_t>(objects.address()),
          .rpdos = {{{{0x6040, 0}, 16}, {{0x6060, 0}, 8}, {{0x60FF, 0}, 32}}},
          .tpdos = {{{{0x6041, 0}, 16}, {dialect.position, 32}, {dialect.torque, 16}}},
          .sets_interpolation_time = false};
}

Tuner::Tuner(CyclicBus& bus, ObjectClient& objects, const catalogue::Product& product, const TuningUnits& units,
             const TunerOptions& options)
    : bus_(bus),
      objects_(objects),
      product_(product),
      units_(units),
      options_(options),
      sample_s_(links::to_seconds(bus.period())),
      axis_(bus.image(options.drive)),
      target_velocity_(mapped(bus.image(options.drive).output({0x60FF, 0}), {0x60FF, 0}, axis_.where(), "an RxPDO")),
      position_(mapped(bus.image(options.drive).input(dialect_.position), dialect_.position, axis_.where(), "a TxPDO")),
      torque_(mapped(bus.image(options.drive).input(dialect_.torque), dialect_.torque, axis_.where(), "a TxPDO")) {
  mapped(bus.image(options.drive).output({0x6060, 0}), {0x6060, 0}, axis_.where(), "an RxPDO");
}

Tuner::~Tuner() { bus_.on_cycle({}); }

void Tuner::fail(const std::string& happened, const std::string& remedy) const {
  throw MasterError(happened, axis_.where(), remedy + text_of_losses(lost_cycles() - lost_before_));
}

std::string text_of_losses(std::uint64_t cycles) {
  if (cycles == 0) return {};
  return fmt::format("; {} cycles were lost: choose a longer --cycle, or a computer with less load", cycles);
}

// Evaluates the inputs and computes the next command. A problem brakes the axis at once by a quick stop of the drive.
void Tuner::cycle() {
  const auto stop_because = [this](std::string happened, std::string remedy) {
    if (problem_.empty()) {
      problem_ = std::move(happened);
      remedy_ = std::move(remedy);
    }
  };
  if (!bus_.is_fresh(options_.drive)) {
    if (controls_ && ++losses_ > tolerated_losses) {
      stop_because("it no longer sends its process data", "check its power and the cable");
    }
  } else {
    losses_ = 0;
    const auto position = position_.get<std::int32_t>();
    const auto moved =
        static_cast<std::int32_t>(static_cast<std::uint32_t>(position) - static_cast<std::uint32_t>(last_position_));
    const double step = has_position_ ? moved / units_.counts_per_rad : 0.0;
    last_position_ = position;
    has_position_ = true;
    velocity_ = step / sample_s_;
    travelled_ += step;
    const auto torque = static_cast<double>(torque_.get<std::int16_t>());
    torque_now_ = torque * units_.torque_unit;
    if (controls_) {
      if (axis_.state() != PowerState::operation_enabled) {
        stop_because(fmt::format("the drive left operation enabled, {}", shown_statusword()),
                     "see `servodrome faults`");
      }
      over_torque_ = std::abs(torque) > options_.torque_limit * dialect_.full_torque ? over_torque_ + 1 : 0;
      if (over_torque_ > over_torque_cycles) {
        stop_because(fmt::format("more than {:.0f} % of {} for {} cycles", 100.0 * options_.torque_limit,
                                 dialect_.full_torque_text, over_torque_cycles),
                     "the axis is blocked or oscillates: check it, or raise the torque limit with --torque");
      }
      asked_ += command_ * sample_s_;
      moved_ += step;
      if (++looked_cycles_ * sample_s_ >= look_s) {
        if (std::abs(asked_) > least_look * turn && std::abs(moved_) < 0.1 * std::abs(asked_)) {
          stop_because("the axis stands although it has a velocity command", "check what blocks it");
        }
        asked_ = moved_ = 0.0;
        looked_cycles_ = 0;
      }
      const double slack = travel_slack * turn;
      if (travelled_ < -slack || travelled_ > options_.travel_revolutions * turn + slack) {
        stop_because(fmt::format("the axis is {:.2f} revolutions from its start", travelled_ / turn),
                     fmt::format("the limits are {:g} forward and {:g} back; allow more with --travel",
                                 options_.travel_revolutions, travel_slack));
      }
    }
  }
  if (!controls_) return;
  if (!problem_.empty()) {
    axis_.set_controlword(command_word::quick_stop);
    target_velocity_.set(0);
    return;
  }
  const double wanted = command_of_cycle_ ? command_of_cycle_() : 0.0;
  const std::int32_t number = whole_number(wanted * units_.velocity_per_rad_s);
  target_velocity_.set(number);
  command_ = number / units_.velocity_per_rad_s;
}

// If a limit switch is active, it is the cause of the problem that the cycle noticed, so it replaces that problem.
void Tuner::explain_by_limit_switch() {
  constexpr std::uint32_t negative_limit = 1U << 0;
  constexpr std::uint32_t positive_limit = 1U << 1;
  try {
    const std::uint32_t inputs = objects_.read_if_present<std::uint32_t>(0x60FD).value_or(0);
    if ((inputs & (negative_limit | positive_limit)) == 0) return;
    problem_ = fmt::format("the {} limit switch is active (60FDh), {:.2f} revolutions from the start",
                           (inputs & positive_limit) != 0 ? "positive" : "negative", travelled_ / turn);
    remedy_ = "start farther away from it, or permit less travel with --travel";
  } catch (const MasterError&) {
    // The first problem is reported.
  }
}

std::string Tuner::shown_statusword() const {
  return text_of_statusword(axis_.statusword(), product_.name, dialect_.velocity_mode);
}

std::uint64_t Tuner::lost_cycles() const {
  const CycleCounters counters = bus_.counters();
  return counters.missed + counters.skipped;
}

void Tuner::wait(double seconds) {
  const Time end = bus_.now() + links::from_seconds(seconds);
  while (bus_.now() < end) {
    bus_.wait(std::min(slice, end - bus_.now()));
    if (!problem_.empty()) {
      bus_.wait(std::chrono::milliseconds(30));  // waits for an EMCY that may follow
      const auto emergency = objects_.latest_emergency();
      const bool tells = emergency && emergency->code != 0;
      explain_by_limit_switch();
      fail(tells ? fmt::format("{}, latest EMCY {:04X}h {}", problem_, emergency->code,
                               text_of_error_code(emergency->code))
                 : problem_,
           remedy_);
    }
    bus_.check();
    leave_if_cancelled();
  }
}

void Tuner::leave_if_cancelled() const {
  if (options_.cancelled && options_.cancelled()) {
    throw Cancelled("interrupted", axis_.where(), "the axis was stopped");
  }
}

template <typename Done>
void Tuner::wait_until(const Done& done, double timeout_s, const std::string& what) {
  for (double waited = 0.0; !done(); waited += sample_s_) {
    if (waited > timeout_s) {
      fail(fmt::format("{} took longer than {:g} s; {}", what, timeout_s, shown_statusword()),
           "see `servodrome faults`");
    }
    wait(sample_s_);
  }
}

void Tuner::enable() {
  problem_.clear();
  losses_ = over_torque_ = 0;
  lost_before_ = lost_cycles();
  command_of_cycle_ = {};
  bus_.on_cycle([this] { cycle(); });
  wait(5 * sample_s_);  // waits for the first statusword
  if (axis_.state() == PowerState::fault) fail("the drive has a fault", "reset it first (--reset-fault)");
  target_velocity_.set(0);
  axis_.set_mode(static_cast<OperationMode>(dialect_.velocity_mode));
  wait_until([this] { return axis_.enable(); }, 5.0, "enabling");
  wait(0.1);
  travelled_ = asked_ = moved_ = 0.0;
  looked_cycles_ = 0;
  controls_ = true;
}

void Tuner::disable() noexcept {
  // From here on the cancellation callback is still called, for its side effects, but its result is ignored.
  const auto cancelled = options_.cancelled;
  const auto ask = [&cancelled] {
    if (cancelled) cancelled();
    return false;
  };
  options_.cancelled = ask;
  try {
    if (controls_ && problem_.empty()) {
      const double from = command_;
      double share = 1.0;
      command_of_cycle_ = [&share, from, this] {
        share = std::max(0.0, share - sample_s_ / ramp_s);
        return from * share;
      };
      wait(ramp_s + 0.1);
    } else {
      const Time end = bus_.now() + std::chrono::milliseconds(300);  // duration of the quick stop
      while (bus_.now() < end) {
        bus_.wait(slice);
        ask();
      }
    }
  } catch (...) {
    // Ignored, because the power is switched off below in any case. The caller's wait may throw anything.
  }
  controls_ = false;
  command_of_cycle_ = {};
  try {
    for (int i = 0; i < 500 && !axis_.disable(); ++i) {
      bus_.wait(bus_.period());
      if (i % 20 == 0) ask();
    }
  } catch (...) {
    // The link is lost: the drive's own supervision stops the axis. Or the caller ends the work, and stops the axis.
  }
  options_.cancelled = cancelled;
  bus_.on_cycle({});
}

void Tuner::move_at(double velocity_rad_s) {
  const double from = command_;
  double share = 0.0;
  command_of_cycle_ = [&share, from, velocity_rad_s, this] {
    share = std::min(1.0, share + sample_s_ / ramp_s);
    return from + (velocity_rad_s - from) * share;
  };
  try {
    wait(ramp_s + 0.2);
  } catch (...) {
    command_of_cycle_ = {};
    throw;
  }
  command_of_cycle_ = [velocity_rad_s] { return velocity_rad_s; };
}

// Records the response to the excitation, added to a bias velocity: one period to settle, then `periods`. A sample
// contains the values of one cycle: the command in force and the inputs that arrived.
Tuner::Record Tuner::record(const Multisine& excitation, unsigned periods, double bias_rad_s) {
  const unsigned period = excitation.period_samples();
  double amplitude = excitation_share * std::abs(bias_rad_s);
  for (int attempt = 0;; ++attempt) {
    Record record;
    std::uint64_t n = 0;
    double mean = torque_now_;
    double peak = 0.0;
    const std::uint64_t lost_before = lost_cycles();
    command_of_cycle_ = [&] {
      if (n >= period) {
        record.command.push_back(command_);  // sent one cycle earlier; the shift is the same for all samples
        record.differences.push_back(velocity_ * sample_s_);
        record.torque.push_back(torque_now_);
      }
      mean += 0.01 * (torque_now_ - mean);
      if (n < period) peak = std::max(peak, std::abs(torque_now_ - mean));
      const double fade = n < period / 4 ? static_cast<double>(n) / (period / 4.0) : 1.0;
      const double value = bias_rad_s + fade * amplitude * excitation.value(n);
      ++n;
      return value;
    };
    struct Quiet {
      std::function<double()>& command;
      double bias;
      ~Quiet() {
        command = [bias = bias] { return bias; };
      }
    } quiet{command_of_cycle_, bias_rad_s};
    const double seconds = sample_s_ * period;
    wait(seconds);
    const double allowed = settling_share * options_.torque_limit * dialect_.full_torque * units_.torque_unit;
    if (peak > allowed && attempt < 3) {
      amplitude *= 0.8 * allowed / peak;
      continue;
    }
    for (unsigned i = 0; i < periods; ++i) {
      if (options_.progress) options_.progress("measuring", static_cast<double>(i) / periods);
      wait(seconds);
    }
    const std::uint64_t bad = lost_cycles() - lost_before;
    if (bad * 100 > n) {
      fail("too many cycles were lost for a valid measurement", fmt::format("at most 1 % of {} may be lost", n));
    }
    const std::size_t whole = record.command.size() / period * period;
    record.command.resize(whole);
    record.differences.resize(whole);
    record.torque.resize(whole);
    return record;
  }
}

Measurement Tuner::measure(double bandwidth_hz, const std::optional<NotchSetting>& notch) {
  // Disables even if enable() fails, because the drive may be enabled already.
  struct Disabling {
    Tuner& tuner;
    ~Disabling() { tuner.disable(); }
  } disabling{*this};
  enable();

  const double period_s = 1.0 / std::clamp(bandwidth_hz / 30.0, 0.5, 2.0);
  const auto period = static_cast<unsigned>(std::lround(period_s / sample_s_));
  const Multisine excitation(sample_s_, period, std::min(options_.lowest_hz, bandwidth_hz / 10.0), 0.5 / sample_s_,
                             excitation_lines);
  const auto periods = std::max(2U, static_cast<unsigned>(0.5 * options_.seconds / period_s));
  // Includes one period to settle, and three more in case settling is repeated. travel_slack covers ramps and the
  // return.
  const double way_s = (periods + 4) * period_s + 2.0 * ramp_s + 1.0;
  const double bias = options_.travel_revolutions * turn / way_s;

  Measurement found{.speed_rad_s = bias};
  move_at(bias);
  Record all = record(excitation, periods, bias);
  const auto mean_torque = [](const std::vector<double>& torque, std::size_t from) {
    double sum = 0.0;
    for (std::size_t i = from; i < torque.size(); ++i) sum += torque[i];
    return sum / static_cast<double>(torque.size() - from);
  };
  const double forward = mean_torque(all.torque, 0);
  // Moves back over the same distance.
  move_at(-bias);
  const std::size_t half = all.torque.size();
  const Record back = record(excitation, periods, -bias);
  all.command.insert(all.command.end(), back.command.begin(), back.command.end());
  all.differences.insert(all.differences.end(), back.differences.begin(), back.differences.end());
  all.torque.insert(all.torque.end(), back.torque.begin(), back.torque.end());
  const double backward = mean_torque(all.torque, half);
  found.friction = 0.5 * (forward - backward);
  found.constant_load = 0.5 * (forward + backward);
  move_at(0.0);

  found.velocity_by_command = frequency_response(all.command, all.differences, excitation);
  found.torque_by_command = frequency_response(all.command, all.torque, excitation);
  for (std::size_t i = 0; i < found.velocity_by_command.size(); ++i) {
    ResponsePoint& velocity = found.velocity_by_command[i];
    velocity.response *= derivative_of_differences(velocity.frequency_hz, sample_s_);
  }
  found.lost_cycles = lost_cycles() - lost_before_;
  // The exchange continues during the calculation; otherwise the drive reports the loss of its master.
  const auto loop =
      identify_loop(found.velocity_by_command, found.torque_by_command, sample_s_, notch, [this] { wait(sample_s_); });
  if (!loop) {
    fail("the measured response does not match a PI controller with an inertia",
         "check that the axis turns freely, or let it move more with --travel or --seconds");
  }
  found.controller = loop->controller;
  found.mechanics = loop->mechanics;
  found.velocity_by_torque = loop->velocity_by_torque;
  for (std::size_t i = 0; i < found.velocity_by_torque.size(); ++i) {
    const ResponsePoint& point = found.velocity_by_torque[i];
    if (point.coherence < good_coherence) continue;
    found.frequencies_hz.push_back(point.frequency_hz);
    found.open_loop.push_back(loop->open_loop[i]);
    found.closed_loop.push_back(loop->closed_loop[i]);
  }
  if (found.frequencies_hz.size() < fewest_frequencies) {
    fail(fmt::format("the axis responds clearly at only {} of {} frequencies", found.frequencies_hz.size(),
                     found.velocity_by_command.size()),
         "check that it turns freely; measure with longer --seconds");
  }
  found.margins = margins_of(found.frequencies_hz, found.open_loop);
  found.bandwidth_hz = bandwidth_of(found.frequencies_hz, found.closed_loop);
  for (const ResponsePoint& point : found.velocity_by_command) {
    if (point.frequency_hz > 2.0 * found.bandwidth_hz.value_or(bandwidth_hz)) break;
    found.least_coherence = std::min(found.least_coherence, point.coherence);
  }
  return found;
}

// Steps up and down between a third of a velocity and the full velocity, which follows from the permitted travel. The
// responses are averaged; those of downward steps are inverted.
StepResponse Tuner::step() {
  // Disables even if enable() fails, because the drive may be enabled already.
  struct Disabling {
    Tuner& tuner;
    ~Disabling() { tuner.disable(); }
  } disabling{*this};
  enable();
  constexpr double hold_s = 0.25;
  const auto samples = static_cast<std::size_t>(std::lround(hold_s / sample_s_));
  const double way_s = 2.0 * step_repeats * hold_s + 2.0 * ramp_s + 0.6;
  const double high = options_.travel_revolutions * turn / way_s;
  const double low = high / 3.0;
  move_at(low);
  StepResponse response{.sample_s = sample_s_, .velocity = std::vector<double>(samples)};
  std::size_t n = 0;
  command_of_cycle_ = [&] {
    const std::size_t number = n / samples;
    const bool up = number % 2 == 0;
    if (number < 2 * step_repeats) {
      const double share = (velocity_ - low) / (high - low);
      response.velocity[n % samples] += (up ? share : 1.0 - share) / (2.0 * step_repeats);
    }
    ++n;
    return up && number < 2 * step_repeats ? high : low;
  };
  try {
    wait(2.0 * step_repeats * hold_s + sample_s_);
  } catch (...) {
    command_of_cycle_ = {};
    throw;
  }
  command_of_cycle_ = [low] { return low; };
  const double back = -high;
  move_at(back);
  wait(std::max(0.0, (travelled_ / high) - 2.0 * ramp_s));
  move_at(0.0);

  const auto first_above = [&](double level) {
    for (std::size_t i = 0; i < samples; ++i) {
      if (response.velocity[i] < level) continue;
      if (i == 0) return 0.0;
      const double before = response.velocity[i - 1];
      return (static_cast<double>(i) - (response.velocity[i] - level) / (response.velocity[i] - before)) * sample_s_;
    }
    return hold_s;
  };
  response.rise_s = first_above(0.9) - first_above(0.1);
  response.overshoot = std::max(0.0, *std::max_element(response.velocity.begin(), response.velocity.end()) - 1.0);
  for (std::size_t i = 0; i < samples; ++i) {
    if (std::abs(response.velocity[i] - 1.0) > 0.05) response.settling_s = static_cast<double>(i + 1) * sample_s_;
  }
  return response;
}

}  // namespace servodrome::master::tuning
