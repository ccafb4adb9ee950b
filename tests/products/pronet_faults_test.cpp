#include <set>

#include "csv.hpp"
#include "fault_cases.hpp"
#include "products/pronet/pronet.hpp"

// Every alarm of the ProNet manual (tests/data/pronet_alarms.csv), raised by its cause, or by injection if only
// hardware can cause it.
namespace servodrome {
namespace pronet_faults_test {
namespace {

using drive::Cause;
using plant::Injection;
using products::Pronet;
using test::Cut;
using test::Gone;
using test::Reset;
using Axis = test::Rig<Pronet>;
using Case = test::FaultCase<Pronet>;
using Action = Case::Action;

constexpr std::int64_t speed = 3000;  // 0.1 rpm

void must_set(Axis& axis, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  EXPECT_EQ(axis.set(index, sub, value), dictionary::AbortCode::none) << std::hex << index << "h:" << int{sub};
}

Action turning_at(std::int64_t velocity) {
  return [velocity](Axis& axis) {
    must_set(axis, 0x6060, 0, 3);
    axis.enable();
    must_set(axis, 0x60FF, 0, velocity);
    axis.run_ms(200);
    EXPECT_NEAR(static_cast<double>(axis.get(0x606C)), static_cast<double>(velocity), 30.0);
  };
}
const Action turning = turning_at(speed);

Action inject(Injection injection, bool on = true) {
  return [=](Axis& axis) { axis.plant.inject(injection, on); };
}

Case injected(std::uint16_t code, Injection injection, std::int32_t encoder_counts = 131072) {
  return {.code = code,
          .prepare = turning,
          .raise = inject(injection),
          .remove = inject(injection, false),
          .gone = Gone::when_removed,
          .cut = Cut::at_once,
          .encoder_counts = encoder_counts};
}

Case shorted(Injection injection) {
  return {.code = 0x2310,
          .prepare = turning,
          .raise = inject(injection),
          .remove = inject(injection, false),
          .cut = Cut::at_once,
          .comparator_a = 5.0};
}

Case hardware_only(std::uint16_t code, Cause cause) {
  return {.code = code,
          .prepare = turning,
          .raise = [cause](Axis& axis) { axis.device.drive().inject(cause, true); },
          .remove = [cause](Axis& axis) { axis.device.drive().inject(cause, false); },
          .gone = Gone::when_removed,
          .cut = Cut::at_once};
}

void supply(Axis& axis, double volts) { axis.plant.set_supply_v(volts); }

void interpolate(Axis& axis) {
  must_set(axis, 0x6060, 0, 7);
  axis.enable();
  axis.control(0x1F);
  for (std::int32_t i = 1; i <= 100; ++i) {
    must_set(axis, 0x60C1, 1, i * 10);
    axis.send(0x080, {});
    axis.run_ms(1);
  }
}

std::vector<Case> cases() {
  return {
      injected(0x2310, Injection::bus_overcurrent),
      injected(0x2310, Injection::short_circuit),
      shorted(Injection::short_phase_u),
      shorted(Injection::short_phase_v),
      shorted(Injection::short_phase_w),
      injected(0x3100, Injection::supply_loss),
      {.code = 0x3110,
       .prepare = turning,
       .raise =
           [](Axis& axis) {
             axis.plant.inject(Injection::chopper_broken, true);
             supply(axis, 450.0);
           },
       .remove =
           [](Axis& axis) {
             axis.plant.inject(Injection::chopper_broken, false);
             supply(axis, 310.0);
           },
       .gone = Gone::when_removed,
       .cut = Cut::at_once},
      {.code = 0x3120,
       .prepare = turning,
       .raise =
           [](Axis& axis) {
             supply(axis, 150.0);
             axis.plant.discharge_dc_link();
           },
       .remove =
           [](Axis& axis) {
             supply(axis, 310.0);
             axis.run_ms(200);
           },
       .gone = Gone::when_removed,
       .cut = Cut::at_once},
      injected(0x5080, Injection::internal),
      hardware_only(0x5210, Cause::current_sensor),
      {.code = 0x5420,  // the supply is so high that the brake resistor is always on
       .prepare = turning,
       .raise = [](Axis& axis) { supply(axis, 390.0); },
       .remove = [](Axis& axis) { supply(axis, 310.0); },
       .gone = Gone::when_removed,
       .cut = Cut::at_once,
       .within_ms = 600.0},
      hardware_only(0x5421, Cause::brake_resistor_short),
      hardware_only(0x5581, Cause::memory),        // and by its cause below
      hardware_only(0x5582, Cause::factor_group),  // and by its cause below
      hardware_only(0x5583, Cause::motor_mismatch),
      hardware_only(0x6100, Cause::unknown_error),
      hardware_only(0x6300, Cause::bus_settings),  // and by its cause below
      injected(0x7303, Injection::encoder_loss),
      injected(0x7303, Injection::encoder_crc),
      injected(0x7303, Injection::encoder_delimiter),
      injected(0x7303, Injection::encoder_multi_turn),
      injected(0x7303, Injection::encoder_count),
      injected(0x7303, Injection::encoder_overflow),
      injected(0x7305, Injection::encoder_loss, 10000),
      injected(0x7305, Injection::hall_wiring, 10000),
      injected(0x7305, Injection::hall_state, 10000),
      injected(0x7380, Injection::encoder_loss, 65536),
      hardware_only(0x8100, Cause::bus_exception),
      {.code = 0x8130,
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x1016, 1, 0x007F0032);  // node 127, 50 ms
             turning(axis);
           },
       .raise = [](Axis& axis) { axis.send(0x77F, {0x05}); },
       .cut = Cut::at_once},
      {.code = 0x8140,
       .prepare = turning,
       .raise = [](Axis& axis) { axis.device.node().bus_state(canopen::BusState::bus_off, axis.now()); },
       .remove = [](Axis& axis) { axis.device.node().bus_state(canopen::BusState::error_active, axis.now()); },
       .cut = Cut::at_once},
      {.code = 0x8311,
       .prepare = turning,
       .raise = [](Axis& axis) { axis.plant.lock_rotor(true); },
       .remove = [](Axis& axis) { axis.plant.lock_rotor(false); },
       .cut = Cut::at_once,
       .within_ms = 4000.0},
      {.code = 0x8480,  // a load that the motor cannot hold within its limits
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x3068, 0, 0);
             must_set(axis, 0x3069, 0, 0);
             must_set(axis, 0x6060, 0, 3);
             axis.enable();
           },
       .raise = [](Axis& axis) { axis.plant.set_external_torque_nm(-1.0); },
       .remove =
           [](Axis& axis) {
             axis.plant.set_external_torque_nm(0.0);
             axis.plant.set_coulomb_friction_nm(5.0);
           },
       .gone = Gone::when_removed,
       .cut = Cut::at_once},
      {.code = 0x8169, .prepare = interpolate, .raise = [](Axis&) {}, .cut = Cut::at_once, .within_ms = 10.0},
  };
}

