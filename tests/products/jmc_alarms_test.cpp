#include <gtest/gtest.h>
#include <map>
#include <regex>
#include <set>

#include "csv.hpp"
#include "dictionary/failing_medium.hpp"
#include "jmc_bus.hpp"

// Every alarm of the JMC manual (tests/data/jmc_alarms.csv), raised by its cause in drive, plant or bus, or by
// injection if there is none. A row without a case fails the test.
namespace servodrome {
namespace jmc_alarms_test {
namespace {

using dictionary::AbortCode;
using drive::Cause;
using drive::PowerState;
using ethercat::AlStatusCode;
using plant::Injection;
using test::Bytes;
using test::JmcBus;
namespace cause = products::jmc_ec::cause;

using Action = std::function<void(JmcBus&)>;

enum class Cut : std::uint8_t {
  by_option_code,  // 605Eh
  at_once,
};
enum class Reset : std::uint8_t { by_controlword, by_power_cycle };
enum class Gone : std::uint8_t { with_reaction, when_removed };

struct Case {
  std::string alarm;  // the column "code"
  std::uint16_t code = 0;
  std::uint8_t error_register = 0;
  Action prepare;  // in Operational with the mailbox in use; the motor is enabled, unless `disabled`
  Action raise;
  Action remove = [](JmcBus&) {};
  Gone gone = Gone::with_reaction;
  Cut cut = Cut::by_option_code;
  Reset reset = Reset::by_controlword;
  double within_ms = 200.0;
  const char* variant = "";
  bool disabled = false;
};

void set(JmcBus& rig, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  ASSERT_EQ(rig.set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub} << " = " << value;
}

// --- The state of the axis when the alarm occurs

void turn(JmcBus& rig, double rpm) {
  set(rig, 0x6060, 0, 3);
  set(rig, 0x60FF, 0, std::lround(rpm / 60.0 * 4000.0));
  ASSERT_TRUE(rig.enable());
  rig.run_ms(400);
  ASSERT_NEAR(rig.plant.velocity_rpm(), rpm, 8.0);
}
void turning(JmcBus& rig) { turn(rig, 300.0); }
void turning_under_load(JmcBus& rig) {
  turning(rig);
  rig.plant.set_external_torque_nm(0.25);
  rig.run_ms(100);
}
Action in_mode(std::int8_t mode) {
  return [mode](JmcBus& rig) {
    set(rig, 0x6060, 0, mode);
    ASSERT_TRUE(rig.enable());
    rig.run_ms(200);
  };
}
void pressing(JmcBus& rig) {  // full torque allowed, against a locked rotor
  rig.plant.lock_rotor(true);
  set(rig, 0x6072, 0, 3000);
  set(rig, 0x6073, 0, 3000);
  in_mode(10)(rig);
}

// --- The cause of the alarm

bool wrong(JmcBus& rig) {
  const PowerState state = rig.device.drive().state();
  return state == PowerState::fault || state == PowerState::fault_reaction_active;
}

Action inject(Injection injection, bool present = true) {
  return [=](JmcBus& rig) { rig.plant.inject(injection, present); };
}
Action lock(bool locked) {
  return [locked](JmcBus& rig) { rig.plant.lock_rotor(locked); };
}
Action write(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  return [=](JmcBus& rig) { set(rig, index, sub, value); };
}
Action supply(double volts) {
  return [volts](JmcBus& rig) { rig.plant.set_supply_v(volts); };
}

Case of_plant(const char* alarm, std::uint16_t code, std::uint8_t error_register, Injection injection, Cut cut,
              Reset reset, const char* variant = "") {
  return {alarm, code,  error_register, turning, inject(injection), inject(injection, false), Gone::when_removed,
          cut,   reset, 200.0,          variant};
}
// By injection. README.md says which of these alarms can have another cause.
Case injected_only(const char* alarm, std::uint16_t code, std::uint8_t error_register, Cause cause, Cut cut,
                   Reset reset) {
  return {alarm,
          code,
          error_register,
          turning,
          [cause](JmcBus& rig) { rig.device.drive().inject(cause, true); },
          [cause](JmcBus& rig) { rig.device.drive().inject(cause, false); },
          Gone::when_removed,
          cut,
          reset};
}

std::vector<Case> drive_cases() {
  const auto option = Cut::by_option_code;
  const auto at_once = Cut::at_once;
  const auto word = Reset::by_controlword;
  const auto power = Reset::by_power_cycle;
  return {
      injected_only("AL.051", 0x5003, 0xC0, Cause::memory, option, power),
      injected_only("AL.052", 0xA052, 0x01, cause::programmable_logic, at_once, power),
      injected_only("AL.053", 0xA053, 0x01, cause::initialisation, at_once, power),
      of_plant("AL.054", 0xA054, 0x01, Injection::internal, at_once, power),
      {"AL.060", 0xA060, 0x01, turning, write(0x6075, 0, 60000), write(0x6075, 0, 6000), Gone::when_removed, at_once},
      injected_only("AL.061", 0xA061, 0x01, cause::product_mismatch, at_once, power),
      injected_only("AL.062", 0x5003, 0xC0, cause::parameter_storage, option, power),
      of_plant("AL.063", 0x5001, 0x02, Injection::short_circuit, at_once, power),
      of_plant("AL.063", 0x5001, 0x02, Injection::bus_overcurrent, at_once, power, "DC link"),
      injected_only("AL.064", 0xA064, 0x01, cause::self_test, at_once, power),
      of_plant("AL.066", 0x5002, 0x05, Injection::gate_supply_low, at_once, power),
      injected_only("AL.070", 0xA070, 0x02, Cause::current_saturation, at_once, power),
      injected_only("AL.071", 0xA071, 0x02, Cause::current_sensor, at_once, power),
      {"AL.100", 0xA100, 0x01,
       [](JmcBus& rig) {
         set(rig, 0x607D, 1, 100);
         set(rig, 0x607D, 2, 50);
         in_mode(1)(rig);
       },
       [](JmcBus& rig) { rig.control(0x1F); }, write(0x607D, 2, 500)},
      injected_only("AL.101", 0xA101, 0x01, cause::analogue_setting, option, word),
      injected_only("AL.102", 0xA102, 0x01, cause::input_allocation, option, power),
      injected_only("AL.103", 0xA103, 0x01, cause::output_allocation, option, power),
      {.alarm = "AL.105",
       .code = 0xA105,
       .error_register = 0x01,
       .prepare = [](JmcBus&) {},
       .raise = write(0x6091, 1, 1001),
       .remove = write(0x6091, 1, 1),
       .gone = Gone::when_removed,
       .disabled = true},
      injected_only("AL.106", 0xA106, 0x01, cause::divider, option, word),
      {.alarm = "AL.110",  // enabled while a parameter waits for power-on
       .code = 0xA110,
       .error_register = 0x01,
       .prepare = [](JmcBus& rig) { rig.run_ms(1); },
       .raise =
           [](JmcBus& rig) {
             ASSERT_EQ(rig.set_panel(3, 9, 5000), AbortCode::none);
             rig.enable();
           },
       .reset = Reset::by_power_cycle,
       .disabled = true},
      injected_only("AL.120", 0xA120, 0x01, cause::servo_on_invalid, option, power),
      {"AL.401", 0x3220, 0x04, turning,
       [](JmcBus& rig) {
         rig.plant.inject(Injection::supply_loss, true);
         rig.plant.discharge_dc_link();
       },
       [](JmcBus& rig) {
         rig.plant.inject(Injection::supply_loss, false);
         rig.run_ms(500);
       },
       Gone::when_removed, at_once},
      {"AL.402", 0x5004, 0x04, turning, supply(50.0), supply(36.0), Gone::when_removed, option, power},
      {"AL.410", 0x7121, 0x02, turning, lock(true), lock(false), Gone::with_reaction, option, word, 1500.0},
      {"AL.412", 0x2310, 0x02, pressing, write(0x6071, 0, 2000), [](JmcBus& rig) { rig.run_ms(4000); },
       Gone::with_reaction, option, word, 12000.0},
      {"AL.420", 0xA420, 0x01,
       [](JmcBus& rig) {
         ASSERT_EQ(rig.set_panel(4, 5, 400), AbortCode::none);  // P04-05
         set(rig, 0x6065, 0, 0xFFFFFFFF);
         turning(rig);
       },
       [](JmcBus& rig) {
         set(rig, 0x6072, 0, 100);
         rig.plant.set_external_torque_nm(-0.3);
         rig.run_until([&] { return wrong(rig); }, 1000.0);
         rig.plant.set_external_torque_nm(0.0);
       },
       lock(true), Gone::with_reaction, option, word, 1.0, "driven"},
      {"AL.420", 0xA420, 0x01,
       [](JmcBus& rig) {
         set(rig, 0x6080, 0, 400);
         in_mode(9)(rig);
       },
       write(0x60FF, 0, 30000), write(0x60FF, 0, 0), Gone::with_reaction, option, word, 10.0, "set-point"},
      injected_only("AL.421", 0xA421, 0x01, cause::loss_of_control, at_once, word),
      injected_only("AL.422", 0xA422, 0x01, cause::runaway, at_once, word),
      injected_only("AL.425", 0xA425, 0x01, cause::analogue_over_voltage, option, word),
      injected_only("AL.435", 0xA435, 0x01, cause::inrush_resistor, option, word),
      injected_only("AL.436", 0xA436, 0x01, Cause::brake_resistor, option, word),
      of_plant("AL.440", 0x4210, 0x08, Injection::stage_overheat, option, word),
      of_plant("AL.441", 0x4310, 0x08, Injection::winding_overheat, option, word),
      injected_only("AL.500", 0xA500, 0x01, cause::divider_over_speed, option, word),
      {"AL.501", 0x5006, 0x80,
       [](JmcBus& rig) {
         set(rig, 0x6065, 0, 1000);
         set(rig, 0x607A, 0, 400000);
         in_mode(1)(rig);
         rig.control(0x1F);
         rig.run_ms(300);
       },
       lock(true), lock(false), Gone::with_reaction, option, word, 1000.0},
      injected_only("AL.502", 0xA502, 0x01, Cause::second_encoder_count, option, word),
      injected_only("AL.505", 0xA505, 0x01, Cause::pulse_frequency, option, word),
      injected_only("AL.550", 0xA550, 0x01, cause::inertia_identification, option, word),
      {"AL.551", 0xA551, 0x01,
       [](JmcBus& rig) {
         ASSERT_EQ(rig.set_panel(3, 68, 2), AbortCode::none);  // P03-68, s
         set(rig, 0x6098, 0, 17);                              // there is no switch
         set(rig, 0x6099, 1, 20000);
         in_mode(6)(rig);
       },
       [](JmcBus& rig) { rig.control(0x1F); }, [](JmcBus&) {}, Gone::with_reaction, option, word, 2100.0},
      injected_only("AL.552", 0xA552, 0x01, cause::angle_identification, option, word),
      injected_only("AL.600", 0xA600, 0x01, cause::encoder_supply, at_once, power),
      // At standstill: a coasting axis would have another position when the encoder returns.
      {"AL.610", 0x7305, 0x01, in_mode(3), inject(Injection::encoder_loss), inject(Injection::encoder_loss, false),
       Gone::when_removed, at_once, power},
      of_plant("AL.610", 0x7305, 0x01, Injection::hall_wiring, at_once, power, "Hall"),
      injected_only("AL.620", 0xA620, 0x01, cause::absolute_encoder, at_once, power),
      injected_only("AL.621", 0xA621, 0x01, cause::encoder_memory, option, power),
      injected_only("AL.622", 0xA622, 0x01, cause::encoder_memory_parity, option, power),
      {"E105", 0x5005, 0x40, turning_under_load,
       [](JmcBus& rig) {
         rig.plant.inject(Injection::open_phase_u, true);
         rig.run_until([&] { return wrong(rig); }, 2000.0);
         rig.plant.set_external_torque_nm(0.0);
       },
       inject(Injection::open_phase_u, false), Gone::with_reaction, at_once, power, 2000.0},
      injected_only("E107", 0x5000, 0x01, cause::motor_not_enabled, option, word),
  };
}

// E101 to E107 are the numbers of the same alarms (README.md, C-33).
const std::map<std::string, std::string> drive_codes{
    {"E101", "AL.063"}, {"E102", "AL.066"}, {"E103", "AL.051"}, {"E104", "AL.402"}, {"E106", "AL.501"}};

// --- The expected results

std::string text_of(const Bytes& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    char buffer[4];
    std::snprintf(buffer, sizeof buffer, "%02X ", static_cast<unsigned>(byte));
    text += buffer;
  }
  return text;
}
std::string emergency(std::uint16_t code, std::uint8_t error_register) {
  return text_of(
      {static_cast<std::uint8_t>(code), static_cast<std::uint8_t>(code >> 8), error_register, 0, 0, 0, 0, 0});
}
std::vector<std::string> emergencies(JmcBus& rig) {
  rig.fetch();
  std::vector<std::string> texts;
  for (const Bytes& bytes : rig.emergencies) texts.push_back(text_of(bytes));
  rig.emergencies.clear();
  return texts;
}

// "LED 11 flashes" in the column "note"; 0: none is printed. Nine flashes are for AL.610 to AL.622, as in the row of
// the lamp.
int printed_flashes(const test::CsvRow& row) {
  if (row.at("code") >= "AL.610" && row.at("code") <= "AL.622") return 9;
  std::smatch found;
  const std::string& note = row.at("note");
  return std::regex_search(note, found, std::regex("LED (\\d+) flash")) ? std::stoi(found[1]) : 0;
}

void reset_edge(JmcBus& rig) {
  rig.control(0x00);
  rig.run_ms(2);
  rig.control(0x80);
  rig.run_ms(2);
}

plant::Parameters bled_plant() {
  plant::Parameters parameters = test::jmc_plant();
  parameters.supply.bleeder_resistance_ohm = 100.0;
  return parameters;
}

void check(const Case& alarm, const test::CsvRow& row, std::int16_t option_code) {
  SCOPED_TRACE(alarm.alarm + " " + alarm.variant + ", 605Eh = " + std::to_string(option_code));
  JmcBus rig(bled_plant(), test::jmc_settings());
  rig.open_limits();
  rig.to_pre_operational();
  auto& drive = rig.device.drive();
  set(rig, 0x605E, 0, option_code);
  alarm.prepare(rig);
  if (!alarm.disabled) {
    ASSERT_EQ(drive.state(), PowerState::operation_enabled) << "not prepared";
  }
  ASSERT_TRUE(emergencies(rig).empty());

  alarm.raise(rig);
  ASSERT_GE(rig.run_until([&] { return wrong(rig); }, alarm.within_ms), 0) << "not raised";
  const double velocity = std::abs(drive.axis().generator.velocity());
  if (alarm.cut == Cut::at_once) {
    rig.run_ms(1);
    EXPECT_FALSE(rig.actuation.pwm_enabled);
  } else if (option_code == 2 && velocity > 5000.0 && alarm.gone == Gone::when_removed) {
    const std::int64_t begin = rig.ticks();
    ASSERT_GE(rig.run_until([&] { return drive.axis().generator.standing(); }, 2000.0), 0);
    EXPECT_NEAR(static_cast<double>(rig.ticks() - begin) / 16000.0, velocity / 800000.0, 0.003);
  }
  ASSERT_GE(rig.run_until([&] { return drive.state() == PowerState::fault; }, 3000.0), 0);
  rig.run_ms(150);  // the brake of a coasting axis closes after P01-32
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_FALSE(rig.actuation.brake_released);
  EXPECT_EQ(rig.status() & 0x4F, 0x08);
  EXPECT_EQ(rig.get(0x603F), alarm.code);
  EXPECT_EQ(rig.get(0x1001), alarm.error_register);
  EXPECT_EQ(emergencies(rig), std::vector<std::string>{emergency(alarm.code, alarm.error_register)});
  EXPECT_EQ(rig.device.alarm().data(), alarm.alarm);
  EXPECT_EQ(rig.actuation.outputs & 1U, 1U) << "DO0";
  const products::jmc_ec::Leds leds = rig.device.leds(rig.now());
  if (row.at("code") == alarm.alarm) {
    EXPECT_EQ(leds.alarm_flashes, printed_flashes(row));
    EXPECT_EQ(leds.alarm_on, printed_flashes(row) == 0);
  }
  if (!row.at("emcy_code").empty()) {
    EXPECT_EQ(alarm.code, std::stoul(row.at("emcy_code"), nullptr, 16));
    EXPECT_EQ(alarm.error_register, std::stoul(row.at("error_register"), nullptr, 16));
    EXPECT_EQ(alarm.reset == Reset::by_controlword, row.at("reset").starts_with("yes")) << row.at("reset");
  }

  if (alarm.gone == Gone::when_removed && alarm.reset == Reset::by_controlword) {
    reset_edge(rig);
    EXPECT_EQ(drive.state(), PowerState::fault) << "reset with the cause present";
  }
  alarm.remove(rig);
  rig.run_ms(20);
  EXPECT_EQ(drive.state(), PowerState::fault) << "reset without an edge";
  EXPECT_TRUE(emergencies(rig).empty());
  reset_edge(rig);
  if (alarm.reset == Reset::by_controlword) {
    EXPECT_EQ(drive.state(), PowerState::switch_on_disabled);
    EXPECT_EQ(emergencies(rig), std::vector<std::string>{emergency(0, 0)});
  } else {
    EXPECT_EQ(drive.state(), PowerState::fault) << "only a power cycle resets it";
    rig.set(0x6040, 0, 0);
    rig.plant.sample(rig.feedback);
    rig.device.power_off();
    rig.device.power_on(rig.feedback, rig.now());
    rig.run_ms(3);
    EXPECT_EQ(drive.state(), PowerState::switch_on_disabled);
  }
  EXPECT_EQ(rig.get(0x1001), 0);
  EXPECT_EQ(rig.get(0x603F), 0);
  EXPECT_EQ(rig.actuation.outputs & 1U, 0U);
  EXPECT_STREQ(rig.device.alarm().data(), "");
  EXPECT_EQ(rig.device.leds(rig.now()).alarm_flashes, 0);
}

bool is_drive_fault(const std::string& code) { return code.starts_with("AL.") && code < "AL.900"; }
bool is_drive_code(const std::string& code) { return code.starts_with("E1"); }

TEST(JmcAlarms, EveryFaultOfTheDriveByItsCause) {
  const std::vector<Case> all = drive_cases();
  std::set<std::string> in_manual;
  for (const test::CsvRow& row : test::read_csv("jmc_alarms.csv")) {
    const std::string& code = row.at("code");
    if ((!is_drive_fault(code) && !is_drive_code(code)) || code == "AL.411" || code == "AL.611") {
      continue;  // tested separately
    }
    in_manual.insert(code);
    SCOPED_TRACE(code + " " + row.at("name"));
    const auto other = drive_codes.find(code);
    const std::string& wanted = other == drive_codes.end() ? code : other->second;
    int found = 0;
    for (const Case& alarm : all) {
      if (alarm.alarm != wanted) continue;
      ++found;
      for (const std::int16_t option_code : std::to_array<std::int16_t>({0, 2})) check(alarm, row, option_code);
    }
    EXPECT_GT(found, 0) << "no test";
  }
  EXPECT_EQ(in_manual.size(), 51U);
  for (const Case& alarm : all) EXPECT_TRUE(in_manual.contains(alarm.alarm)) << alarm.alarm;
}

// The drive has no alarm for a value of 6086h that it does not support. Such a value must not hide AL.100.
TEST(JmcAlarms, ACauseWithoutAnAlarmHidesNoOther) {
  JmcBus rig;
  set(rig, 0x607D, 1, 100);
  set(rig, 0x607D, 2, 50);
  in_mode(1)(rig);
  rig.device.drive().axis().objects.motion_profile_type = 7;
  rig.control(0x1F);
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x603F), 0xA100);
  EXPECT_NE(rig.device.drive().state(), PowerState::operation_enabled);
}

