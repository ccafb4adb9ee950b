// The TIME service: object 1012h and the time stamp.
#include "master/canopen/scan.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/frames.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::time_group {
namespace {

using namespace std::chrono_literals;
using dictionary::AbortCode;

constexpr std::uint16_t time_cob_id = 0x1012;
constexpr std::uint32_t consumes = 1U << 31;
constexpr std::uint32_t produces = 1U << 30;
constexpr std::uint32_t extended = 1U << 29;

std::uint32_t present(Trial& trial) {
  const auto value = trial.objects().read_if_present<std::uint32_t>(time_cob_id);
  if (!value) Trial::skip("it has no 1012h, which is optional");
  return *value;
}

std::string text_of_value(std::uint32_t value) { return fmt::format("1012h = {:08X}h", value); }

void write(Trial& trial, std::uint32_t value) { trial.objects().write<std::uint32_t>(time_cob_id, 0, value); }

void consumer(Trial& trial, int) {
  const std::uint32_t before = present(trial);
  for (const std::uint32_t value : {before & ~consumes, before | consumes}) {
    if (!trial.expect_taken(text_of_value(value), [&] { write(trial, value); })) continue;
    const std::uint32_t after = present(trial);
    trial.expect(after == value, "read 1012h", text_of_value(value), text_of_value(after));
  }
  auto& [bus, sdo] = trial.subject().can();
  if (scan(bus).size() != 1) return;  // the time stamp would set the clocks of the other nodes
  const Watch emergencies(bus, 0x80U + sdo.node_id());
  // 1 January 2024, noon: milliseconds since midnight, days since 1984.
  bus.send(before & 0x7FF, {0x00, 0x2E, 0x93, 0x02, 0x12, 0x39});
  bus.run_for(50ms);
  trial.expect(emergencies.arrivals().empty(), "a time stamp to its identifier", "no emergency", "an emergency");
  const auto device = trial.objects().read_if_present<std::uint32_t>(0x1000);
  trial.expect(device.has_value(), "read 1000h after that", "an answer", device ? "an answer" : "none");
}

// A value for an optional feature: the drive may accept it, or refuse it with 0609 0030h.
void what_it_cannot(Trial& trial, std::uint32_t value, const char* what) {
  const auto refusal = Trial::refusal_of([&] { write(trial, value); });
  trial.expect(!refusal || refusal->code == AbortCode::value_invalid,
               fmt::format("{} ({})", text_of_value(value), what),
               "taken, or refused with " + text_of(AbortCode::value_invalid), text_of(refusal));
}

void rules(Trial& trial, int) {
  const std::uint32_t before = present(trial);
  // Clears both bits of 1012h, so that the drive does not use TIME.
  write(trial, before & ~(consumes | produces));
  what_it_cannot(trial, before & ~consumes & ~produces & 0x1FFFFFFFU, "out of use");
  what_it_cannot(trial, (before & ~consumes & ~produces) | extended, "an extended frame");
  write(trial, before & ~(consumes | produces));
  const std::uint32_t restricted = 0x600U + trial.subject().can().sdo.node_id();
  trial.expect_refused(text_of_value(restricted) + " (a restricted identifier, of its own SDO)",
                       {AbortCode::value_invalid, AbortCode::value_too_high, AbortCode::value_too_low},
                       [&] { write(trial, restricted); });
  const std::uint32_t after = present(trial);
  trial.expect((after & 0x7FF) == (before & 0x7FF), "read 1012h",
               fmt::format("its identifier {:X}h, as before", before & 0x7FF), text_of_value(after));
}

constexpr std::array rows{
    Check{"time.consumer", "CiA 301 7.5.2.15, object 1012h", "A time stamp is consumed according to bit 31",
          Demand::nothing, buses::can, consumer},
    Check{"time.identifier", "CiA 301 7.3.5, 7.5.2.15, object 1012h",
          "Unsupported settings are refused with 0609 0030h, and restricted identifiers are refused", Demand::nothing,
          buses::can, rules},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::time_group
