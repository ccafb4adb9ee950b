#include <algorithm>
#include <array>

#include "generator.hpp"
#include "plant/injection.hpp"

// The steps of the test bench: switches, supply, load, inertia, locked rotor, injected faults, power and cables.
namespace servodrome::motion {

void Generator::bench() {
  const line::SwitchWiring& wiring = variant().product->wiring;
  switch (random_.below(14)) {
    case 0:
    case 1:
    case 2:
    case 3: {  // a limit switch, with or without a bounce
      const std::int64_t wire = limit_wire();
      add({.kind = Kind::input, .value = 1, .count = wire});
      if (random_.chance(40)) {
        now_ += random_.within(1, 40);
        add({.kind = Kind::input, .value = 0, .count = wire});
        now_ += random_.within(1, 16);
        add({.kind = Kind::input, .value = 1, .count = wire});
      }
      now_ += random_.within(1, 350) * ticks_per_ms;
      if (random_.chance(80)) add({.kind = Kind::input, .value = random_.chance(50) ? 0 : 2, .count = wire});
      return;
    }
    case 4: {
      add({.kind = Kind::input,
           .value = random_.below(2),
           .count = random_.chance(50) ? wiring.home : random_.below(4)});
      return;
    }
    case 5: {  // a dip of the supply, or another voltage
      static constexpr std::array<std::int64_t, 6> levels{0, 300, 600, 850, 1100, 1000};
      add({.kind = Kind::supply, .value = random_.of(levels)});
      if (random_.chance(70)) {
        now_ += random_.within(1, 120) * ticks_per_ms;
        add({.kind = Kind::supply, .value = 1000});
      }
      return;
    }
    case 6:
    case 7: {
      static constexpr std::array<std::int64_t, 8> loads{0, 100, 300, 500, -100, -300, -500, 1500};
      add({.kind = Kind::load, .value = random_.of(loads)});
      return;
    }
    case 8: {
      static constexpr std::array<std::int64_t, 4> inertias{100, 50, 150, 200};
      const std::int64_t most = variant().model.empty() ? 200 : 100;
      add({.kind = Kind::inertia, .value = std::min(random_.of(inertias), most)});
      return;
    }
    case 9:
    case 10: {
      add({.kind = Kind::lock, .value = 1});
      now_ += random_.within(1, 150) * ticks_per_ms;
      add({.kind = Kind::lock, .value = 0});
      return;
    }
    case 11: {
      const auto injection = random_.below(static_cast<std::int64_t>(plant::injection_names.size()));
      add({.kind = Kind::inject, .value = 1, .count = injection});
      now_ += random_.within(1, 60) * ticks_per_ms;
      if (random_.chance(85)) add({.kind = Kind::inject, .value = 0, .count = injection});
      return;
    }
    case 12: {
      add({.kind = Kind::power, .value = 0});
      now_ += random_.within(1, 60) * ticks_per_ms;
      add({.kind = Kind::power, .value = 1});
      now_ += random_.within(2, 20) * ticks_per_ms;
      return;
    }
    default: {
      add({.kind = Kind::cut, .value = 1});
      now_ += random_.within(1, 60) * ticks_per_ms;
      add({.kind = Kind::cut, .value = 0});
      return;
    }
  }
}

std::int64_t Generator::limit_wire() {
  const line::SwitchWiring& wiring = variant().product->wiring;
  return random_.chance(50) ? wiring.negative_limit : wiring.positive_limit;
}

}  // namespace servodrome::motion
