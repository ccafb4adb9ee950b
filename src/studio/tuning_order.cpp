#include "studio/tuning_order.hpp"

#include "catalogue/product.hpp"
#include "studio/tuning_json.hpp"
#include "tools/tuning/own_tuning.hpp"

namespace servodrome::studio {
namespace {

namespace tuning = master::tuning;

}  // namespace

void tune_axis(master::Axis402& axis, const TuningOrder& order, Conduct& conduct) {
  axis.stop();  // the measurement begins at rest, also out of a velocity or a torque of an earlier job
  master::ObjectClient& objects = axis.objects();
  const catalogue::Product& product = catalogue::product_of(conduct.product);
  const tuning::TuningUnits units = tuning::tuning_units_of(objects, product.tuning, order.revolution);
  const auto work = [&product, units, order](CyclicAccess& access) {
    tuning::TunerOptions options = order.tuner;
    options.drive = access.drive;
    options.cancelled = access.cancelled;
    options.progress = access.progress;
    tuning::Tuner tuner(access.bus, access.objects, product, units, options);
    return json_of(tuning::tune(tuner, access.objects, product.tuning, units, order.session), units);
  };
  conduct.found = conduct.in_cycles(tuning::tuning_drive(objects, product.tuning), work);
}

void let_axis_tune_itself(master::Axis402& axis, const TuningOrder& order, Conduct& conduct) {
  axis.stop();
  conduct.found = json_of(
      tuning::tune_by_itself(axis, catalogue::product_of(conduct.product).tuning, order.revolution,
                             {.travel_revolutions = order.tuner.travel_revolutions, .progress = conduct.progress}));
}

}  // namespace servodrome::studio