// AL.411: with a motor of 1.5 times the rated current, the power stage reaches its limit before the motor.
TEST(JmcAlarms, OverloadOfTheDrive) {
  plant::Parameters parameters = test::jmc_plant();
  parameters.motor.rated_current_a *= 1.5;
  JmcBus rig(parameters, test::jmc_settings());
  rig.to_pre_operational();
  pressing(rig);
  set(rig, 0x6071, 0, 1500);
  bool warned = false;
  ASSERT_GE(rig.run_until(
                [&] {
                  warned |= std::string(rig.device.alarm().data()) == "AL.912";
                  return wrong(rig);
                },
                20000.0),
            0);
  EXPECT_TRUE(warned);
  rig.run_ms(200);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.411");
  EXPECT_EQ(rig.get(0x603F), 0xA411);
  EXPECT_EQ(rig.device.leds(rig.now()).alarm_flashes, 10);
  EXPECT_EQ(emergencies(rig), std::vector<std::string>{emergency(0xA411, 0x02)});
}

// AL.051: the stored data are damaged before power-on. AL.062: the memory cannot be written.
TEST(JmcAlarms, DamagedMemory) {
  dictionary::FailingMedium medium(65536);
  products::Settings settings = test::jmc_settings();
  settings.store = &medium;
  {
    JmcBus fresh(test::jmc_plant(), settings);
    fresh.run_ms(3);
    EXPECT_STREQ(fresh.device.alarm().data(), "") << "nothing stored is no damage";
    ASSERT_EQ(fresh.set_panel(2, 0, 500), AbortCode::none);
    EXPECT_STREQ(fresh.device.alarm().data(), "");
    medium.dead = true;
    fresh.set_panel(2, 0, 501);
    fresh.run_ms(3);
    EXPECT_STREQ(fresh.device.alarm().data(), "AL.062");
    EXPECT_EQ(fresh.get(0x603F), 0x5003);
    EXPECT_EQ(fresh.device.leds(fresh.now()).alarm_flashes, 11);
    medium.dead = false;
  }
  for (std::size_t at = 40; at < medium.memory.size(); at += medium.memory.size() / 2)
    medium.memory[at] ^= std::byte{1};
  JmcBus damaged(test::jmc_plant(), settings);
  damaged.run_ms(3);
  EXPECT_STREQ(damaged.device.alarm().data(), "AL.051");
  EXPECT_EQ(damaged.get(0x603F), 0x5003);
  EXPECT_EQ(damaged.get(0x1001), 0xC0);
  EXPECT_EQ(damaged.device.drive().state(), PowerState::fault);
}

