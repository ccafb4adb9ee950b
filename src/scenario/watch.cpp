#include "scenario/watch.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "canopen/node.hpp"
#include "drive/drive.hpp"
#include "ethercat/slave/slave.hpp"

namespace servodrome::scenario {

double revolutions(const line::Axis& axis) {
  const plant::Plant& plant = axis.plant();
  return (static_cast<double>(plant.position_counts()) + plant.position_fraction()) /
         plant.parameters().encoder.counts_per_revolution;
}

bool needs_axis(const Condition& c) {
  return c.state || c.nmt || c.al || c.mode || c.homing_leg || c.at_rest || c.position_above || c.position_below ||
         c.speed_above || c.speed_below || c.moved_above || c.travelled_above || c.torque_above || c.object ||
         c.powered || c.fault_resets_above || c.repeats_above || c.set_point_jumped;
}

void Watch::begin() {
  messages_ = 0;
  if (axis_ != nullptr) start_revolutions_ = revolutions(*axis_);
}

void Watch::notice(std::span<const Message> parts) {
  if (!condition_->message || messages_ >= condition_->count) return;
  const auto fits = [this](const Message& part) { return matches(*condition_->message, part); };
  if (std::any_of(parts.begin(), parts.end(), fits)) ++messages_;
}

bool Watch::holds(Time now, const Facts& facts) const {
  const Condition& c = *condition_;
  if (c.time && now < *c.time) return false;
  if (!c.after.empty()) {
    const auto first = facts.first_acts.find(c.after);
    if (first == facts.first_acts.end() || !first->second || now < *first->second + c.after_delay) return false;
  }
  if (c.message && messages_ < c.count) return false;
  if (!master_fits(now, facts)) return false;
  if (!needs_axis(c)) return true;
  if (c.travelled_above && !has_travelled(facts)) return false;
  if (!deeds_fit(facts)) return false;
  return (!c.powered || *c.powered == axis_->powered()) && shaft_fits() && drive_fits() && bus_fits();
}

bool Watch::has_travelled(const Facts& facts) const {
  const auto travelled = facts.travelled.find(axis_);
  return travelled != facts.travelled.end() && travelled->second > *condition_->travelled_above;
}

bool Watch::master_fits(Time now, const Facts& facts) const {
  const Condition& c = *condition_;
  if (c.ended && (!facts.master_ended || now < *facts.master_ended + *c.ended)) return false;
  return !c.success || (facts.master_ended && facts.master_succeeded == *c.success);
}

bool Watch::deeds_fit(const Facts& facts) const {
  const Condition& c = *condition_;
  if (!c.fault_resets_above && !c.repeats_above && !c.set_point_jumped) return true;
  const MasterDeeds& deeds = facts.master->of(axis_);
  if (c.fault_resets_above && deeds.fault_resets.count() <= *c.fault_resets_above) return false;
  if (c.repeats_above && deeds.repeats.count() <= *c.repeats_above) return false;
  return !c.set_point_jumped || deeds.jumped == *c.set_point_jumped;
}

bool Watch::shaft_fits() const {
  const Condition& c = *condition_;
  const plant::Plant& plant = axis_->plant();
  const double speed = std::abs(plant.velocity_rpm());
  const double position = revolutions(*axis_);
  if (c.at_rest && *c.at_rest != (speed < Condition::rest_rpm)) return false;
  if (c.position_above && position <= *c.position_above) return false;
  if (c.position_below && position >= *c.position_below) return false;
  if (c.speed_above && speed <= *c.speed_above) return false;
  if (c.speed_below && speed >= *c.speed_below) return false;
  if (c.moved_above && std::abs(position - start_revolutions_) <= *c.moved_above) return false;
  return !c.torque_above || std::abs(plant.torque_nm()) > *c.torque_above * plant.parameters().motor.rated_torque_nm;
}

// Returns false for a drive without power: it has no state, and its objects cannot be read.
bool Watch::drive_fits() const {
  const Condition& c = *condition_;
  if (!c.state && !c.mode && !c.homing_leg && !c.object) return true;
  if (!axis_->powered()) return false;
  drive::Drive& drive = axis_->device().drive();
  if (c.state && drive.state() != *c.state) return false;
  if (c.mode && static_cast<int>(drive.mode()) != *c.mode) return false;
  if (c.homing_leg && drive.homing_leg() != static_cast<int>(*c.homing_leg)) return false;
  if (!c.object) return true;
  const std::int64_t value = axis_->device().dictionary().number(c.object->index, c.object->sub.value_or(0));
  return (value & c.mask) == (c.value & c.mask);
}

bool Watch::bus_fits() const {
  const Condition& c = *condition_;
  if (!c.nmt && !c.al) return true;
  if (!axis_->powered()) return false;
  products::Device& device = axis_->device();
  if (c.nmt && (device.can_node() == nullptr || device.can_node()->nmt_state() != *c.nmt)) return false;
  return !c.al || (device.ethercat_slave() != nullptr && device.ethercat_slave()->state() == *c.al);
}

std::string Watch::present(const Facts& facts) const {
  const Condition& c = *condition_;
  std::string text;
  const auto say = [&text](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  if (c.message) say(fmt::format("{} of {} messages", messages_, c.count));
  if (axis_ == nullptr) return text;
  const MasterDeeds& deeds = facts.master->of(axis_);
  if (c.fault_resets_above) say(fmt::format("{} fault resets in a second", deeds.fault_resets.count()));
  if (c.repeats_above) say(fmt::format("{} requests repeated in a second", deeds.repeats.count()));
  if (c.set_point_jumped) {
    say(fmt::format("the first set-point is {:.3f} revolutions from the shaft", deeds.jump_revolutions));
  }
  if (c.state) say(axis_->powered() ? drive::name(axis_->device().drive().state()) : "no power");
  say(fmt::format("{:.1f} rpm at {:.3f} revolutions", axis_->plant().velocity_rpm(), revolutions(*axis_)));
  if (c.object && axis_->powered()) {
    const auto sub = c.object->sub.value_or(0);
    say(fmt::format("{:04X}h:{:02X} = {}", c.object->index, sub,
                    axis_->device().dictionary().number(c.object->index, sub)));
  }
  return text;
}

}  // namespace servodrome::scenario
