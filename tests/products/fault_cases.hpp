#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "rig.hpp"

// A fault from its cause to its reset, with the same checks for every row of a product's table: EMCY frame, error
// register, history, error code, statusword, reaction by 605Eh, reset rule.
namespace servodrome::test {

enum class Cut : std::uint8_t {
  by_option_code,  // 605Eh
  at_once,         // the motor can no longer be controlled
};

enum class Gone : std::uint8_t {
  with_reaction,  // the cause ends when the axis is at rest and without power
  when_removed,   // `remove` ends the cause
};

enum class Reset : std::uint8_t { by_controlword, by_power_cycle };

template <typename DeviceType>
struct FaultCase {
  using Action = std::function<void(Rig<DeviceType>&)>;

  std::uint16_t code;
  Action prepare;  // leaves the drive in Operation enabled, in motion if the cause can occur in motion
  Action raise;
  Action remove{};  // none: no action is necessary
  Gone gone = Gone::with_reaction;
  Cut cut = Cut::by_option_code;
  Reset reset = Reset::by_controlword;
  double within_ms = 200.0;
  const char* variant = "";
  double comparator_a = 20.0;  // phase current at which the power stage's comparators respond
  std::int32_t encoder_counts = 131072;
};

// The EMCY frames since the record was cleared, as text.
template <typename DeviceType>
std::vector<std::string> emergencies(const Rig<DeviceType>& rig, std::uint8_t node_id) {
  std::vector<std::string> found;
  for (const canopen::Frame& frame : rig.sent) {
    if (frame.id != 0x80U + node_id) continue;
    std::string text;
    char buffer[4];
    for (std::uint8_t i = 0; i < frame.length; ++i) {
      std::snprintf(buffer, sizeof buffer, "%02X ", static_cast<unsigned>(frame.data[i]));
      text += buffer;
    }
    found.push_back(text);
  }
  return found;
}

inline std::string emergency_text(std::uint16_t code, std::uint8_t error_register) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%02X %02X %02X 00 00 00 00 00 ", code & 0xFFU, code >> 8U,
                static_cast<unsigned>(error_register));
  return buffer;
}

constexpr std::uint16_t state_mask = 0x4F;
constexpr std::uint16_t fault_reaction = 0x0F;
constexpr std::uint16_t in_fault = 0x08;
constexpr std::uint16_t disabled = 0x40;

// One fault from cause to reset. `option_code` is 605Eh.
template <typename DeviceType>
void check_fault(const FaultCase<DeviceType>& fault, std::uint8_t error_register, std::int16_t option_code) {
  SCOPED_TRACE("605Eh = " + std::to_string(option_code) + " " + fault.variant);
  plant::Parameters parameters = default_plant();
  parameters.supply.overcurrent_a = fault.comparator_a;
  parameters.encoder.counts_per_revolution = fault.encoder_counts;
  Rig<DeviceType> rig(parameters);
  const std::uint8_t node_id = rig.device.node_id();
  auto& drive = rig.device.drive();
  const auto state = [&] { return rig.status() & state_mask; };
  rig.set(0x605E, 0, option_code);
  fault.prepare(rig);
  ASSERT_EQ(drive.state(), drive::PowerState::operation_enabled) << "not prepared";
  rig.sent.clear();

  fault.raise(rig);
  ASSERT_GE(rig.run_until([&] { return state() == fault_reaction || state() == in_fault; }, fault.within_ms), 0)
      << "not raised";
  const double velocity = drive.axis().generator.velocity();
  const double deceleration = static_cast<double>(rig.get(option_code == 1 ? 0x6084 : 0x6085));
  // A ramp ends when the demand stands, a stop at the current limit when the shaft stands; a ramp without a slope is
  // limited only by the current.
  const bool at_current_limit = option_code == 3 || deceleration == 0.0;
  const bool moving = std::abs(at_current_limit ? drive.axis().velocity() : velocity) > 20000.0;
  const bool ramps = option_code != 0 && fault.cut == Cut::by_option_code && moving;
  if (ramps) {
    EXPECT_EQ(state(), fault_reaction);
    EXPECT_TRUE(rig.actuation.pwm_enabled);
    const std::int64_t begin = rig.ticks();
    ASSERT_GE(rig.run_until([&] { return state() != fault_reaction || !rig.actuation.pwm_enabled; }, 5000.0), 0);
    if (!at_current_limit) {
      const bool jerk_limited = option_code == 1 && rig.get(0x6086) == 3 && rig.get(0x6061) == 1;
      const double rounding = jerk_limited ? deceleration / static_cast<double>(rig.get(0x60A4, 1)) : 0.0;
      EXPECT_NEAR(static_cast<double>(rig.ticks() - begin) / 16000.0, std::abs(velocity) / deceleration + rounding,
                  0.002);
    }
    EXPECT_FALSE(drive.in_motion());
  } else {
    rig.run_ms(1);  // the cycle in which the power stage is switched off
  }
  rig.run_ms(1);
  EXPECT_EQ(state(), in_fault);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_FALSE(rig.actuation.short_circuit);
  EXPECT_FALSE(rig.actuation.brake_released);

  const std::vector<std::string> raised = emergencies(rig, node_id);
  ASSERT_FALSE(raised.empty());
  EXPECT_EQ(raised.front(), emergency_text(fault.code, error_register));
  EXPECT_EQ(raised.size(), 1U) << raised.back();
  EXPECT_EQ(rig.get(0x1001), error_register);
  EXPECT_EQ(rig.get(0x1003, 0), 1);
  EXPECT_EQ(rig.get(0x1003, 1) & 0xFFFF, fault.code);
  EXPECT_EQ(rig.get(0x603F), fault.code);

  const auto edge = [&rig] {
    rig.control(0x00);
    rig.run_ms(1);
    rig.control(0x80);
    rig.run_ms(1);
  };
  rig.sent.clear();
  if (fault.gone == Gone::when_removed) {
    edge();
    EXPECT_EQ(state(), in_fault) << "reset with the cause present";
    EXPECT_EQ(rig.get(0x603F), fault.code);
    if (fault.remove) fault.remove(rig);
    rig.run_ms(20);
    EXPECT_EQ(state(), in_fault) << "the level of bit 7 is no edge";
  } else {
    if (fault.remove) fault.remove(rig);
    rig.run_ms(20);
    EXPECT_EQ(state(), in_fault);
  }
  EXPECT_TRUE(emergencies(rig, node_id).empty());
  edge();
  if (fault.reset == Reset::by_controlword) {
    EXPECT_EQ(state(), disabled);
    EXPECT_EQ(emergencies(rig, node_id), std::vector<std::string>{emergency_text(0, 0)});
    EXPECT_EQ(rig.get(0x1003, 0), 1) << "the history stays";
  } else {
    EXPECT_EQ(state(), in_fault) << "only a restart resets it";
    EXPECT_TRUE(emergencies(rig, node_id).empty());
    rig.control(0);
    rig.plant.sample(rig.feedback);
    rig.device.power_off();
    rig.device.power_on(rig.feedback, rig.now());
    rig.drain();
    rig.run_ms(1);
    EXPECT_EQ(state(), disabled);
    EXPECT_TRUE(emergencies(rig, node_id).empty());
  }
  EXPECT_EQ(rig.get(0x1001), 0);
  EXPECT_EQ(rig.get(0x603F), 0);
}

}  // namespace servodrome::test
