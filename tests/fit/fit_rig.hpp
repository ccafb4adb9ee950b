#pragma once

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <memory>
#include <random>

#include "axis/axis_rig.hpp"
#include "fit/fit.hpp"
#include "line/tap.hpp"
#include "tools/script/run.hpp"

// A drive in virtual time that executes a motion script while the rig records its signals, like the bench API.
namespace servodrome::fit::test {

using namespace std::chrono_literals;

// Random numbers that are the same on every machine for a seed.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : source_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(source_() >> 11U) * 0x1p-53;
  }
  double by_magnitude(double low, double high) { return low * std::pow(high / low, uniform(0.0, 1.0)); }
  double normal() {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += uniform(0.0, 1.0);
    return sum;
  }
  template <typename T, std::size_t N>
  T one_of(const std::array<T, N>& of) {
    return of[static_cast<std::size_t>(uniform(0.0, static_cast<double>(N)))];
  }

 private:
  std::mt19937_64 source_;
};

// A servo motor of 50 W to 2 kW with its load, on the rectified supply of 220 V.
struct Truth {
  double power_w = 0.0;
  double rated_torque_nm = 0.0;
  double rated_current_a = 0.0;  // rms
  double torque_constant = 0.0;  // per A rms
  double resistance_ohm = 0.0;
  double inductance_h = 0.0;
  double rotor_inertia_kgm2 = 0.0;
  double load_inertia_kgm2 = 0.0;
  double coulomb_nm = 0.0;
  double viscous_nms = 0.0;
  double weight_nm = 0.0;
  int pole_pairs = 0;
  int counts = 0;
  int phases = 3;
  int direction = 1;
  bool ideal_stage = true;

  double inertia_kgm2() const { return rotor_inertia_kgm2 + load_inertia_kgm2; }

  std::string axis_text() const {
    return fmt::format(
        "[axis.stage]\nideal = {}\n"
        "[axis.motor]\nphases = {}\nrated_torque_nm = {}\nrated_current_a = {}\npole_pairs = {}\nresistance_ohm = {}\n"
        "direct_inductance_h = {}\nquadrature_inductance_h = {}\ntorque_constant_nm_per_a = {}\n"
        "rotor_inertia_kgm2 = {}\nbrake_torque_nm = {}\n[axis.load]\ninertia_kgm2 = {}\nviscous_friction_nms = {}\n"
        "coulomb_friction_nm = {}\nstatic_friction_nm = {}\ngravity_torque_nm = {}\n"
        "[axis.encoder]\ncounts_per_revolution = {}\ndirection = {}\n[axis.supply]\novercurrent_a = "
        "{}\nbus_overcurrent_a = {}\n"
        "[axis.thermal]\nwinding_heat_capacity_j_per_k = {}\n",
        ideal_stage, phases, rated_torque_nm, rated_current_a, pole_pairs, resistance_ohm, inductance_h, inductance_h,
        torque_constant, rotor_inertia_kgm2, rated_torque_nm, load_inertia_kgm2, viscous_nms, coulomb_nm,
        1.3 * coulomb_nm, weight_nm, counts, direction, 8.0 * rated_current_a, 16.0 * rated_current_a, 0.15 * power_w);
  }
};

inline constexpr double rated_speed_rad_s = 314.16;  // 3000 rpm

inline Truth drawn(std::uint64_t seed) {
  Draw draw(seed);
  Truth truth;
  truth.power_w = draw.by_magnitude(50.0, 2000.0);
  truth.rated_torque_nm = truth.power_w / rated_speed_rad_s;
  // The back-EMF at 3000 rpm is a quarter to half of the available voltage.
  truth.torque_constant = draw.uniform(0.3, 0.6);
  truth.rated_current_a = truth.rated_torque_nm / truth.torque_constant * draw.uniform(1.0, 1.1);
  // 4 to 13 % of the power are lost in the copper; smaller motors lose more.
  const double lost = draw.uniform(0.04, 0.07) * std::pow(1000.0 / truth.power_w, 0.2);
  truth.resistance_ohm = lost * truth.power_w / (3.0 * truth.rated_current_a * truth.rated_current_a);
  truth.inductance_h = draw.uniform(1.5e-3, 6e-3) * truth.resistance_ohm;            // by the electrical time constant
  truth.rotor_inertia_kgm2 = truth.rated_torque_nm / draw.by_magnitude(1.5e4, 5e4);  // by the greatest acceleration
  truth.load_inertia_kgm2 = draw.uniform(0.5, 6.0) * truth.rotor_inertia_kgm2;
  truth.coulomb_nm = draw.uniform(0.01, 0.06) * truth.rated_torque_nm;
  truth.viscous_nms = draw.uniform(0.01, 0.05) * truth.rated_torque_nm / rated_speed_rad_s;
  truth.weight_nm = draw.uniform(0.02, 0.2) * truth.rated_torque_nm * (draw.uniform(0.0, 1.0) < 0.5 ? -1.0 : 1.0);
  truth.pole_pairs = draw.one_of(std::array{3, 4, 5});
  truth.counts = draw.one_of(std::array{10000, 65536, 131072, 1048576});
  return truth;
}