// --- Warnings (this project's choice): reported and shown, without other effects

struct Warning {
  std::uint16_t code;
  Action prepare;
  Action raise;
  Action remove{};  // none: it ends immediately
};

std::vector<Warning> warnings() {
  const auto hardware = [](std::uint16_t code, Cause cause) {
    return Warning{code, turning, [cause](Axis& axis) { axis.device.drive().inject(cause, true); },
                   [cause](Axis& axis) { axis.device.drive().inject(cause, false); }};
  };
  const auto operational = [](Axis& axis) {
    turning(axis);
    for (std::uint16_t tpdo = 0x1800; tpdo < 0x1804; ++tpdo) must_set(axis, tpdo, 1, 0x80000000 | axis.get(tpdo, 1));
    axis.send(0x000, {0x01, 0x01});
  };
  return {
      hardware(0x6120, Cause::pdo_mapping),
      {0x8110, turning,
       [](Axis& axis) {  // the answers are not read
         const canopen::Frame request{.id = 0x601, .length = 8, .data = {0x40, 0x00, 0x10, 0x00}};
         for (int i = 0; i < 100; ++i) axis.device.receive(request, axis.now());
         axis.drain();
       }},
      hardware(0x8110, Cause::bus_overflow),
      {0x8120, turning, [](Axis& axis) { axis.device.node().bus_state(canopen::BusState::error_passive, axis.now()); },
       [](Axis& axis) { axis.device.node().bus_state(canopen::BusState::error_active, axis.now()); }},
      hardware(0x8120, Cause::bus_passive),
      {0x8200, turning,
       [](Axis& axis) {
         axis.send(0x601, {0x40, 0x00, 0x10, 0x00});
       }},
      {0x8200, turning,
       [](Axis& axis) {
         axis.send(0x000, {0x01, 0x01, 0x00});
       }},
      hardware(0x8200, Cause::frame_length),
      {0x8210, operational,
       [](Axis& axis) {
         axis.send(0x201, {0x0F, 0x00});
       },
       [](Axis& axis) {
         axis.send(0x201, {0x0F, 0x00, 0xB8, 0x0B, 0x00, 0x00});
       }},
      hardware(0x8210, Cause::rpdo_length),
      {0x8681, turning, [](Axis& axis) { axis.plant.force_input(2, true); },
       [](Axis& axis) { axis.plant.force_input(2, false); }},
      {0x8682, turning_at(-speed), [](Axis& axis) { axis.plant.force_input(3, true); },
       [](Axis& axis) { axis.plant.force_input(3, false); }},
  };
}