// AL.611: no index pulse for three revolutions.
TEST(JmcAlarms, LostIndex) {
  plant::Parameters parameters = test::jmc_plant();
  JmcBus good(parameters, test::jmc_settings());
  good.open_limits();
  turning(good);
  good.run_ms(2000);
  EXPECT_EQ(good.device.drive().state(), PowerState::operation_enabled);
  parameters.encoder.index_width_counts = 0;
  JmcBus rig(parameters, test::jmc_settings());
  rig.open_limits();
  set(rig, 0x6060, 0, 3);
  set(rig, 0x60FF, 0, 20000);
  ASSERT_TRUE(rig.enable());
  ASSERT_GE(rig.run_until([&] { return wrong(rig); }, 2000.0), 0);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), 12000.0, 50.0);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.611");
}

// --- Warnings: statusword bit 7 while their cause lasts, no fault, no emergency

struct Warning {
  std::string alarm;
  Action prepare;
  Action raise;
  Action remove;
  double within_ms = 100.0;
};

Warning injected_warning(const char* alarm, Cause cause) {
  return {alarm, turning, [cause](JmcBus& rig) { rig.device.drive().inject(cause, true); },
          [cause](JmcBus& rig) { rig.device.drive().inject(cause, false); }};
}
Warning limit_switch(int wire, double rpm) {
  return {"AL.950", [rpm](JmcBus& rig) { turn(rig, rpm); }, [wire](JmcBus& rig) { rig.plant.force_input(wire, true); },
          [wire](JmcBus& rig) { rig.plant.force_input(wire, false); }};
}

