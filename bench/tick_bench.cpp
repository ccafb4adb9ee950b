// Measures the cost of one base tick of a drive with its plant, with all monitors and loops active, for 1 and for 256
// axes. The baseline is a simple scalar loop of the same kind, measured in the same run.
// Usage: tick_bench [NAME], NAME: measure only this one
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <memory>
#include <vector>

#include "../tests/products/rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"

namespace {

using namespace servodrome;

// Processor time of this thread, so that other programs do not count.
double now_ns() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) * 1e9 + static_cast<double>(time.tv_nsec);
}

// A PI velocity loop on a motor model of one line, like the first draft of a servo simulation.
double bare_loop_ns(int ticks) {
  volatile float target = 100.0F;
  float velocity = 0.0F, integral = 0.0F, current = 0.0F, position = 0.0F;
  const double start = now_ns();
  for (int i = 0; i < ticks; ++i) {
    const float error = target - velocity;
    integral = std::clamp(integral + 0.01F * error, -10.0F, 10.0F);
    const float voltage = std::clamp(0.5F * error + integral, -310.0F, 310.0F);
    current += 62.5e-6F * (voltage - 1.1F * current - 0.05F * velocity) / 4.5e-3F;
    velocity += 62.5e-6F * (0.47F * current - 1e-4F * velocity) / 5.6e-5F;
    position += 62.5e-6F * velocity;
  }
  const double elapsed = now_ns() - start;
  volatile float keep = position;
  (void)keep;
  return elapsed / ticks;
}

template <typename Rig>
void start_moving(Rig& rig) {
  rig.set(0x6060, 0, 3);
  rig.enable();
  rig.set(0x60FF, 0, 1000000);
  rig.run_ms(50);
}

// Axes run in batches of one position-loop cycle, like a line between two frames.
template <typename Rig>
double axes_ns(std::vector<std::unique_ptr<Rig>>& rigs, int batches, int batch) {
  const double start = now_ns();
  for (int b = 0; b < batches; ++b) {
    for (auto& rig : rigs) {
      for (int i = 0; i < batch; ++i) rig->tick();
    }
  }
  const double elapsed = now_ns() - start;
  return elapsed / (static_cast<double>(batches) * batch * static_cast<double>(rigs.size()));
}

template <typename Device>
void measure(const char* name, double bare, const plant::Parameters& parameters) {
  using Rig = test::Rig<Device>;
  for (const int axes : {1, 256}) {
    std::vector<std::unique_ptr<Rig>> rigs;
    for (int i = 0; i < axes; ++i) {
      rigs.push_back(std::make_unique<Rig>(parameters));
      start_moving(*rigs.back());
    }
    double best = 1e9;
    for (int repeat = 0; repeat < 15; ++repeat) best = std::min(best, axes_ns(rigs, axes == 1 ? 4000 : 20, 16));
    std::printf(
        "%-20s %4d axes  %7.1f ns per tick and axis   %6.1f x real time   %5.2f x bare loop   %zu + %zu bytes\n", name,
        axes, best, 62500.0 / best / axes, best / bare, sizeof(Device), sizeof(plant::Plant));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const auto asked = [&](const char* name) { return argc < 2 || std::strcmp(argv[1], name) == 0; };
  double bare = 1e9;
  for (int repeat = 0; repeat < 15; ++repeat) bare = std::min(bare, bare_loop_ns(2000000));
  std::printf("bare scalar loop     %7.1f ns per tick\n", bare);
  const plant::Parameters ideal = test::default_plant();
  plant::Parameters imperfect = ideal;
  imperfect.stage.ideal = imperfect.sensors.ideal = false;
  plant::Parameters elastic = ideal;
  elastic.load.elastic = true;
  if (asked("ismc")) measure<products::Ismc>("ismc", bare, ideal);
  if (asked("generic402")) measure<products::Generic402>("generic402", bare, ideal);
  if (asked("imperfect")) measure<products::Generic402>("generic402 imperfect", bare, imperfect);
  if (asked("elastic")) measure<products::Generic402>("generic402 elastic", bare, elastic);
}