void check_warning(const Warning& warning, std::uint8_t error_register) {
  Axis axis;
  warning.prepare(axis);
  EXPECT_EQ(axis.status() & 0x00EF, 0x0027);
  axis.sent.clear();
  warning.raise(axis);
  axis.run_ms(2);
  const std::string told = test::emergency_text(warning.code, error_register);
  const std::string over = test::emergency_text(0, 0);
  EXPECT_EQ(axis.status() & 0x006F, 0x0027) << "no fault";
  EXPECT_EQ(axis.get(0x603F), 0);
  EXPECT_EQ(axis.get(0x1003, 0), 1);
  EXPECT_EQ(axis.get(0x1003, 1) & 0xFFFF, warning.code);
  if (!warning.remove) {
    EXPECT_EQ(test::emergencies(axis, 1), (std::vector<std::string>{told, over}));
    EXPECT_EQ(axis.get(0x1001), 0);
    return;
  }
  EXPECT_EQ(test::emergencies(axis, 1), std::vector<std::string>{told});
  EXPECT_EQ(axis.get(0x1001), error_register);
  EXPECT_EQ(axis.status() & 0x80, 0x80);
  axis.run_ms(20);
  axis.sent.clear();
  warning.remove(axis);
  axis.run_ms(2);
  EXPECT_EQ(test::emergencies(axis, 1), std::vector<std::string>{over});
  EXPECT_EQ(axis.get(0x1001), 0);
  EXPECT_EQ(axis.status() & 0x00EF, 0x0027);
}

std::uint8_t recommended_register(const test::CsvRow& row) {
  if (row.at("note").find("as 8681h") != std::string::npos) return 0x21;
  const std::string& note = row.at("note");
  const std::size_t at = note.find("1001h = ");
  EXPECT_NE(at, std::string::npos) << note;
  return static_cast<std::uint8_t>(std::stoul(note.substr(at + 8, 2), nullptr, 16));
}

