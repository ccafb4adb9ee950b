// Modes of operation: 6060h, 6061h, 6502h.
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::mode_group {
namespace {

using namespace std::chrono_literals;
using dictionary::AbortCode;

constexpr std::array<std::int8_t, 10> standard_modes{1, 2, 3, 4, 6, 7, 8, 9, 10, 11};

std::uint32_t supported(Trial& trial) {
  const auto modes = trial.objects().read_if_present<std::uint32_t>(0x6502);
  if (!modes) Trial::skip("it has no 6502h with its supported modes");
  return *modes;
}

bool displays(Trial& trial, std::int8_t mode, Time patience) {
  const Time deadline = trial.now() + patience;
  while (trial.objects().read<std::int8_t>(0x6061) != mode) {
    if (trial.now() >= deadline) return false;
    trial.wait(trial.settings().poll_interval);
  }
  return true;
}

void supported_taken(Trial& trial, int) {
  const std::uint32_t modes = supported(trial);
  trial.bring_to(PowerState::switch_on_disabled);
  for (const std::int8_t mode : standard_modes) {
    if ((modes >> (mode - 1) & 1) == 0) continue;
    const std::string sent = fmt::format("6060h = {} ({})", mode, master::name(static_cast<OperationMode>(mode)));
    const auto refusal = Trial::refusal_of([&] { trial.objects().write<std::int8_t>(0x6060, 0, mode); });
    const bool shown = !refusal && displays(trial, mode, 500ms);
    trial.expect(shown, sent, fmt::format("6061h = {}, since 6502h = {:X}h has it", mode, modes),
                 refusal ? refusal->text : fmt::format("6061h = {}", trial.objects().read<std::int8_t>(0x6061)));
  }
}

// The drive must refuse an unsupported mode, or at least must not display it.
void unsupported_refused(Trial& trial, int) {
  const std::uint32_t modes = supported(trial);
  trial.bring_to(PowerState::switch_on_disabled);
  for (const std::int8_t mode : standard_modes) {
    if ((modes >> (mode - 1) & 1) != 0) continue;
    const std::int8_t before = trial.objects().read<std::int8_t>(0x6061);
    const std::string sent = fmt::format("6060h = {} ({})", mode, master::name(static_cast<OperationMode>(mode)));
    const auto refusal = Trial::refusal_of([&] { trial.objects().write<std::int8_t>(0x6060, 0, mode); });
    trial.wait(50ms);
    const std::int8_t after = trial.objects().read<std::int8_t>(0x6061);
    trial.expect(after == before && after != mode, sent,
                 fmt::format("6061h = {}, as before, since 6502h = {:X}h does not have it", before, modes),
                 fmt::format("{}; 6061h = {}", text_of(refusal), after));
    if (refusal && refusal->code) {
      const AbortCode code = *refusal->code;
      const bool about_value =
          code == AbortCode::value_invalid || code == AbortCode::value_too_high || code == AbortCode::value_too_low;
      trial.expect(about_value, sent, "if it is refused, with 0609 0030h to 0032h", refusal->text);
    }
  }
}

void changes_while_enabled(Trial& trial, int) {
  const std::uint32_t modes = supported(trial);
  if ((modes & 1) == 0 || (modes >> 5 & 1) == 0) Trial::skip("it does not have both profile position and homing");
  trial.enable(OperationMode::profile_position);
  trial.set_mode(OperationMode::homing);
  const PowerState seen = trial.state();
  trial.expect(seen == PowerState::operation_enabled, "6060h = 6 in operation enabled", "operation enabled, as before",
               drive::name(seen));
  trial.set_mode(OperationMode::profile_position);
}

constexpr std::array rows{
    Check{"mode.supported", "CiA 402-2, objects 6060h, 6061h, 6502h", "Each supported mode is accepted and displayed",
          Demand::nothing, buses::all, supported_taken},
    Check{"mode.unsupported", "CiA 402-2, objects 6060h, 6061h, 6502h", "An unsupported mode is not accepted",
          Demand::nothing, buses::all, unsupported_refused},
    Check{"mode.change-while-enabled", "CiA 402-2, object 6060h", "The mode changes without leaving operation enabled",
          Demand::enable, buses::all, changes_while_enabled},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::mode_group
