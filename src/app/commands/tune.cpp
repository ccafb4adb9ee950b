// `tune`: measures a drive's velocity loop over the bus, and sets its gains for a bandwidth.
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/number_options.hpp"
#include "app/whole_file.hpp"
#include "catalogue/product.hpp"
#include "studio/tuning_json.hpp"
#include "tools/parameters/loader.hpp"
#include "tools/tuning/bode_plot.hpp"
#include "tools/tuning/own_tuning.hpp"
#include "tools/tuning/session.hpp"

namespace servodrome::app {
namespace tune_command {

using nlohmann::ordered_json;
namespace tuning = master::tuning;

struct Options {
  BusOptions bus{.cycle_ms = 1.0};
  std::optional<double> bandwidth_hz;
  bool apply = false;
  bool propose = false;
  bool itself = false;
  bool store = false;
  bool reset_fault = false;
  std::string plot;
  double travel_revolutions = 4.0;
  double torque_percent = 60.0;
  double seconds = 10.0;
  std::optional<double> units_per_revolution;
};

std::string figure(const std::optional<double>& value, const char* unit) {
  return value ? fmt::format("{:.1f} {}", *value, unit) : std::string("not found");
}

void print(const char* when, const tuning::Measurement& measured) {
  fmt::print("{:<10}bandwidth {}, crossover {}, phase margin {}, gain margin {}\n", when,
             figure(measured.bandwidth_hz, "Hz"), figure(measured.margins.crossover_hz, "Hz"),
             figure(measured.margins.phase_margin_deg, "deg"), figure(measured.margins.gain_margin_db, "dB"));
}

void print(const char* when, const tuning::StepResponse& step) {
  fmt::print("{:<10}rise time {:.1f} ms, overshoot {:.0f} %, settling time (5 %) {:.0f} ms\n", when, 1e3 * step.rise_s,
             100.0 * step.overshoot, 1e3 * step.settling_s);
}

void print_table(const tuning::Measurement& measured) {
  fmt::print("\nopen velocity loop, measured\n{:>9}  {:>8}  {:>8}\n", "Hz", "gain dB", "phase");
  double next = 0.0;
  for (const tuning::BodePoint& point : tuning::bode(measured.frequencies_hz, measured.open_loop)) {
    if (point.frequency_hz < next) continue;
    next = 1.35 * point.frequency_hz;
    const auto bar = static_cast<std::size_t>(std::lround(std::clamp(point.gain_db + 40.0, 0.0, 80.0) / 2.0));
    fmt::print("{:>9.1f}  {:>8.1f}  {:>8.0f}  {}\n", point.frequency_hz, point.gain_db, point.phase_deg,
               std::string(bar, '#'));
  }
  fmt::print("\n");
}

void print_gains(const std::vector<tuning::GainValue>& before, const std::vector<tuning::GainValue>& after) {
  for (std::size_t i = 0; i < after.size(); ++i) {
    const bool changed = before[i].number != after[i].number;
    fmt::print("  {:<72}{}\n", tuning::text_of(before[i], after[i]), changed ? "" : "unchanged");
  }
}

void write_plot(const std::string& path, const tuning::SessionResult& result, const std::string& where) {
  std::vector<tuning::BodeCurve> curves{
      {"open loop before", tuning::bode(result.before.frequencies_hz, result.before.open_loop)}};
  if (result.after) {
    curves.push_back({"open loop after", tuning::bode(result.after->frequencies_hz, result.after->open_loop)});
    curves.push_back({"closed loop after", tuning::bode(result.after->frequencies_hz, result.after->closed_loop)});
  }
  write_whole_file(path, tuning::bode_svg(curves, where));
}

// The process data begin with controlword 0, which switches the motor of an enabled drive off: a moving axis would
// coast, a held load would fall.
void stop_before_exchange(DriveLink& link) {
  const auto axis = link.open_axis({});
  const master::PowerState state = axis->state();
  if (state != master::PowerState::operation_enabled && state != master::PowerState::quick_stop_active) return;
  warn(fmt::format("{}: the axis is enabled; it is stopped and switched off before the measurement",
                   link.objects().where()));
  try {
    axis->stop();
    axis->disable();
  } catch (...) {
    axis->try_to_switch_off();
    throw;
  }
}

// On CAN this restores the drive's PDOs. The store command would store those of the measurement, too.
void end_exchange(std::unique_ptr<master::CyclicBus>& cyclic, const Options& options) {
  try {
    if (auto* can = dynamic_cast<master::CanCyclicBus*>(cyclic.get())) can->close();
  } catch (const master::MasterError& error) {
    const std::string problem =
        fmt::format("{}: the PDOs of the drive could not be restored: {}", error.where(), error.happened());
    if (options.store) {
      throw Failure::did_not_work(problem + "; so the gains are not stored: restart the drive and tune it again");
    }
    warn(problem + "; restart the drive");
  }
  cyclic.reset();
}

// Returns true if the drive keeps the gains after power-off. The store command stores all objects, so the drive's own
// values of the watch are restored first.
bool store(DriveLink& link) {
  if (!link.end_watch()) {
    throw Failure::did_not_work(
        fmt::format("{}: the gains are not stored, because the drive would also store the values of this program in "
                    "1016h:01 and 6007h; restart the drive and tune it again",
                    link.objects().where()));
  }
  const std::string_view name = link.product() != nullptr ? link.product()->name : std::string_view{};
  return master::store_parameters(link.objects(), catalogue::product_of(name).rules);
}

void print_storing(const Options& options, bool stored, bool written) {
  if (stored) {
    fmt::print("stored, with all other parameters as the drive has them at present\n");
  } else if (written) {
    fmt::print("{}\n", options.store
                           ? "this drive has no store command; `params save` keeps the gains in a file"
                           : "not stored: the gains are lost at power-off (`--store` stores them, `params save` keeps "
                             "them in a file)");
  }
}

void print(const Options& options, DriveLink& link, const tuning::SessionResult& result,
           const tuning::TuningUnits& units, bool stored) {
  const tuning::Measurement& before = result.before;
  fmt::print(
      "{} {}: inertia {:.3g} {}, friction {:.3g} {} at {:.0f} rpm, constant load {:.2g} {}, loop delay {:.2f} ms\n",
      link.noun(), link.objects().address(), before.mechanics.inertia, units.inertia_name, before.friction,
      units.torque_name, before.speed_rad_s * 60.0 / 6.283185307, before.constant_load, units.torque_name,
      1e3 * before.controller.delay.total_s());
  if (const auto& resonance = before.mechanics.resonance) {
    fmt::print("elastic: antiresonance {:.0f} Hz, resonance {:.0f} Hz, {:.0f} % of the inertia on the motor's side\n",
               resonance->antiresonance_hz, resonance->resonance_hz,
               100.0 * before.mechanics.rotor_inertia() / before.mechanics.inertia);
  }
  print_table(result.after ? *result.after : before);
  print("before", before);
  if (result.step_before) print("", *result.step_before);
  fmt::print("{:<10}bandwidth {:.1f} Hz (target {:.1f} Hz), phase margin {}\n", "predicted",
             result.predicted.bandwidth_hz, result.bandwidth_hz,
             figure(result.predicted.margins.phase_margin_deg, "deg"));
  if (result.after) print("measured", *result.after);
  if (result.step_after) print("", *result.step_after);
  if (result.gains.empty()) {
    fmt::print(
        "in SI units (the gain objects of this drive are not known): velocity loop {:.4g} {} s/rad and {:.4g} {}/rad, "
        "position loop {:.3g} /s\n",
        result.proposal.velocity.kp, units.torque_name, result.proposal.velocity.ki, units.torque_name,
        result.proposal.position_kp);
  } else {
    fmt::print("{}\n", options.apply ? "written:" : "proposed, not written (--apply writes):");
    print_gains(result.gains_before, result.gains);
  }
  if (result.after) fmt::print("{}\n", tuning::text_of_changes(result));
  if (const std::string note = tuning::note_of(result); !note.empty()) fmt::print("note: {}\n", note);
  print_storing(options, stored, options.apply);
}

void run_itself(const Options& options) {
  const InterruptGuard guard;
  DriveLink link(options.bus, true);
  link.operate(options.bus);
  const auto axis = link.open_axis({});
  const auto& dialect =
      catalogue::product_of(link.product() != nullptr ? link.product()->name : std::string_view{}).tuning;
  const auto units = axis->units();
  if (options.reset_fault) axis->reset_fault();
  const bool shown = on_terminal() && !options.bus.json;
  const tuning::OwnTuningResult result = tuning::tune_by_itself(
      *axis, dialect, units.value_or(catalogue::AxisUnits{1.0, 1.0, 1.0}),
      {.travel_revolutions = options.travel_revolutions, .progress = [&](const char* doing, double share) {
         if (shown && error_output_is_ready()) fmt::print(stderr, "\r  {} {:.0f} %\x1B[K", doing, 100.0 * share);
       }});
  if (shown) fmt::print(stderr, "\r\x1B[K");
  const bool stored = options.store && store(link);
  if (options.bus.json) {
    ordered_json json{{"node", axis->address()}};
    json.update(studio::json_of(result));
    json["stored"] = stored;
    fmt::print("{}\n", json.dump(2));
    return;
  }
  fmt::print("{} {}: tuned by the drive itself\n", link.noun(), axis->address());
  print_gains(result.before, result.after);
  fmt::print("note: {}\n", tuning::note_of(result));
  print_storing(options, stored, true);
}

void run(const Options& options) {
  if (options.apply && options.propose) throw Failure::wrong_use("tune: give --apply or --propose, not both");
  if (options.store && !options.apply && !options.itself)
    throw Failure::wrong_use("tune: --store goes with --apply or --auto");
  if (!options.plot.empty()) require_writable(options.plot);
  if (options.itself) return run_itself(options);
  const BusKind kind = bus_kind(options.bus).kind;
  if (kind == BusKind::modbus || kind == BusKind::serial10) {
    throw Failure::wrong_use(fmt::format(
        "--bus {}: a frequency response needs samples at a fixed rate, which this bus does not give; --auto lets a "
        "drive tune itself, or use its CAN or EtherCAT port",
        options.bus.link));
  }
  const InterruptGuard guard;
  DriveLink link(options.bus, true);
  stop_before_exchange(link);
  link.operate(options.bus);
  master::ObjectClient& objects = link.objects();
  const auto& product = catalogue::product_of(link.product() != nullptr ? link.product()->name : std::string_view{});
  const catalogue::TuningDialect& dialect = product.tuning;
  const auto axis = link.open_axis({});
  const auto axis_units = axis->units(options.units_per_revolution);
  if (!axis_units) {
    throw Failure::did_not_work(
        fmt::format("{}: the drive does not report its units per revolution (6092h, 608Fh); give them with "
                    "--units-per-revolution NUMBER",
                    objects.where()));
  }
  const tuning::TuningUnits units = tuning::tuning_units_of(objects, dialect, *axis_units);
  if (options.reset_fault) axis->reset_fault();
  auto cyclic =
      link.open_cyclic(kind == BusKind::can ? tuning::tuning_drive(objects, dialect) : master::CanDrive{}, options.bus);
  const bool shown = on_terminal() && !options.bus.json;
  tuning::SessionResult result;
  {
    tuning::Tuner tuner(*cyclic, objects, product, units,
                        {.travel_revolutions = options.travel_revolutions,
                         .torque_limit = options.torque_percent / 100.0,
                         .seconds = options.seconds,
                         .cancelled = InterruptGuard::interrupted,
                         .progress = [&](const char* doing, double share) {
                           if (shown && error_output_is_ready())
                             fmt::print(stderr, "\r  {} {:.0f} %\x1B[K", doing, 100.0 * share);
                         }});
    result =
        tuning::tune(tuner, objects, dialect, units, {.bandwidth_hz = options.bandwidth_hz, .apply = options.apply});
  }
  if (shown) fmt::print(stderr, "\r\x1B[K");
  end_exchange(cyclic, options);
  const bool stored = options.store && store(link);
  if (options.bus.json) {
    ordered_json json{{"node", axis->address()}};
    json.update(studio::json_of(result, units));
    json["stored"] = stored;
    fmt::print("{}\n", json.dump(2));
  } else {
    print(options, link, result, units, stored);
  }
  // The file comes last: the disk may be full, and the gains are written and printed then.
  if (!options.plot.empty()) write_plot(options.plot, result, objects.where());
}

}  // namespace tune_command

void add_tune(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "tune",
      "Measure a drive's velocity loop over CAN or EtherCAT and propose gains for a target bandwidth; --apply writes "
      "them and measures the result. The axis moves slowly, some revolutions forward and back",
      tune_command::run);
  add_drive_options(*command, options->bus, "Seconds to wait for each answer");
  add_watch_option(*command, options->bus);
  add_cycle_options(*command, options->bus);
  command->get_option("--cycle")->description("Period in milliseconds of SYNC (CAN) or of the process data (EtherCAT)");
  command
      ->add_option(
          "--bandwidth", options->bandwidth_hz,
          "Target bandwidth of the closed velocity loop (-3 dB) in Hz; if not given 60 % of the maximum, or the "
          "present bandwidth if that is greater")
      ->check(number_within(1.0, 1000.0));
  command->add_flag("--propose,--dry-run", options->propose, "Write nothing (the default without --apply and --auto)");
  command->add_flag("--apply", options->apply,
                    "Write the gains; the old gains are restored if the predicted result is not reached");
  CLI::Option* const itself =
      command->add_flag("--auto", options->itself,
                        "Use the drive's own automatic tuning instead (iSMK), over any bus; the drive changes its "
                        "gains");
  command->add_flag("--store", options->store,
                    "Store the gains, and with them all parameters of the drive, in non-volatile memory");
  command->add_option("--plot", options->plot, "Write a Bode plot to this file (SVG)");
  command
      ->add_option("--travel", options->travel_revolutions,
                   "Maximum travel forward from the present position, in motor revolutions")
      ->check(number_within(0.5, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--torque", options->torque_percent,
                   "Torque limit in % of rated torque (iSMK: of the peak current) that ends the measurement")
      ->check(number_within(1.0, 300.0))
      ->capture_default_str();
  add_seconds_option(*command, options->seconds,
                     "Duration of each measurement in seconds; a longer one is more accurate on a noisy axis")
      ->check(number_within(4.0, 600.0))
      ->capture_default_str();
  command
      ->add_option("--units-per-revolution", options->units_per_revolution,
                   "Position units of the drive per motor revolution, if the drive does not report them (ISMC)")
      ->check(number_within(1e-3, 1e9));
  command->add_flag("--reset-fault", options->reset_fault, "Reset a fault first");
  // The drive's own tuning always changes the gains, and has no measurement of this program.
  for (const char* of_measurement :
       {"--propose", "--bandwidth", "--torque", "--seconds", "--plot", "--units-per-revolution"}) {
    itself->excludes(of_measurement);
  }
}

}  // namespace servodrome::app