std::vector<Warning> warnings() {
  return {
      {"AL.900",
       [](JmcBus& rig) {
         set(rig, 0x607A, 0, 0);
         in_mode(8)(rig);
         rig.plant.lock_rotor(true);
       },
       write(0x607A, 0, 3500), write(0x607A, 0, 0), 500.0},
      injected_warning("AL.901", cause::deviation_at_servo_on),
      {"AL.910", pressing, write(0x6071, 0, 2500), write(0x6071, 0, 0), 8000.0},
      {"AL.912", [](JmcBus&) {}, {}, {}},  // JmcAlarms.OverloadOfTheDrive
      {"AL.941", [](JmcBus& rig) { rig.run_ms(1); },
       [](JmcBus& rig) { ASSERT_EQ(rig.set_panel(3, 9, 5000), AbortCode::none); },
       [](JmcBus& rig) { ASSERT_EQ(rig.set_panel(3, 9, 4000), AbortCode::none); }},
      injected_warning("AL.942", cause::memory_wear),
      injected_warning("AL.943", cause::serial_interference),
      limit_switch(0, -300.0),  // CW, while it turns CCW
      limit_switch(2, 300.0),   // CCW
      {"AL.971", turning, supply(25.5), supply(36.0), 500.0},
  };
}

TEST(JmcAlarms, EveryWarning) {
  const std::vector<Warning> all = warnings();
  std::size_t rows = 0;
  for (const test::CsvRow& row : test::read_csv("jmc_alarms.csv")) {
    if (row.at("severity") != "warning") continue;
    ++rows;
    SCOPED_TRACE(row.at("code"));
    bool found = false;
    for (const Warning& warning : all) {
      if (warning.alarm != row.at("code")) continue;
      found = true;
      if (!warning.raise) continue;
      JmcBus rig(bled_plant(), test::jmc_settings());
      rig.open_limits();
      rig.to_pre_operational();
      warning.prepare(rig);
      const PowerState state = rig.device.drive().state();
      EXPECT_EQ(rig.status() & 0x80, 0);
      warning.raise(rig);
      ASSERT_GE(rig.run_until([&] { return warning.alarm == rig.device.alarm().data(); }, warning.within_ms), 0);
      EXPECT_EQ(rig.status() & 0x80, 0x80);
      EXPECT_EQ(rig.device.drive().state(), state);
      // "AL.950" is A950h
      EXPECT_EQ(rig.get(0x603F), 0xA000 + std::stoi(warning.alarm.substr(3), nullptr, 16));
      EXPECT_EQ(rig.get(0x1001), 0);
      warning.remove(rig);
      ASSERT_GE(rig.run_until([&] { return (rig.status() & 0x80) == 0; }, 3000.0), 0) << "stays";
      EXPECT_EQ(rig.device.drive().state(), state);
      EXPECT_TRUE(emergencies(rig).empty());
      EXPECT_STREQ(rig.device.alarm().data(), "");
      EXPECT_EQ(rig.get(0x603F), 0);
    }
    EXPECT_TRUE(found) << "no test";
  }
  EXPECT_EQ(rows, 9U);
}