TEST(PronetFaults, EveryRowOfTheManual) {
  std::set<std::uint16_t> in_manual;
  const std::vector<Case> alarms = cases();
  const std::vector<Warning> told = warnings();
  for (const test::CsvRow& row : test::read_csv("pronet_alarms.csv")) {
    const bool a69 = row.at("code") == "A 69";
    const auto code = static_cast<std::uint16_t>(a69 ? 0x8169 : std::stoul(row.at("emcy_code"), nullptr, 16));
    const bool warning = row.at("severity").find("warning") != std::string::npos;
    const std::uint8_t error_register = recommended_register(row);
    in_manual.insert(code);
    SCOPED_TRACE(row.at("code") + " " + row.at("name"));
    int found = 0;
    for (const Case& alarm : alarms) {
      if (alarm.code != code) continue;
      ++found;
      EXPECT_FALSE(warning);
      test::check_fault(alarm, error_register, 0);  // 605Eh knows 0 only
    }
    for (const Warning& one : told) {
      if (one.code != code) continue;
      ++found;
      EXPECT_TRUE(warning);
      check_warning(one, error_register);
    }
    EXPECT_GT(found, 0) << "no test";
  }
  EXPECT_EQ(in_manual.size(), 29U);
  for (const Case& alarm : alarms) EXPECT_TRUE(in_manual.contains(alarm.code)) << std::hex << alarm.code;
  for (const Warning& one : told) EXPECT_TRUE(in_manual.contains(one.code)) << std::hex << one.code;
  for (const drive::FaultRow& row : Pronet::policy.faults.rows) EXPECT_TRUE(in_manual.contains(row.code)) << row.name;
}

// --- Causes that exist at power-on

class AtPowerOn : public testing::Test {
 protected:
  std::array<std::byte, 16384> memory{};
  dictionary::RamMedium medium{memory};
  Axis axis{test::default_plant(), {.store = &medium}};

  void power_cycle() {
    axis.plant.sample(axis.feedback);
    axis.device.power_off();
    axis.sent.clear();
    axis.device.power_on(axis.feedback, axis.now());
    axis.run_ms(2);
  }
  bool in_fault() { return (axis.status() & 0xCF) == 0x88; }
  void reset() {
    axis.control(0x00);
    axis.run_ms(1);
    axis.control(0x80);
    axis.run_ms(1);
  }
};

TEST_F(AtPowerOn, SpoiltParametersAre5581) {
  axis.set(0x3022, 0, 4711);
  axis.set(0x3022, 0, 4712);
  power_cycle();
  EXPECT_FALSE(in_fault());
  EXPECT_EQ(axis.get(0x3022), 4712);
  for (std::byte& byte : std::span(memory).subspan(40, 100)) byte = ~byte;
  for (std::byte& byte : std::span(memory).subspan(8192 + 40, 100)) byte = ~byte;
  power_cycle();
  EXPECT_TRUE(in_fault());
  EXPECT_EQ(axis.get(0x603F), 0x5581);
  EXPECT_EQ(test::emergencies(axis, 1), std::vector<std::string>{test::emergency_text(0x5581, 0x81)});
  EXPECT_EQ(axis.get(0x3022), 0) << "from the factory";
  reset();
  EXPECT_FALSE(in_fault());
}

TEST_F(AtPowerOn, GearWithoutDivisorIs5582) {
  axis.set(0x2F11, 0, 0);  // Pn202
  power_cycle();
  EXPECT_TRUE(in_fault());
  EXPECT_EQ(axis.get(0x603F), 0x5582);
  EXPECT_EQ(test::emergencies(axis, 1), std::vector<std::string>{test::emergency_text(0x5582, 0x81)});
  reset();
  EXPECT_TRUE(in_fault()) << "it still has none";
  axis.set(0x2F11, 0, 1);
  power_cycle();
  EXPECT_FALSE(in_fault());
}