// The motion of docs/fit.md: speeds of 15 % and 80 % of the rated speed in both directions, with a quarter and with
// nine tenths of the rated torque.
inline std::string excitation(const Truth& truth) {
  constexpr double turn = 6.283185307179586;
  const double high = 0.8 * rated_speed_rad_s / turn;
  const double low = 0.15 * rated_speed_rad_s / turn;
  const double slow = 0.25 * truth.rated_torque_nm / truth.inertia_kgm2() / turn;
  const double fast = 0.9 * truth.rated_torque_nm / truth.inertia_kgm2() / turn;
  std::string text = "units revolutions\nenable\nwait 0.2\nrepeat 2\n";
  for (const double sign : {1.0, -1.0}) {
    for (const double acceleration : {slow, fast}) {
      for (const double speed : {low, high, low, high}) {
        text += fmt::format("velocity {:.4f} acceleration {:.4f}\nwait 0.05\n", sign * speed, acceleration);
      }
    }
  }
  return text + "end\n";
}

// The recorded values, one row per tick.
struct Kept {
  std::vector<std::string> names;
  std::vector<std::vector<double>> values{};  // of each name

  std::size_t rows() const { return values.front().size(); }
  std::vector<double>& of(std::string_view name) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i] == name) return values[i];
    }
    throw std::runtime_error("no such signal");
  }
};

inline Kept record(const Truth& truth, const std::vector<std::string>& names) {
  const std::string axis_text = truth.axis_text();
  master::test::AxisRig rig({.product = "generic402", .axis_text = axis_text.c_str()});
  std::vector<line::Channel> channels;
  for (const std::string& name : names) channels.push_back(line::signal_channel(rig.drive(), name));
  line::Tap tap(channels, 1);
  Kept kept{.names = names, .values = std::vector<std::vector<double>>(names.size())};
  std::int64_t next = tap.due();
  const auto take = [&] {
    if (tap.due() - next > static_cast<std::int64_t>(api::SampleRows::kept)) throw std::runtime_error("rows were lost");
    for (; next < tap.due(); ++next) {
      for (std::size_t i = 0; i < names.size(); ++i) kept.values[i].push_back(tap.samples()[i].at(next));
    }
    return false;
  };
  master::script::Cancellation taking(take);
  master::AxisOptions axis_options = rig.options();
  axis_options.cancelled = std::ref(taking);
  master::Axis402 axis(rig.objects(), axis_options);
  master::Axis402* const axes[] = {&axis};
  const master::script::Script script =
      master::script::parse(excitation(truth), "excitation", master::ObjectCatalogue::standard());
  master::script::RunOptions options;
  options.cancellation = &taking;
  options.done = [&](const master::script::Step&, master::Time, const std::string&) { take(); };
  master::script::run(script, axes, options);
  return kept;
}

inline Table table_of(const Kept& kept) {
  Table table{.source = "recording", .clocks = {{}}, .columns = {}};
  for (std::size_t i = 0; i < kept.rows(); ++i) {
    table.clocks[0].push_back(static_cast<double>(i) * drive::tick_seconds);
  }
  for (std::size_t i = 0; i < kept.names.size(); ++i) {
    std::string unit;
    for (const line::Signal& signal : line::signals()) {
      if (signal.name == kept.names[i]) unit = signal.unit;
    }
    table.columns.push_back({"x", kept.names[i], unit, 0, kept.values[i]});
  }
  return table;
}

// Simulates a slower stage: the recorded voltages are set `ticks` before they act. `turned_on`: the drive knows the
// delay and rotates its voltages by the angle that the rotor turns meanwhile.
inline void advance_voltages(Kept& kept, std::size_t ticks, const Truth& truth, bool turned_on) {
  std::vector<double>& vd = kept.of("direct_voltage_v");
  std::vector<double>& vq = kept.of("quadrature_voltage_v");
  const std::vector<double>& speed = kept.of("velocity_rpm");
  for (std::size_t i = 0; i + ticks < kept.rows(); ++i) {
    const double electrical = truth.pole_pairs * speed[i] * 6.283185307179586 / 60.0;
    const double angle = turned_on ? 0.0 : electrical * static_cast<double>(ticks) * drive::tick_seconds;
    const double d = vd[i + ticks];
    const double q = vq[i + ticks];
    vd[i] = d * std::cos(angle) - q * std::sin(angle);
    vq[i] = q * std::cos(angle) + d * std::sin(angle);
  }
}

// A measurement with this number of bits over +-full. Before rounding it has noise with a standard deviation of one
// step.
inline void quantise(std::vector<double>& values, double full, unsigned bits, Draw& draw) {
  const double step = 2.0 * full / std::pow(2.0, bits);
  for (double& value : values) value = std::round(value / step + draw.normal()) * step;
}

}  // namespace servodrome::fit::test
