#include <set>

#include "csv.hpp"
#include "dictionary/store.hpp"
#include "fault_cases.hpp"
#include "ismk_rig.hpp"

// Every alarm of the iSMK manual (tests/data/ismk_alarms.csv), raised by its cause, or by injection if the cause is not
// in this drive.
namespace servodrome {
namespace ismk_alarms_test {
namespace {

using dictionary::AbortCode;
using drive::Cause;
using drive::PowerState;
using plant::Injection;
using products::ismk::AlarmWords;
using test::Gone;
using test::IsmkRig;

using Action = std::function<void(IsmkRig&)>;

enum class Cut : std::uint8_t {
  by_option_code,  // 605Eh
  angle_lost,      // of 605Eh only braking by short circuit is possible
  at_once,
};
enum class Reset : std::uint8_t { by_controlword, by_clearing_turns, by_restart };

struct Case {
  std::string place;  // the column "bit"; if that is empty, the column "code"
  Action prepare;     // leaves the drive in Operation enabled
  Action raise;
  Action remove = [](IsmkRig&) {};
  Gone gone = Gone::with_reaction;
  Cut cut = Cut::by_option_code;
  Reset reset = Reset::by_controlword;
  double within_ms = 200.0;
  const char* variant = "";
};

void set(IsmkRig& rig, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  ASSERT_EQ(rig.set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub} << " = " << value;
}
std::int64_t dec(double rpm) { return std::llround(products::ismk::velocity_dec_from_rpm(rpm)); }

// --- The state of the axis when the alarm occurs

void turn(IsmkRig& rig, double rpm) {
  set(rig, 0x6060, 0, 3);
  set(rig, 0x60FF, 0, dec(rpm));
  ASSERT_TRUE(rig.enable());
  rig.run_ms(300);
  ASSERT_NEAR(rig.plant.velocity_rpm(), rpm, 6.0);
}
void turning(IsmkRig& rig) { turn(rig, 600.0); }

void turning_under_load(IsmkRig& rig) {
  turning(rig);
  rig.plant.set_external_torque_nm(0.6);
  rig.run_ms(100);
}

Action turning_with_input(std::uint16_t function, bool level) {
  return [=](IsmkRig& rig) {
    rig.plant.force_input(0, level);
    rig.run_ms(1);
    set(rig, 0x2010, 3, function);
    turning(rig);
  };
}

Action homed_towards(std::uint16_t function, double rpm) {
  return [=](IsmkRig& rig) {
    rig.plant.force_input(0, true);
    rig.run_ms(1);
    set(rig, 0x2010, 3, function);
    set(rig, 0x2010, 0x19, 0);
    set(rig, 0x6060, 0, 6);
    set(rig, 0x6098, 0, 35);
    ASSERT_TRUE(rig.enable());
    rig.control(0x1F);
    rig.run_ms(5);
    ASSERT_TRUE(rig.device.drive().homed());
    rig.control(0x06);
    rig.run_ms(5);
    turn(rig, rpm);
  };
}

void positioning(IsmkRig& rig) {
  set(rig, 0x6065, 0, 3000);
  set(rig, 0x6081, 0, dec(600.0));
  set(rig, 0x607A, 0, 10000000);
  set(rig, 0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  rig.run_ms(300);
}

void pressing(IsmkRig& rig) {
  rig.plant.lock_rotor(true);
  set(rig, 0x6060, 0, 4);
  ASSERT_TRUE(rig.enable());
}

void guarded(IsmkRig& rig) {
  set(rig, 0x6007, 0, 1);
  set(rig, 0x100C, 0, 50);
  turning(rig);
  rig.send(0x701, {}, true);
  rig.run_ms(100);
  rig.send(0x701, {}, true);
  rig.run_ms(100);
}

// --- The cause of the alarm

Action inject(Injection injection) {
  return [injection](IsmkRig& rig) { rig.plant.inject(injection, true); };
}
Action take_back(Injection injection) {
  return [injection](IsmkRig& rig) { rig.plant.inject(injection, false); };
}
Action input(bool level) {
  return [level](IsmkRig& rig) { rig.plant.force_input(0, level); };
}
Action lock(bool locked) {
  return [locked](IsmkRig& rig) { rig.plant.lock_rotor(locked); };
}

Case of_plant(const char* place, Injection injection, Cut cut, Reset reset = Reset::by_controlword,
              const char* variant = "") {
  return {place, turning, inject(injection), take_back(injection), Gone::when_removed, cut, reset, 200.0, variant};
}

Case hardware_only(const char* place, Cause cause, Cut cut, Reset reset = Reset::by_controlword) {
  return {place,
          turning,
          [cause](IsmkRig& rig) { rig.device.drive().inject(cause, true); },
          [cause](IsmkRig& rig) { rig.device.drive().inject(cause, false); },
          Gone::when_removed,
          cut,
          reset};
}

std::vector<Case> cases() {
  const auto option = Cut::by_option_code;
  const auto at_once = Cut::at_once;
  const auto angle_lost = Cut::angle_lost;
  const auto restart = Reset::by_restart;
  return {
      hardware_only("FFF.F", Cause::motor_mismatch, at_once, restart),
      hardware_only("2601 bit 0", Cause::second_encoder_count, option),
      of_plant("2601 bit 1", Injection::encoder_loss, angle_lost),
      of_plant("2601 bit 2", Injection::encoder_multi_turn, option, Reset::by_clearing_turns),
      of_plant("2601 bit 3", Injection::encoder_crc, angle_lost),
      of_plant("2601 bit 4", Injection::stage_overheat, option),
      {"2601 bit 5", turning, [](IsmkRig& rig) { rig.plant.set_supply_v(75.0); },
       [](IsmkRig& rig) { rig.plant.set_supply_v(48.0); }, Gone::when_removed, option},
      {"2601 bit 6", turning,
       [](IsmkRig& rig) {
         rig.plant.inject(Injection::supply_loss, true);
         rig.plant.discharge_dc_link();
       },
       take_back(Injection::supply_loss), Gone::when_removed, at_once},
      of_plant("2601 bit 7", Injection::short_circuit, at_once),
      of_plant("2601 bit 7", Injection::bus_overcurrent, at_once, Reset::by_controlword, "DC link"),
      hardware_only("2601 bit 8", Cause::brake_resistor, option),
      {"2601 bit 9", positioning, lock(true), lock(false)},
      of_plant("2601 bit 10", Injection::gate_supply_low, at_once),
      {.place = "2601 bit 11",
       .prepare = pressing,
       .raise = [](IsmkRig& rig) { set(rig, 0x6071, 0, 3000); },
       .remove = lock(false),
       .within_ms = 4000.0},
      hardware_only("2601 bit 12", Cause::pulse_frequency, option),
      of_plant("2601 bit 13", Injection::winding_overheat, option),
      {"2601 bit 13", turning_with_input(0x8100, false), input(true), input(false), Gone::when_removed, option,
       Reset::by_controlword, 200.0, "input"},
      of_plant("2601 bit 14", Injection::encoder_delimiter, angle_lost),
      hardware_only("2601 bit 15", Cause::memory, option, restart),
      hardware_only("2602 bit 0", Cause::current_sensor, at_once),
      hardware_only("2602 bit 1", Cause::watchdog, at_once, restart),
      hardware_only("2602 bit 2", Cause::interrupt, at_once, restart),
      of_plant("2602 bit 3", Injection::internal, at_once, restart),
      hardware_only("2602 bit 4", Cause::motor_unknown, at_once, restart),
      {"2602 bit 8", turning_with_input(0x8200, true), input(false), input(true)},
      {"2602 bit 9", homed_towards(0x0010, 600.0), input(false), input(true)},
      {"2602 bit 10", homed_towards(0x0020, -600.0), input(false), input(true)},
      hardware_only("2602 bit 11", Cause::serial_interface, at_once, restart),
      {.place = "2602 bit 12", .prepare = guarded, .raise = [](IsmkRig&) {}},
      hardware_only("2602 bit 13", Cause::second_encoder_direction, option),
      hardware_only("2602 bit 14", Cause::second_encoder_connection, option),
      hardware_only("2602 bit 15", Cause::second_encoder_count, option),
      hardware_only("2605.07 bit 0", Cause::current_sensor_origin, at_once),
      hardware_only("2605.07 bit 1", Cause::brake_resistor_hot, option),
      hardware_only("2605.07 bit 2", Cause::brake_resistor_short, option, restart),
      {"2605.07 bit 3", turning_under_load, inject(Injection::open_phase_u), take_back(Injection::open_phase_u),
       Gone::with_reaction, at_once, Reset::by_controlword, 2000.0},
      hardware_only("2605.07 bit 4", Cause::current_saturation, at_once),
      hardware_only("2605.07 bit 12", Cause::service_timeout, option),
  };
}

// --- The manual's data about the alarm

struct Expected {
  std::uint16_t code;
  std::uint8_t error_register;
  AlarmWords words;
  std::uint16_t mask_1 = 0;  // the bits of 2605h sub 1 and 4 that mask it
  std::uint16_t mask_2 = 0;
};

Expected expected(const test::CsvRow& row) {
  const std::string& place = row.at("bit");
  Expected result{};
  if (place.empty()) {  // FFF.F: of the motor's configuration, like 2602h bit 4
    result = {0x6320, 0x01, {1, 0x0010, 0}, 0, 0x0010};
    return result;
  }
  if (place == "2601 bit 0") {  // the alarm of 2602h that the case raises sets it
    return {0x7306, 0x41, {1, 0x8000, 0}, 0, 0x8000};
  }
  result.code = static_cast<std::uint16_t>(std::stoul(row.at("emcy_code"), nullptr, 16));
  result.error_register = static_cast<std::uint8_t>(std::stoul(row.at("error_register"), nullptr, 16));
  const auto bit = static_cast<std::uint16_t>(1U << std::stoul(place.substr(place.rfind(' '))));
  if (place.starts_with("2601 ")) {
    result.words.state = result.mask_1 = bit;
  } else if (place.starts_with("2602 ")) {
    result.words = {1, bit, 0};
    result.mask_2 = bit;
  } else {
    result.words.extension = bit;
    switch (bit) {  // the bit whose details this alarm has (column "note" of the file)
      case 1U << 0: result.mask_2 = 1U << 0; break;
      case 1U << 1:
      case 1U << 2: result.mask_1 = 1U << 8; break;
      case 1U << 3: result.mask_2 = 1U << 4; break;
      case 1U << 4: result.mask_1 = 1U << 7; break;
      case 1U << 12: result.mask_2 = 1U << 12; break;
      default: ADD_FAILURE() << place;
    }
    result.words.state = result.mask_2 != 0 ? 1 : result.mask_1;
    result.words.state_2 = result.mask_2;
  }
  return result;
}

std::string emergency(std::uint16_t code, std::uint8_t error_register, AlarmWords words) {
  char text[32];
  std::snprintf(text, sizeof text, "%02X %02X %02X 00 %02X %02X %02X %02X ", code & 0xFFU, code >> 8U,
                static_cast<unsigned>(error_register), words.state & 0xFFU, words.state >> 8U, words.state_2 & 0xFFU,
                words.state_2 >> 8U);
  return text;
}

bool wrong(IsmkRig& rig) {
  const PowerState state = rig.device.drive().state();
  return state == PowerState::fault || state == PowerState::fault_reaction_active;
}

AlarmWords words(IsmkRig& rig) {
  return {static_cast<std::uint16_t>(rig.get(0x2601)), static_cast<std::uint16_t>(rig.get(0x2602)),
          static_cast<std::uint16_t>(rig.get(0x2605, 7))};
}

// Fault reset by its edge. The level before is 06, which keeps the drive in Ready to switch on.
void reset_edge(IsmkRig& rig) {
  rig.control(0x06);
  rig.run_ms(3);
  rig.control(0x86);
  rig.run_ms(3);
}

// The reaction from its first tick until the power stage is off.
void check_reaction(IsmkRig& rig, const Case& alarm, std::int16_t option_code) {
  auto& drive = rig.device.drive();
  const double velocity = drive.axis().generator.velocity();
  const bool ramp =
      (option_code == 1 || option_code == 2) && alarm.cut == Cut::by_option_code && std::abs(velocity) > 5000.0;
  const bool short_circuit = option_code == 18 && alarm.cut != Cut::at_once;
  if (ramp || short_circuit) {
    rig.run_ms(1);
    ASSERT_EQ(drive.state(), PowerState::fault_reaction_active);
    EXPECT_EQ(rig.actuation.short_circuit, short_circuit);
    EXPECT_EQ(rig.actuation.pwm_enabled, ramp);
    const std::int64_t begin = rig.ticks();
    ASSERT_GE(rig.run_until([&] { return drive.state() == PowerState::fault; }, 5000.0), 0);
    const double seconds = static_cast<double>(rig.ticks() - begin) / 16000.0;
    if (ramp) {
      const double deceleration = static_cast<double>(rig.get(option_code == 1 ? 0x6084 : 0x6085)) /
                                  products::ismk::acceleration_dec_per_inc_s2;
      // The ramp, and then the time until the shaft stands.
      EXPECT_GE(seconds, std::abs(velocity) / deceleration - 0.003);
      EXPECT_LE(seconds, std::abs(velocity) / deceleration + 0.02);
      EXPECT_LT(std::abs(rig.plant.velocity_rpm()), 10.0);
    } else {
      EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 10.0) << "braked, not coasting";
    }
  }
  rig.run_ms(3);
  EXPECT_EQ(drive.state(), PowerState::fault);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_FALSE(rig.actuation.short_circuit);
}

// With a bleeder that discharges the DC link from 75 V to 70 V in a few milliseconds.
plant::Parameters bled_plant() {
  plant::Parameters parameters = test::ismk_plant();
  parameters.supply.bleeder_resistance_ohm = 20.0;
  return parameters;
}

// One alarm from cause to reset.
void check(const Case& alarm, const test::CsvRow& row, std::int16_t option_code) {
  SCOPED_TRACE("605Eh = " + std::to_string(option_code) + " " + alarm.variant);
  const Expected want = expected(row);
  IsmkRig rig(bled_plant(), test::ismk_settings());
  auto& drive = rig.device.drive();
  set(rig, 0x605E, 0, option_code);
  alarm.prepare(rig);
  ASSERT_EQ(drive.state(), PowerState::operation_enabled) << "not prepared";
  rig.sent.clear();
  const std::int64_t mode = rig.get(0x6060);

  alarm.raise(rig);
  ASSERT_GE(rig.run_until([&] { return wrong(rig); }, alarm.within_ms), 0) << "not raised";
  check_reaction(rig, alarm, option_code);

  EXPECT_EQ(test::emergencies(rig, 1), std::vector<std::string>{emergency(want.code, want.error_register, want.words)});
  EXPECT_EQ(rig.get(0x1001), want.error_register);
  EXPECT_EQ(rig.get(0x603F), want.code);
  EXPECT_EQ(rig.status() & 0x4F, 0x08);
  EXPECT_EQ(rig.get(0x2601), want.words.state);
  EXPECT_EQ(rig.get(0x2602), want.words.state_2);
  EXPECT_EQ(rig.get(0x2605, 7), want.words.extension);
  EXPECT_EQ(rig.actuation.outputs & 0x0A, 0x0AU) << "OUT2 error, OUT4 lamp ERR";

  const std::string shown = rig.device.display().data();
  if (row.at("code") == "FFF.F" || row.at("bit").starts_with("2601 ")) {
    EXPECT_EQ(shown, row.at("code"));
  } else if (row.at("bit").starts_with("2602 ")) {
    EXPECT_EQ(shown, "000.1");
    EXPECT_EQ(std::string(products::ismk::display_code(want.words.state_2).data()), row.at("code"));
  }

  // Factory settings of 2605h sub 2 and 5: without 2601h bit 10 and 2602h bits 9 to 11.
  const bool kept = (want.mask_1 & 0xFBFF) != 0 || (want.mask_2 & 0xF1FF) != 0;
  const auto& log = rig.device.alarm_log();
  ASSERT_EQ(log.size(), kept ? 1U : 0U);
  if (kept) {
    EXPECT_EQ(log[0].words.state, want.words.state);
    EXPECT_EQ(log[0].words.state_2, want.words.state_2);
    EXPECT_EQ(log[0].words.extension, want.words.extension);
    EXPECT_EQ(log[0].mode, mode);
    EXPECT_TRUE(log[0].power_stage_on);
  }

  rig.sent.clear();
  if (alarm.gone == Gone::when_removed) {
    reset_edge(rig);
    EXPECT_EQ(drive.state(), PowerState::fault) << "reset with the cause present";
  }
  alarm.remove(rig);
  rig.run_ms(20);
  EXPECT_EQ(drive.state(), PowerState::fault) << "reset without an edge";
  EXPECT_TRUE(test::emergencies(rig, 1).empty());
  reset_edge(rig);
  if (alarm.reset != Reset::by_controlword) {
    EXPECT_EQ(drive.state(), PowerState::fault);
    EXPECT_TRUE(test::emergencies(rig, 1).empty());
    EXPECT_EQ(rig.get(0x2601), want.words.state);
  }
  if (alarm.reset == Reset::by_clearing_turns) {
    set(rig, 0x2690, 0, 10);
    EXPECT_EQ(drive.state(), PowerState::fault);
    reset_edge(rig);
  }
  if (alarm.reset == Reset::by_restart) {
    rig.plant.sample(rig.feedback);
    rig.device.power_off();
    rig.device.power_on(rig.feedback, rig.now());
    rig.drain();
    rig.run_ms(3);
    EXPECT_TRUE(test::emergencies(rig, 1).empty());
  } else {
    EXPECT_EQ(test::emergencies(rig, 1), std::vector<std::string>{emergency(0, 0, {})});
  }
  EXPECT_EQ(drive.state(), PowerState::ready_to_switch_on);
  EXPECT_EQ(rig.get(0x1001), 0);
  EXPECT_EQ(rig.get(0x603F), 0);
  EXPECT_EQ(rig.get(0x2601), 0);
  EXPECT_EQ(rig.get(0x2602), 0);
  EXPECT_EQ(rig.get(0x2605, 7), 0);
  EXPECT_EQ(rig.actuation.outputs & 0x0A, 0U);
  EXPECT_EQ(rig.device.alarm_log().size(), kept ? 1U : 0U) << "the history stays";
}

// 2605h sub 1 and 4: a masked alarm is neither raised nor causes a stop. Later consequences of a damaged encoder are
// another alarm.
void check_masked(const Case& alarm, const test::CsvRow& row) {
  SCOPED_TRACE(std::string("masked ") + alarm.variant);
  const Expected want = expected(row);
  IsmkRig rig;
  set(rig, 0x2605, 1, 0xFFFF & ~want.mask_1);
  set(rig, 0x2605, 4, 0xFFFF & ~want.mask_2);
  alarm.prepare(rig);
  ASSERT_EQ(rig.device.drive().state(), PowerState::operation_enabled) << "not prepared";
  rig.sent.clear();
  alarm.raise(rig);
  rig.run_ms(std::max(20.0, std::min(alarm.within_ms, 200.0)));
  EXPECT_EQ(rig.get(0x2601) & want.mask_1, 0);
  EXPECT_EQ(rig.get(0x2602) & want.mask_2, 0);
  EXPECT_EQ(rig.get(0x2605, 7) & want.words.extension, 0);
  for (const std::string& text : test::emergencies(rig, 1)) {
    EXPECT_NE(text.substr(0, 5), emergency(want.code, 0, {}).substr(0, 5));
  }
  if (alarm.cut == Cut::by_option_code) {
    EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
    EXPECT_TRUE(test::emergencies(rig, 1).empty());
  }
}

// A comparator that is masked and acts first, by one tick, in each phase of the position loop.
TEST(IsmkAlarms, AMaskedComparatorHidesNoOther) {
  constexpr int ticks_of_cycle = 8;
  for (int phase = 0; phase < ticks_of_cycle; ++phase) {
    IsmkRig rig;
    set(rig, 0x2605, 1, 0xFFFF & ~(1 << 7));  // over-current
    turning(rig);
    for (int i = 0; i < phase; ++i) rig.tick();
    for (const Injection injection : {Injection::short_circuit, Injection::gate_supply_low}) {
      rig.plant.inject(injection, true);
      rig.tick();
      rig.plant.inject(injection, false);
    }
    rig.run_ms(2);
    EXPECT_EQ(rig.get(0x2601), 1 << 10) << phase;
  }
}

constexpr std::array<std::int16_t, 4> option_codes{0, 1, 2, 18};

Reset printed_reset(const std::string& text) {
  if (text.starts_with("Fault reset edge")) return Reset::by_controlword;
  return text.starts_with("Write 10 to 2690.00") ? Reset::by_clearing_turns : Reset::by_restart;
}

TEST(IsmkAlarms, EveryRowOfTheManualByItsCause) {
  const std::vector<Case> all = cases();
  std::set<std::string> in_manual;
  for (const test::CsvRow& row : test::read_csv("ismk_alarms.csv")) {
    const std::string place = row.at("bit").empty() ? row.at("code") : row.at("bit");
    in_manual.insert(place);
    SCOPED_TRACE(place + " " + row.at("name"));
    int found = 0;
    for (const Case& alarm : all) {
      if (alarm.place != place) continue;
      ++found;
      EXPECT_EQ(alarm.reset, printed_reset(row.at("reset")));
      for (const std::int16_t option_code : option_codes) check(alarm, row, option_code);
      check_masked(alarm, row);
    }
    EXPECT_GT(found, 0) << "no test";
  }
  EXPECT_EQ(in_manual.size(), 36U);
  for (const Case& alarm : all) EXPECT_TRUE(in_manual.contains(alarm.place)) << alarm.place;
}

// Each row of the drive's table occurs in the manual's table.
TEST(IsmkAlarms, TheDriveHasNoOthers) {
  std::set<std::pair<std::uint16_t, std::uint16_t>> in_manual;  // code, place
  for (const test::CsvRow& row : test::read_csv("ismk_alarms.csv")) {
    const Expected want = expected(row);
    in_manual.insert({want.code, static_cast<std::uint16_t>(want.mask_1 | want.mask_2)});
  }
  for (const drive::FaultRow& row : products::Ismk::policy.faults.rows) {
    const AlarmWords words = products::ismk::words_of(row);
    EXPECT_TRUE(in_manual.contains({row.code, static_cast<std::uint16_t>(words.state | words.state_2)})) << row.name;
  }
}

// 2601h bit 0 shows that 2602h is not 0. If that alarm is masked, the bit is 0; the alarm itself is another bit.
TEST(IsmkAlarms, SummaryBit) {
  IsmkRig rig;
  set(rig, 0x2605, 1, 0xFFFE);
  turning(rig);
  rig.sent.clear();
  rig.device.drive().inject(Cause::current_sensor, true);
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x2601), 0);
  EXPECT_EQ(rig.get(0x2602), 1);
  EXPECT_EQ(test::emergencies(rig, 1), std::vector<std::string>{emergency(0x5210, 0x03, {0, 1, 0})});
}

TEST(IsmkAlarms, SeveralAtATime) {
  IsmkRig rig;
  set(rig, 0x605E, 0, 1);
  turning(rig);
  rig.sent.clear();
  rig.plant.inject(Injection::stage_overheat, true);
  rig.run_ms(10);
  rig.plant.inject(Injection::encoder_loss, true);
  rig.run_ms(3);
  EXPECT_EQ(test::emergencies(rig, 1), (std::vector<std::string>{emergency(0x4210, 0x09, {0x0010, 0, 0}),
                                                                 emergency(0x7331, 0x49, {0x0012, 0, 0})}));
  EXPECT_EQ(rig.get(0x603F), 0x7331);
  EXPECT_EQ(rig.device.alarm_log().size(), 2U);
  rig.plant.inject(Injection::encoder_loss, false);
  rig.run_ms(5);
  reset_edge(rig);
  EXPECT_EQ(rig.get(0x2601), 0x0012) << "one cause of two is there";
  rig.plant.inject(Injection::stage_overheat, false);
  rig.run_ms(5);
  reset_edge(rig);
  EXPECT_EQ(words(rig).state, 0);
}

// The history keeps the last 8 alarms, the newest first, also over power cycles (ch. 10.1).
TEST(IsmkAlarms, HistoryOfEight) {
  IsmkRig rig;
  set(rig, 0x6060, 0, 3);
  const auto causes =
      std::to_array<Cause>({Cause::brake_resistor, Cause::pulse_frequency, Cause::current_sensor, Cause::enable_refused,
                            Cause::communication_lost, Cause::second_encoder_direction,
                            Cause::second_encoder_connection, Cause::second_encoder_count, Cause::current_saturation});
  const auto& log = rig.device.alarm_log();
  for (std::size_t i = 0; i < causes.size(); ++i) {
    ASSERT_TRUE(rig.enable());
    rig.device.drive().raise(causes[i]);
    rig.run_ms(3);
    EXPECT_EQ(log.size(), std::min<std::size_t>(8, i + 1));
    reset_edge(rig);
  }
  const auto bit_of = [](Cause cause) {
    for (const drive::FaultRow& row : products::Ismk::policy.faults.rows) {
      if (row.cause == cause) return products::ismk::words_of(row);
    }
    return AlarmWords{};
  };
  for (std::size_t i = 0; i < 8; ++i) {
    const AlarmWords want = bit_of(causes[causes.size() - 1 - i]);
    EXPECT_EQ(log[i].words.state | 1, want.state | 1) << i;
    EXPECT_EQ(log[i].words.state_2, want.state_2) << i;
    EXPECT_EQ(log[i].words.extension, want.extension) << i;
  }
  rig.device.power_off();
  rig.device.power_on(rig.feedback, rig.now());
  EXPECT_EQ(log.size(), 8U);
}

TEST(IsmkAlarms, HistoryRecordsTheMoment) {
  IsmkRig rig;
  turning_under_load(rig);
  rig.plant.inject(Injection::winding_overheat, true);
  ASSERT_GE(rig.run_until([&] { return wrong(rig); }, 100.0), 0);
  const auto& record = rig.device.alarm_log()[0];
  EXPECT_NEAR(record.velocity_rpm, 600.0F, 10.0F);
  EXPECT_NEAR(record.dc_link_v, 48.0F, 1.0F);
  EXPECT_NEAR(record.temperature_c, 180.0F, 0.1F);
  // 0.6 Nm of load plus a little friction, divided by the torque constant.
  EXPECT_NEAR(record.current_a, 0.61F / rig.device.rating().motor.torque_constant_nm_per_a, 0.6F);
  EXPECT_EQ(record.mode, 3);
  EXPECT_TRUE(record.power_stage_on);
}

// 2605h sub 2, 3, 5, 6: which alarms are stored in the history, while the motor is enabled and while it is not.
TEST(IsmkAlarms, StoreMasks) {
  struct Row {
    Cause cause;
    std::uint8_t on_sub;
    std::uint8_t off_sub;
    std::uint16_t bit;
    bool kept_on;   // factory setting
    bool kept_off;  //
  };
  for (const Row& row :
       {Row{Cause::brake_resistor, 2, 3, 1U << 8, true, false}, Row{Cause::gate_supply, 2, 3, 1U << 10, false, false},
        Row{Cause::current_sensor, 5, 6, 1U << 0, true, true}, Row{Cause::enable_refused, 5, 6, 1U << 8, true, false},
        Row{Cause::positive_limit, 5, 6, 1U << 9, false, false}}) {
    for (const bool enabled : {true, false}) {
      for (const bool toggled : {false, true}) {
        IsmkRig rig;
        set(rig, 0x6060, 0, 3);
        const std::uint8_t sub = enabled ? row.on_sub : row.off_sub;
        if (toggled) set(rig, 0x2605, sub, rig.get(0x2605, sub) ^ row.bit);
        ASSERT_EQ(enabled && rig.enable(), enabled);
        rig.device.drive().raise(row.cause);
        rig.run_ms(3);
        EXPECT_EQ(rig.device.drive().state(), PowerState::fault);
        EXPECT_EQ(rig.device.alarm_log().size() == 1, (enabled ? row.kept_on : row.kept_off) != toggled)
            << drive::name(row.cause) << " " << enabled << toggled;
      }
    }
  }
}

// 6007h = 0, the default: the loss of the master is not an alarm (Table 9-26).
TEST(IsmkAlarms, LostMasterIsIgnoredUnlessAsked) {
  IsmkRig rig;
  set(rig, 0x100C, 0, 50);
  turning(rig);
  rig.send(0x000, {0x01, 0x01});
  rig.send(0x701, {}, true);
  rig.sent.clear();
  rig.run_ms(400);
  EXPECT_EQ(rig.device.node().nmt_state(), canopen::NmtState::operational);
  EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
  EXPECT_TRUE(test::emergencies(rig, 1).empty());
  EXPECT_EQ(rig.get(0x1001), 0);
}

// The alarm for damaged values needs damaged values: the stored data are damaged before power-on.
TEST(IsmkAlarms, DamagedMemory) {
  std::array<std::byte, 16384> bytes{};
  dictionary::RamMedium medium(bytes);
  products::Settings settings = test::ismk_settings();
  settings.store = &medium;
  {
    IsmkRig fresh(test::ismk_plant(), settings);
    fresh.run_ms(3);
    EXPECT_EQ(fresh.get(0x2601), 0) << "nothing stored is no damage";
    ASSERT_EQ(dictionary::Store(medium).save(fresh.device.dictionary(), dictionary::Area::all), AbortCode::none);
  }
  {
    IsmkRig stored(test::ismk_plant(), settings);
    stored.run_ms(3);
    EXPECT_EQ(stored.get(0x2601), 0);
  }
  // A bit of the bank that contains the values.
  for (const std::size_t bank : {std::size_t{0}, bytes.size() / 2}) bytes[bank + 40] ^= std::byte{1};
  IsmkRig damaged(test::ismk_plant(), settings);
  damaged.run_ms(3);
  EXPECT_EQ(damaged.get(0x2601), 0x8000);
  EXPECT_EQ(damaged.get(0x603F), 0x6310);
  EXPECT_EQ(damaged.device.drive().state(), PowerState::fault);
  EXPECT_EQ(test::emergencies(damaged, 1), std::vector<std::string>{emergency(0x6310, 0x01, {0x8000, 0, 0})});
  reset_edge(damaged);
  EXPECT_EQ(damaged.device.drive().state(), PowerState::fault);
  ASSERT_EQ(dictionary::Store(medium).save(damaged.device.dictionary(), dictionary::Area::all), AbortCode::none);
  damaged.device.power_on(damaged.feedback, damaged.now());
  damaged.run_ms(3);
  EXPECT_EQ(damaged.get(0x2601), 0);
}

// 2FF0h sub 10h and 11h. The motor can carry its rated current permanently, the power stage its continuous current.
TEST(IsmkAlarms, UtilisationOfMotorAndDrive) {
  IsmkRig rig("40-010");
  rig.plant.lock_rotor(true);
  set(rig, 0x6060, 0, 4);
  ASSERT_TRUE(rig.enable());
  EXPECT_EQ(rig.get(0x2FF0, 0x10), 0);
  EXPECT_EQ(rig.get(0x2FF0, 0x11), 0);
  set(rig, 0x6071, 0, 700);
  rig.run_ms(130000.0);
  // 0.7 of 6 A, the motor's rated current, and of 4 Arms.
  EXPECT_NEAR(static_cast<double>(rig.get(0x2FF0, 0x10)), 49.0, 1.0);
  EXPECT_NEAR(static_cast<double>(rig.get(0x2FF0, 0x11)), 100.0 * std::pow(4.2 / (4.0 * std::sqrt(2.0)), 2), 1.0);
  set(rig, 0x6071, 0, 980);
  ASSERT_GE(rig.run_until([&] { return wrong(rig); }, 60000.0), 0) << "the drive is full before the motor";
  EXPECT_EQ(rig.get(0x2601), 0x0800);
  EXPECT_LT(rig.get(0x2FF0, 0x10), 100);
  EXPECT_GE(rig.get(0x2FF0, 0x11), 99);
}

}  // namespace
}  // namespace ismk_alarms_test
}  // namespace servodrome