// Writes cannot cause it; the memory of another firmware can. An address out of range is replaced by the factory value.
TEST_F(AtPowerOn, SettingsOfTheBusThatCannotBeAre6300) {
  const auto keep = [&](std::uint16_t index, std::uint16_t value) {
    dictionary::AbortCode abort{};
    const dictionary::Entry* entry = axis.device.dictionary().find(index, 0, abort);
    std::memcpy(axis.device.dictionary().storage(*entry), &value, sizeof value);
    axis.set(0x3022, 0, 1);  // each write of a parameter stores all of them
  };
  for (const auto& [index, wrong, right] : {std::tuple{0x30FF, 6, 5}, std::tuple{0x30FF, 0x15, 5},
                                            std::tuple{0x3006, 4, 3}, std::tuple{0x3006, 0x3003, 3}}) {
    SCOPED_TRACE(testing::Message() << std::hex << index << " " << wrong);
    keep(static_cast<std::uint16_t>(index), static_cast<std::uint16_t>(wrong));
    power_cycle();
    EXPECT_TRUE(in_fault());
    EXPECT_EQ(axis.get(0x603F), 0x6300);
    EXPECT_EQ(axis.get(0x1001), 0x11);
    EXPECT_TRUE(axis.sent.empty()) << "it says nothing";
    EXPECT_EQ(axis.set(static_cast<std::uint16_t>(index), 0, right), dictionary::AbortCode::none);
    power_cycle();
    EXPECT_FALSE(in_fault());
    EXPECT_FALSE(axis.sent.empty());
  }
  keep(0x3100, 128);
  power_cycle();
  EXPECT_FALSE(in_fault());
  EXPECT_EQ(axis.get(0x3100), 1);
}

// --- RPDOs of a wrong length

// The warning about a short RPDO ends with the next valid one, or after a second, whatever happens to the RPDO.
TEST(PronetFaults, TheWarningOfOneShortRpdoGoes) {
  const auto start = [](Axis& axis) {
    axis.run_ms(1);
    for (std::uint16_t tpdo = 0x1800; tpdo < 0x1804; ++tpdo) must_set(axis, tpdo, 1, 0x80000000 | axis.get(tpdo, 1));
    axis.send(0x000, {0x01, 0x01});
    axis.sent.clear();
    axis.send(0x201, {0x06, 0x00});
    axis.run_ms(10);
    EXPECT_EQ(axis.get(0x1001), 0x11);
    EXPECT_EQ(axis.status() & 0x80, 0x80);
  };
  const std::vector<std::pair<const char*, Action>> meanwhile{
      {"nothing", [](Axis&) {}},
      {"another mapping",
       [](Axis& axis) {
         must_set(axis, 0x1600, 0, 0);
         must_set(axis, 0x1600, 0, 1);
       }},
      {"no such RPDO", [](Axis& axis) { must_set(axis, 0x1400, 1, 0x80000201); }},
      {"NMT stop",
       [](Axis& axis) {
         axis.send(0x000, {0x02, 0x01});
       }},
      {"pre-operational",
       [](Axis& axis) {
         axis.send(0x000, {0x80, 0x01});
       }},
      {"enabled", [](Axis& axis) { EXPECT_TRUE(axis.enable()); }},
  };
  for (const auto& [what, action] : meanwhile) {
    SCOPED_TRACE(what);
    Axis axis;
    start(axis);
    action(axis);
    axis.run_ms(1100);
    EXPECT_EQ(axis.get(0x1001), 0);
    EXPECT_EQ(axis.status() & 0x80, 0);
    axis.send(0x000, {0x01, 0x01});  // NMT stop delayed it until here
    EXPECT_EQ(test::emergencies(axis, 1),
              (std::vector<std::string>{test::emergency_text(0x8210, 0x11), test::emergency_text(0, 0)}));
  }
  Axis axis;
  start(axis);
  axis.sent.clear();
  for (int i = 0; i < 30; ++i) {
    axis.send(0x201, {0x06, 0x00});
    axis.run_ms(100);
    EXPECT_EQ(axis.get(0x1001), 0x11) << "as long as they come";
  }
  EXPECT_TRUE(test::emergencies(axis, 1).empty()) << "told once";
  axis.send(0x000, {0x82, 0x01});
  axis.run_ms(2);
  EXPECT_EQ(axis.get(0x1001), 0);
  EXPECT_EQ(axis.status() & 0x80, 0);
}

