#include "drive/io/output_functions.hpp"

#include "drive/drive.hpp"

namespace servodrome::drive {

namespace {

bool index_passed(const Axis& axis) {
  return axis.active(Signal::index) || std::any_of(axis.edges.begin(), axis.edges.end(),
                                                   [](const SignalEdge& edge) { return edge.signal == Signal::index; });
}

}  // namespace

std::uint32_t OutputConditions::update(const Drive& drive, const Settings& settings) {
  const Axis& axis = drive.axis();
  const bool fault = drive.state() == PowerState::fault || drive.state() == PowerState::fault_reaction_active;
  const bool enabled = drive.state() == PowerState::operation_enabled;
  const bool target_reached = enabled && (axis.objects.statusword & statusword::target_reached) != 0;
  const Loop loop = axis.demand.loop;
  const bool torque =
      settings.torque_current_a > 0.0F && std::abs(drive.loops().current_q_a) >= settings.torque_current_a;
  const bool zero_speed = axis.lasts(std::abs(axis.counts_per_ms) <= settings.zero_speed_counts_per_ms, zero_speed_,
                                     settings.zero_speed_ms);
  const bool torque_reached = axis.lasts(torque, torque_, settings.torque_ms);

  std::uint32_t conditions = 0;
  const auto set = [&conditions](OutputCondition condition, bool holds) {
    if (holds) conditions |= bit(condition);
  };
  set(OutputCondition::ready, !fault && drive.state() != PowerState::not_ready_to_switch_on);
  set(OutputCondition::error, fault);
  set(OutputCondition::position_reached, target_reached && loop == Loop::position && drive.mode() != Mode::homing);
  set(OutputCondition::zero_speed, zero_speed);
  set(OutputCondition::brake_released, drive.brake_released());
  set(OutputCondition::speed_reached, target_reached && loop == Loop::velocity);
  set(OutputCondition::index, index_passed(axis));
  set(OutputCondition::speed_limit, enabled && loop == Loop::torque && drive.loops().velocity_limited);
  set(OutputCondition::enabled, drive.energised());
  set(OutputCondition::position_limit, axis.at_position_limit());
  set(OutputCondition::home_found, drive.homed());
  set(OutputCondition::torque_reached, torque_reached);
  if (settings.reached_index) {
    conditions |= std::uint32_t{*settings.reached_index} << static_cast<unsigned>(OutputCondition::reached_index_0);
  }
  return conditions;  // without safe_torque_off, because no drive here has that input
}

}  // namespace servodrome::drive