// --- The bus

void set_mailbox(JmcBus& rig, unsigned out_start) {
  rig.set_sync_manager(0, out_start, JmcBus::mailbox_bytes, 0x26);
  rig.set_sync_manager(1, 0x1100, JmcBus::mailbox_bytes, 0x22);
}

// An active sync manager keeps its start and length.
void change_length(JmcBus& rig, unsigned number, unsigned start, unsigned length, unsigned control) {
  rig.write(static_cast<std::uint16_t>(ethercat::reg::sync_manager + 8 * number + 6), {0});
  rig.set_sync_manager(number, start, length, control);
}

// All four PDOs of a direction with 48 bytes each: this exceeds the maximum of the process data.
void fill_pdos(JmcBus& rig, std::uint16_t assignment, std::uint16_t first, std::uint32_t entry) {
  ASSERT_EQ(rig.download(assignment, 0, 0, 1), AbortCode::none);
  for (std::uint16_t pdo = first; pdo < first + 4; ++pdo) {
    ASSERT_EQ(rig.download(pdo, 0, 0, 1), AbortCode::none);
    for (std::uint8_t sub = 1; sub <= 12; ++sub) ASSERT_EQ(rig.download(pdo, sub, entry, 4), AbortCode::none);
    ASSERT_EQ(rig.download(pdo, 0, 12, 1), AbortCode::none);
  }
  ASSERT_EQ(rig.download(assignment, 0, 4, 1), AbortCode::none);
}