// --- Common properties

TEST(PronetFaults, RecordOfTenNewestFirst) {
  Axis axis;
  axis.run_ms(1);
  const auto raise = [&](Cause cause) {
    axis.device.drive().inject(cause, true);
    axis.run_ms(1);
    axis.device.drive().inject(cause, false);
    axis.run_ms(1);
    axis.control(0x00);
    axis.run_ms(1);
    axis.control(0x80);
    axis.run_ms(1);
  };
  for (int i = 0; i < 9; ++i) raise(Cause::current_sensor);
  raise(Cause::interpolation_late);
  raise(Cause::unknown_error);
  EXPECT_EQ(axis.get(0x3200), 0x6100);
  EXPECT_EQ(axis.get(0x3201), 0x69);  // the one panel number that is printed
  EXPECT_EQ(axis.get(0x3202), 0x5210);
  EXPECT_EQ(axis.get(0x3209), 0x5210);
  // 1003h has four entries; writing 0 clears it, other values are refused.
  EXPECT_EQ(axis.get(0x1003, 0), 4);
  EXPECT_EQ(axis.get(0x1003, 1), 0x6100);
  EXPECT_EQ(axis.get(0x1003, 2), 0x8169);
  EXPECT_EQ(axis.get(0x1003, 4), 0x5210);
  EXPECT_EQ(axis.set(0x1003, 0, 1), dictionary::AbortCode::value_invalid);
  EXPECT_EQ(axis.set(0x1003, 0, 0), dictionary::AbortCode::none);
  EXPECT_EQ(axis.get(0x1003, 0), 0);
  EXPECT_EQ(axis.get(0x1003, 1), 0);
}

// Code 0000h is sent only when the last error ends; bit 7 of the statusword is set until then.
TEST(PronetFaults, TheEndIsToldWhenNothingIsLeft) {
  Axis axis;
  turning(axis);
  axis.plant.force_input(2, true);
  axis.run_ms(20);
  axis.device.drive().inject(Cause::current_sensor, true);
  axis.run_ms(2);
  EXPECT_EQ(axis.status() & 0xCF, 0x88);
  EXPECT_EQ(axis.get(0x1001), 0x21);
  axis.device.drive().inject(Cause::current_sensor, false);
  axis.sent.clear();
  axis.control(0x00);
  axis.run_ms(1);
  axis.control(0x80);
  axis.run_ms(2);
  EXPECT_EQ(axis.status() & 0xCF, 0xC0);
  EXPECT_TRUE(test::emergencies(axis, 1).empty());
  EXPECT_EQ(axis.get(0x1001), 0x21) << "of the limit switch";
  axis.plant.force_input(2, false);
  axis.run_ms(2);
  EXPECT_EQ(axis.status() & 0xCF, 0x40);
  EXPECT_EQ(test::emergencies(axis, 1), std::vector<std::string>{test::emergency_text(0, 0)});
  EXPECT_EQ(axis.get(0x1001), 0);
}

// 1029h:01 selects the NMT state after an error (appendix).
TEST(PronetFaults, LostHeartbeatLeavesOperationalUnless1029SaysOtherwise) {
  using canopen::NmtState;
  for (const auto& [behaviour, state] : {std::pair{0, NmtState::pre_operational}, std::pair{1, NmtState::operational},
                                         std::pair{2, NmtState::stopped}}) {
    Axis axis;
    axis.run_ms(1);
    must_set(axis, 0x1029, 1, behaviour);
    must_set(axis, 0x1016, 1, 0x007F0032);
    axis.send(0x000, {0x01, 0x00});
    axis.send(0x77F, {0x05});
    axis.run_ms(60);
    EXPECT_EQ(axis.device.node().nmt_state(), state);
    EXPECT_EQ(axis.status() & 0x4F, 0x08) << "an alarm, though the axis was not enabled";
  }
}

}  // namespace
}  // namespace pronet_faults_test
}  // namespace servodrome
