// Runs N ticks of a drive with its plant, in velocity control with all monitors active. Instructions per tick: see
// callgrind_sdo.cpp.
// Usage: callgrind_tick ismc|generic402|MODEL N, with MODEL of jmc_ec
#include <cstdlib>
#include <cstring>

#include "../tests/products/rig.hpp"
#include "line/model_plant.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "products/jmc_ec/jmc_ec.hpp"

namespace {

using namespace servodrome;

template <typename Rig>
int run(Rig& rig, std::int64_t velocity, long ticks) {
  rig.set(0x6060, 0, 3);
  rig.enable();
  rig.set(0x60FF, 0, velocity);
  rig.run_ms(50);
  for (long i = 0; i < ticks; ++i) rig.tick();
  return rig.plant.velocity_rpm() > 10.0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  const char* which = argc > 1 ? argv[1] : "ismc";
  const long ticks = argc > 2 ? std::atol(argv[2]) : 1000;
  if (std::strcmp(which, "ismc") == 0) {
    test::Rig<products::Ismc> rig;
    return run(rig, 1000000, ticks);
  }
  if (std::strcmp(which, "generic402") == 0) {
    test::Rig<products::Generic402> rig;
    return run(rig, 1000000, ticks);
  }
  plant::Parameters parameters;
  line::fit_model(products::jmc_ec::find_rating(which).model, parameters);
  parameters.supply.charged_at_start = true;
  products::Settings settings;
  settings.model = which;
  test::Rig<products::JmcEc> rig(parameters, settings);
  return run(rig, 10000, ticks);
}
