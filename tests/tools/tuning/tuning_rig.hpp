#pragma once

#include "axis/axis_rig.hpp"
#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/master_watch.hpp"
#include "catalogue/product.hpp"
#include "drive/drive.hpp"
#include "tools/tuning/session.hpp"

namespace servodrome::master::tuning::test {

using namespace std::chrono_literals;
using master::test::AxisRig;
using master::test::RigCase;
using BusKind = RigCase::BusKind;

// Antiresonance about 137 Hz, resonance about 194 Hz.
inline constexpr const char* rigid = "[axis.load]\ninertia_kgm2 = 0.84e-4\n";
inline constexpr const char* elastic =
    "[axis.load]\nelastic = true\ninertia_kgm2 = 0.28e-4\nstiffness_nm_per_rad = 20.0\ndamping_nms = 2e-3\n";

// A drive, its cyclic bus, and a tuner.
struct TuningRig : AxisRig {
  // `phase`: the master's cycle begins later by this time.
  explicit TuningRig(const RigCase& its_case, Time phase = 0ms) : AxisRig(its_case) {
    line.run_until(line.now() + phase);
    if (rig_case.bus == BusKind::ethercat) {
      cyclic = std::make_unique<EthercatCyclicBus>(*ethercat, *operation);
    } else {
      ObjectClient* const drives[] = {&objects()};
      watch.emplace(*can, drives);
      cyclic = std::make_unique<CanCyclicBus>(*can, std::vector{tuning_drive(objects(), dialect)},
                                              CanCyclicOptions{.period = 1ms, .waits_whole_period = true});
    }
    Axis402 axis(objects(), this->options());
    units = tuning_units_of(objects(), dialect, axis.units().value());
  }
  const drive::Drive& servo() { return drive().device().drive(); }
  std::unique_ptr<Tuner> tuner(const TunerOptions& tuner_options = {}) {
    return std::make_unique<Tuner>(*cyclic, objects(), product, units, tuner_options);
  }

  const catalogue::Product& product = catalogue::product_of(rig_case.product);
  const catalogue::TuningDialect& dialect = product.tuning;
  std::optional<MasterWatch> watch;
  std::unique_ptr<CyclicBus> cyclic;
  TuningUnits units;
};

}  // namespace servodrome::master::tuning::test
