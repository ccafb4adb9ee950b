#include "scenario/rule_run.hpp"

#include "links/disturbance_generator.hpp"

namespace servodrome::scenario {
namespace {

// FNV-1a. The draws of a rule depend on its name, so they stay the same when other rules come or go.
std::uint64_t hash_of(std::string_view name) {
  std::uint64_t hash = 0xCBF29CE484222325U;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
  return hash;
}

// A random number in [0, 1) that depends only on the arguments.
double draw(std::uint64_t seed, std::uint64_t stream, std::uint64_t number) {
  links::DisturbanceGenerator seeds(seed ^ stream);
  links::DisturbanceGenerator values(seeds.next() + number);
  return static_cast<double>(values.next() >> 11U) * 0x1.0p-53;
}

}  // namespace

bool RuleRun::fires(std::uint64_t seed) const {
  if (phase != Phase::active || exhausted() || seen < rule->skip) return false;
  if ((seen - rule->skip) % rule->every != 0) return false;
  return rule->chance >= 1 || draw(seed, hash_of(rule->name), seen) < rule->chance;
}

Time RuleRun::lateness(const Delay& delay, std::uint64_t seed) const {
  const double share = draw(seed, ~hash_of(rule->name), seen);
  return delay.time + Time(static_cast<std::int64_t>(share * static_cast<double>(delay.jitter.count())));
}

}  // namespace servodrome::scenario
