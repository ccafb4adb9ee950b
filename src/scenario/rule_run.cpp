#include "scenario/rule_run.hpp"

#include "links/disturbance_generator.hpp"

namespace servodrome::scenario {

double draw(std::uint64_t seed, std::uint64_t stream, std::uint64_t number) {
  links::DisturbanceGenerator seeds(seed ^ stream << 32);
  links::DisturbanceGenerator values(seeds.next() + number);
  return static_cast<double>(values.next() >> 11U) * 0x1.0p-53;
}

bool RuleRun::fires(std::uint64_t seed) const {
  if (phase != Phase::active || exhausted() || seen < rule->skip) return false;
  if ((seen - rule->skip) % rule->every != 0) return false;
  return rule->chance >= 1 || draw(seed, number, seen) < rule->chance;
}

}  // namespace servodrome::scenario
