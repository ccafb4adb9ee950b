#include "studio/tuning_order.hpp"

#include "host/cyclic/object_cyclic_bus.hpp"
#include "host/tuning/own_tuning.hpp"
#include "studio/tuning_json.hpp"

namespace servodrome::studio {
namespace {

namespace tuning = host::tuning;

constexpr host::Time period = std::chrono::milliseconds(1);

}  // namespace

void tune_axis(host::Axis402& axis, const TuningOrder& order, Conduct& conduct) {
  host::ObjectClient& objects = axis.objects();
  if (!conduct.has_cycles) {
    throw host::HostError(
        "a frequency response needs samples at a fixed rate, and the studio has its objects one by one",
        objects.where(), "use `servodrome tune` on its bus meanwhile");
  }
  const tuning::TuningDialect& dialect = tuning::tuning_dialect_of(conduct.product);
  const tuning::TuningUnits units = tuning::tuning_units_of(objects, dialect, order.revolution);
  const host::CanDrive exchanged = tuning::tuning_drive(objects, dialect);
  host::ObjectCyclicBus bus(objects, exchanged.rpdos.front(), exchanged.tpdos.front(), period);
  tuning::TunerOptions options = order.tuner;
  options.cancelled = conduct.released;
  options.progress = conduct.progress;
  tuning::Tuner tuner(bus, objects, dialect, units, options);
  conduct.found = json_of(tuning::tune(tuner, objects, dialect, units, order.session), units);
}

void let_axis_tune_itself(host::Axis402& axis, const TuningOrder& order, Conduct& conduct) {
  conduct.found = json_of(
      tuning::tune_by_itself(axis, tuning::tuning_dialect_of(conduct.product), order.revolution,
                             {.travel_revolutions = order.tuner.travel_revolutions, .progress = conduct.progress}));
}

}  // namespace servodrome::studio