// Causes the error of the state machine, over the bus.
const std::map<std::string, Action> bus_causes{
    {"E603", [](JmcBus& rig) { rig.request(3); }},
    {"E606",
     [](JmcBus& rig) {
       // Overwrites a word of the configuration area; at the next power-on its checksum is wrong.
       rig.write(ethercat::reg::sii_configuration, {0, 0});
       rig.write(ethercat::reg::sii_address, test::little_endian(std::uint32_t{2}));
       rig.write(ethercat::reg::sii_data, {0x34, 0x12});
       rig.write(ethercat::reg::sii_control, {0x01, 0x02});
       rig.run_ms(10);
       EXPECT_EQ(rig.read_u16(ethercat::reg::sii_control) & 0x8000U, 0U) << "written";
       rig.device.power_off();
       rig.device.power_on(rig.feedback, rig.now());
       set_mailbox(rig, 0x1000);
       rig.request(2);
     }},
    {"E607", [](JmcBus& rig) { rig.request(8); }},
    {"E608", [](JmcBus& rig) { rig.request(5); }},
    {"E60A",
     [](JmcBus& rig) {
       set_mailbox(rig, 0x1010);
       rig.request(2);
     }},
    {"E60D",
     [](JmcBus& rig) {
       rig.to_pre_operational();
       rig.set_process_data();
       change_length(rig, 2, 0x1200, 16, 0x64);
       rig.request(4);
     }},
    {"E60E",
     [](JmcBus& rig) {
       rig.to_pre_operational();
       rig.set_process_data();
       change_length(rig, 3, 0x1500, 26, 0x20);
       rig.request(4);
     }},
    {"E614",
     [](JmcBus& rig) {
       rig.to_pre_operational();
       fill_pdos(rig, 0x1C13, 0x1A00, 0x60640020);
       rig.request(4);
     }},
    {"E615",
     [](JmcBus& rig) {
       rig.to_pre_operational();
       fill_pdos(rig, 0x1C12, 0x1600, 0x607A0020);
       rig.request(4);
     }},
    {"E61B",
     [](JmcBus& rig) {
       rig.to_pre_operational();
       rig.start_sync0(125'000);
       rig.set_process_data();
       rig.request(4);
     }},
    {"E61C",
     [](JmcBus& rig) {
       rig.to_pre_operational();
       ASSERT_EQ(rig.download(0x1C32, 1, 2, 2), AbortCode::none);
       rig.set_process_data();
       rig.request(4);
     }},
    {"E61E",
     [](JmcBus& rig) {
       rig.to_pre_operational();
       rig.start_sync0(1'000'100);
       rig.set_process_data();
       rig.request(4);
     }},
    {"E61F",
     [](JmcBus& rig) {
       rig.connect(1'000'000);
       rig.run_ms(10);  // SYNC0 without outputs
     }},
    {"E620",
     [](JmcBus& rig) {
       rig.connect(1'000'000);
       rig.write(ethercat::reg::sync_activation, {0x00});
       rig.exchange();
       rig.run_ms(1);
       rig.exchange();
     }},
    {"E621",
     [](JmcBus& rig) {
       rig.to_pre_operational();
       rig.write(ethercat::reg::sync0_cycle, test::little_endian(std::uint32_t{1'000'000}));
       rig.write(ethercat::reg::sync_start_time, test::little_endian(std::uint64_t{1} << 40U));
       rig.write(ethercat::reg::sync_activation, {0x03});
       rig.to_safe_operational();
       rig.write(ethercat::reg::al_control, {8, 0});
       rig.run_cycles(5100, 1.0);
     }},
    {"E626",
     [](JmcBus& rig) {
       rig.to_pre_operational();
       rig.to_safe_operational();
       rig.write(ethercat::reg::al_control, {8, 0});
       rig.run_ms(5100);
     }},
    {"E627",
     [](JmcBus& rig) {
       rig.connect();
       rig.run_ms(150);
     }},
};

struct ExpectedOnBus {
  AlStatusCode code;
  std::uint16_t error_code;
  products::jmc_ec::ErrorLed led;
};
ExpectedOnBus expected_on_bus(const test::CsvRow& row) {
  std::smatch al;
  std::smatch led;
  const std::string& note = row.at("note");
  EXPECT_TRUE(std::regex_search(note, al, std::regex("AL status code 0x([0-9A-F]+)")));
  EXPECT_TRUE(std::regex_search(note, led, std::regex("ERR LED ([a-z]+)")));
  using products::jmc_ec::ErrorLed;
  static const std::map<std::string, ErrorLed> lamps{{"single", ErrorLed::single_flash},
                                                     {"double", ErrorLed::double_flash},
                                                     {"triple", ErrorLed::triple_flash},
                                                     {"quadruple", ErrorLed::quadruple_flash},
                                                     {"steady", ErrorLed::on}};
  return {static_cast<AlStatusCode>(std::stoul(al[1], nullptr, 16)),
          static_cast<std::uint16_t>(std::stoul(row.at("emcy_code"), nullptr, 16)), lamps.at(led[1])};
}

TEST(JmcAlarms, EveryCommunicationAlarm) {
  std::size_t rows = 0;
  std::size_t real = 0;
  for (const test::CsvRow& row : test::read_csv("jmc_alarms.csv")) {
    const std::string& code = row.at("code");
    if (!code.starts_with("E6")) continue;
    SCOPED_TRACE(code + " " + row.at("name"));
    const ExpectedOnBus want = expected_on_bus(row);
    JmcBus rig;
    const auto provoke = bus_causes.find(code);
    if (provoke == bus_causes.end()) {
      rig.device.drive().inject(products::jmc_ec::communication_cause(rows), true);
      rig.run_ms(3);
    } else {
      ++real;
      provoke->second(rig);
      rig.run_ms(3);
      EXPECT_EQ(rig.al_status().code, want.code);
      EXPECT_NE(rig.al_status().state & 0x10U, 0U);
      EXPECT_FALSE(rig.device.drive().any_fault()) << "the motor is off";
    }
    EXPECT_EQ(rig.get(0x603F), want.error_code);
    EXPECT_EQ(rig.get(0x1001), 0x11);
    EXPECT_EQ(rig.device.alarm().data(), code);
    products::jmc_ec::Leds leds = rig.device.leds(rig.now());
    EXPECT_EQ(leds.alarm_flashes, 5) << "communication error (ch. 4.3.2)";
    EXPECT_EQ(leds.error, want.led);
    const unsigned state = rig.al_status().state & 0x0FU;
    if (state != 1) {
      EXPECT_EQ(emergencies(rig), std::vector<std::string>{emergency(want.error_code, 0x11)});
    }
    if (provoke != bus_causes.end()) {  // until the master acknowledges it
      rig.request(0x10U | state);
      rig.run_ms(3);
      EXPECT_EQ(rig.get(0x603F), 0);
      EXPECT_EQ(rig.get(0x1001), 0);
      EXPECT_STREQ(rig.device.alarm().data(), "");
      leds = rig.device.leds(rig.now());
      EXPECT_EQ(leds.error, products::jmc_ec::ErrorLed::off);
      EXPECT_EQ(leds.alarm_flashes, 0);
      if (state != 1) {
        EXPECT_EQ(emergencies(rig), std::vector<std::string>{emergency(0, 0)});
      }
    }
    ++rows;
  }
  EXPECT_EQ(rows, 43U);
  EXPECT_EQ(real, bus_causes.size());
}

// The drive reports SYNC0 errors that its application detects: a missing pulse, or a second one in a cycle.
TEST(JmcAlarms, FollowThePulsesThatTheDriveSees) {
  struct Pulses final : ethercat::SlaveInterposer {
    Pulse sync0(ethercat::Time) override { return pulse; }
    Pulse pulse;
  };
  struct Sight {
    unsigned times;
    AlStatusCode code;
    const char* alarm;
  };
  for (const Sight& one :
       {Sight{0, AlStatusCode::fatal_sync_error, "E620"}, Sight{2, AlStatusCode::synchronization_error, "E61F"}}) {
    SCOPED_TRACE(one.alarm);
    Pulses pulses;
    JmcBus rig;
    rig.connect(1'000'000);
    rig.device.slave().interpose(&pulses);
    rig.run_cycles(10, 1.0);
    EXPECT_EQ(rig.al_status(), JmcBus::good(8));
    pulses.pulse.times = one.times;
    rig.run_cycles(10, 1.0);
    EXPECT_EQ(rig.al_status().code, one.code);
    EXPECT_STREQ(rig.device.alarm().data(), one.alarm);
  }
}

// If the motor is enabled, 6007h selects the reaction to the loss of the outputs (Table 150).
TEST(JmcAlarms, LossOfOutputsWhileEnabled) {
  for (const int option : {0, 1, 2, 3}) {
    SCOPED_TRACE(option);
    JmcBus rig;
    rig.open_limits();
    rig.connect();
    set(rig, 0x6007, 0, option);
    rig.enable_in(3);
    rig.put<std::int32_t>(JmcBus::Out::velocity, 20000);
    rig.cycles(200);
    emergencies(rig);
    rig.run_ms(600);
    EXPECT_EQ(rig.al_status().code, AlStatusCode::sync_manager_watchdog);
    EXPECT_EQ(rig.get(0x603F), 0xFF09);
    EXPECT_EQ(emergencies(rig), std::vector<std::string>{emergency(0xFF09, 0x11)});
    EXPECT_STREQ(rig.device.alarm().data(), "E627");
    switch (option) {
      case 0:
        EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
        EXPECT_NEAR(rig.plant.velocity_rpm(), 300.0, 8.0);
        break;
      case 1: EXPECT_EQ(rig.device.drive().state(), PowerState::fault); break;
      default: EXPECT_EQ(rig.device.drive().state(), PowerState::switch_on_disabled); break;
    }
    rig.request(0x14);
    rig.run_ms(3);
    EXPECT_EQ(rig.get(0x603F), option == 1 ? 0xFF09 : 0) << "a fault is reset by its own edge";
    if (option != 1) continue;
    set(rig, 0x6040, 0, 0x00);  // by SDO: outputs are not accepted in Safe-Operational
    rig.run_ms(2);
    set(rig, 0x6040, 0, 0x80);
    rig.run_ms(2);
    EXPECT_EQ(rig.get(0x603F), 0);
    EXPECT_EQ(rig.get(0x1001), 0);
  }
}

// If a master ends while the axis stops because of an alarm, that alarm stays visible.
TEST(JmcAlarms, LeavingOperationalWhileAnAlarmStopsTheAxis) {
  JmcBus rig;
  rig.connect();
  rig.enable_in(9);
  rig.put<std::int32_t>(JmcBus::Out::velocity, 10'000);
  rig.cycles(300);
  rig.device.drive().inject(drive::Cause::over_speed, true);
  rig.cycles(2);
  ASSERT_EQ(rig.device.drive().state(), PowerState::fault_reaction_active);
  ASSERT_EQ(rig.request(4), rig.good(4));
  rig.run_ms(2000);
  EXPECT_EQ(rig.device.drive().state(), PowerState::fault);
  EXPECT_EQ(rig.get(0x603F), 0xA420);
}

// A master that takes an enabled drive out of Operational removes its valid outputs.
TEST(JmcAlarms, LeavingOperationalWhileEnabled) {
  JmcBus rig;
  rig.connect();
  rig.enable_in(8);
  ASSERT_EQ(rig.request(4), rig.good(4));
  rig.run_ms(200);
  EXPECT_EQ(rig.device.drive().state(), PowerState::fault);
  EXPECT_EQ(rig.get(0x603F), 0xFF08);
  JmcBus off;
  off.connect();
  ASSERT_EQ(off.request(4), off.good(4));
  off.run_ms(200);
  EXPECT_EQ(off.device.drive().state(), PowerState::switch_on_disabled);
  EXPECT_EQ(off.get(0x603F), 0);
}

// --- Lamps

TEST(JmcAlarms, Lamps) {
  using products::jmc_ec::Lamp;
  JmcBus rig;
  const auto leds = [&rig] {
    rig.run_ms(2);
    return rig.device.leds(rig.now());
  };
  rig.segment.set_cable(0, false);
  EXPECT_EQ(leds().power, Lamp::flashing) << "not linked (ch. 4.3.2)";
  EXPECT_EQ(leds().data_in, Lamp::off);
  rig.segment.set_cable(0, true);
  EXPECT_EQ(leds().power, Lamp::on);
  EXPECT_EQ(leds().data_in, Lamp::on) << "link, no traffic";
  EXPECT_EQ(leds().data_out, Lamp::off);
  EXPECT_EQ(leds().run, Lamp::off);
  rig.to_pre_operational();
  EXPECT_EQ(leds().run, Lamp::flashing);
  EXPECT_EQ(leds().data_in, Lamp::flashing);
  rig.run_ms(200);
  EXPECT_EQ(leds().data_in, Lamp::on);
  rig.to_safe_operational();
  EXPECT_EQ(leds().run, Lamp::single_flash);
  rig.exchange();
  ASSERT_EQ(rig.request(8), rig.good(8));
  EXPECT_EQ(leds().run, Lamp::on);
  // 6, 7 and 8: the limits (ch. 4.3.2).
  for (const auto& [wire, flashes] : {std::pair{2, 6}, std::pair{0, 7}, std::pair{1, 8}}) {
    rig.plant.force_input(wire, true);
    EXPECT_EQ(leds().alarm_flashes, flashes);
    rig.plant.force_input(wire, false);
    EXPECT_EQ(leds().alarm_flashes, 0);
  }
}

// An active limit switch does not hide the indication of an alarm.
TEST(JmcAlarms, LampsOfAnAlarmComeBeforeThoseOfInputs) {
  for (const bool flashes : {true, false}) {
    JmcBus rig;
    for (const drive::FaultRow& fault : products::jmc_ec::faults) {
      if (fault.reaction == drive::Reaction::none) continue;
      const std::uint8_t count = products::jmc_ec::flashes_of(fault.alarm);
      if ((count != 0) != flashes) continue;
      rig.device.drive().raise(fault.cause);
      rig.plant.force_input(2, true);
      rig.run_ms(2);
      EXPECT_EQ(rig.device.leds(rig.now()).alarm_flashes, count) << fault.alarm;
      EXPECT_EQ(rig.device.leds(rig.now()).alarm_on, !flashes) << fault.alarm;
      break;
    }
  }
}

// The state of the six lamps (ch. 4.3.2, Table 10).
TEST(JmcAlarms, LampsOfTheFront) {
  using products::Light;
  JmcBus rig;
  const auto lamp = [&rig](std::string_view name) {
    rig.run_ms(2);
    const products::Lamps lamps = rig.device.lamps(rig.now());
    for (const products::Lamp& one : lamps.all()) {
      if (one.name == name) return std::pair{one.light, one.flashes};
    }
    ADD_FAILURE() << name;
    return std::pair{Light::off, std::uint8_t{0}};
  };
  constexpr std::uint8_t none = 0;
  std::vector<std::string> names;
  const products::Lamps lamps = rig.device.lamps(rig.now());
  for (const products::Lamp& one : lamps.all()) {
    names.push_back(std::string(one.name) + " " + std::string(one.colour));
  }
  EXPECT_EQ(names,
            (std::vector<std::string>{"power green", "alarm red", "RUN green", "ERR red", "IN yellow", "OUT yellow"}));
  rig.segment.set_cable(0, false);
  EXPECT_EQ(lamp("power"), (std::pair{Light::blinking, none}));
  EXPECT_EQ(lamp("IN"), (std::pair{Light::off, none}));
  rig.segment.set_cable(0, true);
  EXPECT_EQ(lamp("power"), (std::pair{Light::on, none}));
  EXPECT_EQ(lamp("IN"), (std::pair{Light::on, none}));
  EXPECT_EQ(lamp("OUT"), (std::pair{Light::off, none}));
  EXPECT_EQ(lamp("RUN"), (std::pair{Light::off, none}));
  EXPECT_EQ(lamp("ERR"), (std::pair{Light::off, none}));
  EXPECT_EQ(lamp("alarm"), (std::pair{Light::off, none}));
  rig.to_pre_operational();
  EXPECT_EQ(lamp("RUN"), (std::pair{Light::blinking, none}));
  rig.run_ms(200);
  rig.to_safe_operational();
  EXPECT_EQ(lamp("RUN"), (std::pair{Light::flashes, std::uint8_t{1}}));
  rig.plant.force_input(2, true);
  EXPECT_EQ(lamp("alarm"), (std::pair{Light::flashes, std::uint8_t{6}}));
  rig.plant.force_input(2, false);
  EXPECT_EQ(lamp("alarm"), (std::pair{Light::off, none}));
  rig.exchange();
  ASSERT_EQ(rig.request(8), rig.good(8));
  EXPECT_EQ(lamp("RUN"), (std::pair{Light::on, none}));
}

// Each printed number of flashes has an alarm or an input.
TEST(JmcAlarms, EachFlashCountHasACause) {
  std::set<int> counts{6, 7, 8};
  for (const products::jmc_ec::AlarmFlashes& row : products::jmc_ec::alarm_flashes) {
    for (const drive::FaultRow& fault : products::jmc_ec::faults) {
      if (fault.alarm >= row.first && fault.alarm <= row.last) counts.insert(row.flashes);
    }
  }
  int printed = 0;
  for (const test::CsvRow& row : test::read_csv("jmc_alarms.csv")) {
    if (!row.at("code").starts_with("LED")) continue;
    EXPECT_TRUE(counts.contains(std::stoi(row.at("code").substr(3)))) << row.at("code");
    ++printed;
  }
  EXPECT_EQ(printed, 14);
}

}  // namespace
}  // namespace jmc_alarms_test
}  // namespace servodrome
