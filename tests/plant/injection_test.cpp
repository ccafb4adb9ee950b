#include <gtest/gtest.h>

#include "plant/rig.hpp"

namespace servodrome::plant::test {
namespace injection_test {
namespace {

TEST(Injection, NamesGoBothWays) {
  for (const InjectionName& entry : injection_names) {
    EXPECT_EQ(injection_from_name(entry.name), entry.injection);
    EXPECT_EQ(name_of(entry.injection), entry.name);
  }
  EXPECT_EQ(injection_from_name("encoder"), std::nullopt);
  EXPECT_EQ(injection_from_name(""), std::nullopt);
}

struct BitCase {
  Injection injection;
  drive::EncoderFault encoder;
  drive::HardwareFault hardware;
};

TEST(Injection, BitsComeAndGo) {
  using drive::EncoderFault;
  using drive::HardwareFault;
  Rig rig(bare_motor());
  for (const BitCase& one : {
           BitCase{Injection::encoder_loss, EncoderFault::connection_lost, HardwareFault::none},
           BitCase{Injection::encoder_crc, EncoderFault::crc, HardwareFault::none},
           BitCase{Injection::encoder_delimiter, EncoderFault::delimiter, HardwareFault::none},
           BitCase{Injection::encoder_multi_turn, EncoderFault::multi_turn, HardwareFault::none},
           BitCase{Injection::encoder_count, EncoderFault::count, HardwareFault::none},
           BitCase{Injection::encoder_overflow, EncoderFault::count_overflow, HardwareFault::none},
           BitCase{Injection::hall_wiring, EncoderFault::hall_wiring, HardwareFault::none},
           BitCase{Injection::hall_state, EncoderFault::hall_state, HardwareFault::none},
           BitCase{Injection::bus_overcurrent, EncoderFault::none, HardwareFault::bus_overcurrent},
           BitCase{Injection::short_circuit, EncoderFault::none, HardwareFault::short_circuit},
           BitCase{Injection::gate_supply_low, EncoderFault::none, HardwareFault::gate_supply_low},
           BitCase{Injection::internal, EncoderFault::none, HardwareFault::internal},
       }) {
    rig.plant.inject(one.injection, true);
    EXPECT_TRUE(rig.plant.injected(one.injection));
    rig.step();
    EXPECT_EQ(rig.feedback.encoder_faults, static_cast<std::uint32_t>(one.encoder));
    EXPECT_EQ(rig.feedback.hardware_faults, static_cast<std::uint32_t>(one.hardware));
    rig.plant.inject(one.injection, false);
    rig.step();
    EXPECT_EQ(rig.feedback.encoder_faults, 0u);
    EXPECT_EQ(rig.feedback.hardware_faults, 0u);
  }
}

TEST(Injection, SensorsReadWhatIsInjected) {
  Rig rig(bare_motor());
  rig.plant.inject(Injection::winding_overheat, true);
  rig.plant.inject(Injection::stage_overheat, true);
  rig.plant.inject(Injection::encoder_overheat, true);
  rig.plant.inject(Injection::ambient_hot, true);
  rig.run(200);
  EXPECT_EQ(rig.feedback.winding_temperature_c, 180.0F);
  EXPECT_EQ(rig.feedback.power_stage_temperature_c, 120.0F);
  EXPECT_EQ(rig.feedback.encoder_temperature_c, 120.0F);
  EXPECT_EQ(rig.feedback.ambient_temperature_c, 90.0F);
  EXPECT_NEAR(rig.plant.winding_temperature_c(), 25.0, 0.1);  // the true temperature
  rig.plant.inject(Injection::ambient_hot, false);
  rig.plant.inject(Injection::ambient_cold, true);
  rig.plant.inject(Injection::winding_overheat, false);
  rig.step();
  EXPECT_EQ(rig.feedback.ambient_temperature_c, -40.0F);
  EXPECT_NEAR(rig.feedback.winding_temperature_c, 25.0F, 0.1F);
}

TEST(Injection, LostEncoderFreezesWhatTheDriveSees) {
  Parameters p = bare_motor();
  p.encoder.start_position_counts = -5;
  Rig rig(p);
  rig.spin_up(-600.0);
  rig.run(10);
  rig.plant.inject(Injection::encoder_loss, true);
  const std::int64_t seen = rig.feedback.position_counts;
  const std::uint32_t turn = rig.feedback.single_turn_counts;
  rig.run(500);
  EXPECT_EQ(rig.feedback.position_counts, seen);
  EXPECT_EQ(rig.feedback.single_turn_counts, turn);
  EXPECT_LT(rig.plant.position_counts(), seen - 1000);
  rig.plant.inject(Injection::encoder_loss, false);
  rig.step();
  EXPECT_EQ(rig.feedback.position_counts, rig.plant.position_counts());
}

TEST(Validate, NamesTheParameter) {
  EXPECT_TRUE(validate(Parameters{}).empty());
  const auto complaint = [](auto change) {
    Parameters p;
    change(p);
    const auto messages = validate(p);
    return messages.size() == 1 ? messages.front().substr(0, messages.front().find(':')) : std::string("?");
  };
  EXPECT_EQ(complaint([](Parameters& p) { p.motor.pole_pairs = 0; }), "motor.pole_pairs");
  EXPECT_EQ(complaint([](Parameters& p) { p.motor.phases = 4; }), "motor.phases");
  EXPECT_EQ(complaint([](Parameters& p) { p.motor.phases = 1; }), "motor.phases");
  EXPECT_EQ(complaint([](Parameters& p) { p.motor.resistance_ohm = std::nan(""); }), "motor.resistance_ohm");
  EXPECT_EQ(complaint([](Parameters& p) { p.motor.cogging_torque_nm = 500.0; }), "motor.cogging_torque_nm");
  EXPECT_EQ(complaint([](Parameters& p) { p.load.static_friction_nm = 0.001; }), "load.static_friction_nm");
  EXPECT_EQ(complaint([](Parameters& p) { p.load.low_stop_counts = 1; }), "encoder.start_position_counts");
  EXPECT_EQ(complaint([](Parameters& p) {
              p.load.low_stop_counts = 0;
              p.load.high_stop_counts = 1;
            }),
            "load.high_stop_counts");
  EXPECT_EQ(complaint([](Parameters& p) { p.encoder.counts_per_revolution = (1 << 24) + 1; }),
            "encoder.counts_per_revolution");
  EXPECT_EQ(complaint([](Parameters& p) { p.encoder.direction = 0; }), "encoder.direction");
  EXPECT_EQ(complaint([](Parameters& p) { p.encoder.commutation_offset_turns = 1.0; }),
            "encoder.commutation_offset_turns");
  EXPECT_EQ(complaint([](Parameters& p) { p.switch_count = 9; }), "switch_count");
  EXPECT_EQ(complaint([](Parameters& p) { p.switch_count = 2; }), "switches[1].wire");
  EXPECT_EQ(complaint([](Parameters& p) {
              p.switch_count = 1;
              p.switches[0].from_counts = 10;
              p.switches[0].to_counts = 9;
            }),
            "switches[0].to_counts");
  Parameters p;
  p.motor.pole_pairs = 0;
  EXPECT_THROW(Plant{p}, std::invalid_argument);
  Plant plant{Parameters{}};
  EXPECT_THROW(plant.set_load_inertia_kgm2(-1.0), std::invalid_argument);
  EXPECT_THROW(plant.set_supply_v(std::nan("")), std::invalid_argument);
  EXPECT_THROW(plant.set_external_torque_nm(1.0e6), std::invalid_argument);
}

}  // namespace
}  // namespace injection_test
}  // namespace servodrome::plant::test
