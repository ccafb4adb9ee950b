#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <gtest/gtest.h>
#include <numbers>
#include <vector>

#include "ismk_rig.hpp"
#include "products/ismk/gains.hpp"

// Gains of the iSMK in the manual's units (chapter 6).
namespace servodrome {
namespace ismk_gains_test {
namespace {

using dictionary::AbortCode;
using drive::VelocityFeedback;
using test::FactoryIsmkRig;
using test::IsmkRig;

constexpr double pi = std::numbers::pi;

const drive::MotorData& motor_of(std::string_view rating) {
  return products::find_model(products::ismk::ratings, rating)->motor;
}
const drive::Gains& gains_of(FactoryIsmkRig& rig) { return rig.device.drive().configuration().gains; }

TEST(IsmkGains, KvpIsTheManualsFormula) {
  // The constant follows from the units of the manual: see gains.hpp.
  EXPECT_DOUBLE_EQ(4.0 * 1.414 * 2048.0 / 16.384 * 1e-4 * 262144.0 * 10.0, 1.853358080e5);
  // Ch. 6.2.1 for the 60-040: J 0.31 kg cm^2, Kt 3.81 Nm / 48 Ap, Imax 48.0 Ap.
  const double kt = 3.81 / (48.0 / std::numbers::sqrt2) * 100.0;
  const double expected = 1.853358080e5 * 31.0 * pi * pi * 100.0 / (480.0 * kt * 65536.0);
  const double kvp = products::ismk::kvp_of_bandwidth(100.0, 0.31e-4, motor_of("60-040"));
  EXPECT_NEAR(kvp, expected, 1e-6 * expected);
  EXPECT_NEAR(kvp, 16.06, 0.01);
  for (const products::Model& model : products::ismk::ratings) {
    const auto inertia = static_cast<double>(model.motor.inertia_kgm2);
    EXPECT_NEAR(products::ismk::bandwidth_of_kvp(products::ismk::kvp_of_bandwidth(70.0, inertia, model.motor), inertia,
                                                 model.motor),
                70.0, 1e-9);
    // In physical units: the loop's gain is 1 at the bandwidth. The manual's factor 1.414 causes an error of 0.02 %.
    const double kp =
        products::ismk::kvp_of_bandwidth(70.0, inertia, model.motor) * products::ismk::velocity_kp_unit(model.motor);
    const double crossover = kp * static_cast<double>(model.motor.torque_constant_nm_per_a) / inertia;
    EXPECT_NEAR(crossover, 2.0 * pi * 70.0, 0.0003 * crossover) << model.name;
  }
}

TEST(IsmkGains, UnitsOfTheTable) {
  FactoryIsmkRig rig;
  rig.run_ms(2);
  const double unit = products::ismk::velocity_kp_unit(motor_of("60-040"));
  EXPECT_FLOAT_EQ(gains_of(rig).velocity_kp, static_cast<float>(4.0 * unit));  // factory: kvp 4, Kvi 0, Kvi/32 2
  EXPECT_FLOAT_EQ(gains_of(rig).velocity_ki, static_cast<float>(2.0 / 32.0 * 4000.0 * unit));
  EXPECT_FLOAT_EQ(gains_of(rig).position_kp, static_cast<float>(2.0 * pi * 10.0));  // 1000 is 10.00 Hz (Table 6-5)
  EXPECT_FLOAT_EQ(gains_of(rig).velocity_feed_forward, 1.0F);
  EXPECT_FLOAT_EQ(gains_of(rig).acceleration_feed_forward, 0.0F);
  EXPECT_FLOAT_EQ(gains_of(rig).velocity_filter_hz, 240.0F);  // N = 7 (ch. 7.7, 60F9.05)
  EXPECT_FLOAT_EQ(gains_of(rig).torque_filter_hz, 0.0F);      // 1 DEC closes the filter (ch. 6.2.1)
  EXPECT_FLOAT_EQ(gains_of(rig).velocity_integral_limit_a, 0.0F);

  for (const int n : {0, 7, 45}) {
    rig.set(0x60F9, 5, n);
    EXPECT_FLOAT_EQ(gains_of(rig).velocity_filter_hz, static_cast<float>(100 + 20 * n));
  }
  for (const int n : {2, 5, 25}) {  // 2546 / DEC (ch. 6.2.1)
    rig.set(0x60F9, 0x15, n);
    EXPECT_NEAR(static_cast<double>(gains_of(rig).torque_filter_hz), 2546.0 / n, 0.5 / n);
  }
  rig.set(0x60F9, 2, 3);
  rig.set(0x60F9, 7, 16);
  EXPECT_FLOAT_EQ(gains_of(rig).velocity_ki, static_cast<float>(3.5 * 4000.0 * unit));
  EXPECT_EQ(rig.get(0x2FF0, 0x19), 3 * 32 + 16);
  rig.set(0x2FF0, 0x19, 200);  // Table 6-2
  EXPECT_EQ(rig.get(0x60F9, 2), 0);
  EXPECT_EQ(rig.get(0x60F9, 7), 200);
  EXPECT_FLOAT_EQ(gains_of(rig).velocity_ki, static_cast<float>(200.0 / 32.0 * 4000.0 * unit));
  rig.set(0x60F9, 8, 1024);  // half of 2048, of 48 Ap
  EXPECT_FLOAT_EQ(gains_of(rig).velocity_integral_limit_a, 24.0F);
  rig.set(0x60FB, 1, 2550);
  EXPECT_FLOAT_EQ(gains_of(rig).position_kp, static_cast<float>(2.0 * pi * 25.5));
  rig.set(0x2FF0, 0x1A, 850);  // Table 6-5
  EXPECT_FLOAT_EQ(gains_of(rig).velocity_feed_forward, 0.85F);
  EXPECT_EQ(rig.get(0x60FB, 2), 850);

  // Velocity_BW and kvp are two forms of one value (Table 6-2), for the known inertia, which is the rotor's.
  rig.set(0x2FF0, 0x0A, 100);
  EXPECT_EQ(rig.get(0x60F9, 1), 16);
  EXPECT_EQ(rig.get(0x2FF0, 0x0A), 100);
  rig.set(0x60F9, 1, 32);
  EXPECT_EQ(rig.get(0x2FF0, 0x0A), 199);

  // ACC % = 6746518 / K_Acc_FF / Easy_Kload x 100 (ch. 6.2.2): a smaller value is stronger.
  const double full = products::ismk::full_acceleration_feed_forward(0.31e-4, motor_of("60-040"));
  rig.set(0x2FF0, 0x1B, 1000);
  EXPECT_EQ(rig.get(0x60FB, 3), std::lround(full));
  EXPECT_NEAR(static_cast<double>(gains_of(rig).acceleration_feed_forward), 1.0, 1e-4);
  EXPECT_NEAR(6746518.0 / full / products::ismk::easy_kload(full) * 100.0, 100.0, 1e-9);
  rig.set(0x60FB, 3, std::lround(full / 2.0));
  EXPECT_EQ(rig.get(0x2FF0, 0x1B), 2000);
  EXPECT_NEAR(static_cast<double>(gains_of(rig).acceleration_feed_forward), 2.0, 1e-3);
  rig.set(0x2FF0, 0x1B, 0);
  EXPECT_EQ(rig.get(0x60FB, 3), 32767);
  EXPECT_FLOAT_EQ(gains_of(rig).acceleration_feed_forward, 0.0F);
}

TEST(IsmkGains, SpeedModesAreThePrintedOnes) {  // Table 6-2
  FactoryIsmkRig rig;
  rig.run_ms(2);
  struct Case {
    int code;
    VelocityFeedback feedback;
    float filter_hz, command_hz;
  };
  for (const Case& c : {Case{0, VelocityFeedback::second_order, 240.0F, 0.0F},
                        {1, VelocityFeedback::first_order, 0.0F, 0.0F},
                        {2, VelocityFeedback::observer, 240.0F, 0.0F},
                        {4, VelocityFeedback::first_order, 240.0F, 0.0F},
                        {10, VelocityFeedback::second_order, 240.0F, 240.0F},
                        {11, VelocityFeedback::first_order, 0.0F, 240.0F},
                        {12, VelocityFeedback::observer, 240.0F, 240.0F},
                        {14, VelocityFeedback::first_order, 240.0F, 240.0F}}) {
    for (const int fast : {0, 0x80}) {
      EXPECT_EQ(rig.set(0x60F9, 6, c.code | fast), AbortCode::none);
      EXPECT_EQ(gains_of(rig).velocity_feedback, c.feedback) << c.code;
      EXPECT_FLOAT_EQ(gains_of(rig).velocity_filter_hz, c.filter_hz) << c.code;
      EXPECT_FLOAT_EQ(gains_of(rig).velocity_command_filter_hz, c.command_hz) << c.code;
      EXPECT_DOUBLE_EQ(rig.device.drive().axis().cycle_s, fast != 0 ? 0.5e-3 : 1e-3) << "2 or 1 kHz";
    }
  }
  for (const int code : {3, 5, 9, 13, 15, 64, 0x83}) EXPECT_EQ(rig.set(0x60F9, 6, code), AbortCode::value_invalid);
  // The rates of a motor with power do not change until it is off.
  rig.set(0x60F9, 6, 0);
  ASSERT_TRUE(rig.enable());
  rig.set(0x60F9, 6, 0x80);
  rig.run_ms(5);
  EXPECT_DOUBLE_EQ(rig.device.drive().axis().cycle_s, 1e-3);
  rig.control(0x06);
  rig.run_ms(5);
  EXPECT_DOUBLE_EQ(rig.device.drive().axis().cycle_s, 0.5e-3);
}

TEST(IsmkGains, NotchesByTheirCode) {  // ch. 6.2.1
  FactoryIsmkRig rig;
  rig.run_ms(2);
  rig.set(0x60F9, 3, 700);
  rig.set(0x250B, 1, 800);
  rig.set(0x250B, 2, 900);
  rig.set(0x250B, 3, 1000);
  const auto frequencies = [&] {
    std::array<float, 4> hz{};
    for (std::size_t i = 0; i < 4; ++i) hz[i] = gains_of(rig).notches[i].frequency_hz;
    return hz;
  };
  EXPECT_EQ(frequencies(), (std::array<float, 4>{}));
  rig.set(0x60F9, 4, 1);
  EXPECT_EQ(frequencies(), (std::array<float, 4>{700.0F}));
  rig.set(0x60F9, 4, 2);
  EXPECT_EQ(frequencies(), (std::array<float, 4>{700.0F, 800.0F}));
  rig.set(0x60F9, 4, 3);
  EXPECT_EQ(frequencies(), (std::array<float, 4>{700.0F, 800.0F, 900.0F, 1000.0F}));
  rig.set(0x250B, 2, 1751);
  EXPECT_EQ(frequencies(), (std::array<float, 4>{700.0F, 800.0F, 0.0F, 1000.0F}));
}

// Random writes to the loops while the axis runs, in any order: all values stay finite.
TEST(IsmkGains, NoValueMakesTheLoopsLoseTheirNumbers) {
  std::vector<const dictionary::Entry*> entries;
  for (const dictionary::Entry& entry : products::Ismk::table) {
    const bool loops = entry.index == 0x60F9 || entry.index == 0x60FB || entry.index == 0x250B ||
                       (entry.index == 0x2340 && entry.sub >= 4) || (entry.index == 0x2FF0 && entry.sub >= 0x0A);
    if (loops && entry.writable()) entries.push_back(&entry);
  }
  ASSERT_GT(entries.size(), 30U);
  std::uint32_t seed = 12345;
  const auto random = [&seed] { return seed = seed * 1664525U + 1013904223U, seed >> 8; };
  IsmkRig rig;
  rig.set(0x6060, 0, 3);
  rig.set(0x60FF, 0, std::llround(products::ismk::velocity_dec_from_rpm(200.0)));
  int enabled = 0;
  for (int i = 0; i < 4000; ++i) {
    if (i % 100 == 0) {
      rig.control(0x86);
      rig.run_ms(2);
      enabled += rig.enable() ? 1 : 0;
    }
    const dictionary::Entry& entry = *entries[random() % entries.size()];
    const std::int64_t low = entry.has_range ? entry.minimum : dictionary::minimum_of(entry.type);
    const std::int64_t high = entry.has_range ? entry.maximum : dictionary::maximum_of(entry.type);
    const std::int64_t value = random() % 4 == 0
                                   ? (random() % 2 == 0 ? low : high)
                                   : low + static_cast<std::int64_t>(random() % 1000) * (high - low) / 1000;
    rig.set(entry.index, entry.sub, value);
    rig.run_ms(1);
    ASSERT_TRUE(std::isfinite(rig.device.drive().loops().torque_reference))
        << std::hex << entry.index << "h:" << int{entry.sub} << " = " << value;
    ASSERT_TRUE(std::isfinite(rig.device.drive().loops().velocity_counts_per_s));
  }
  EXPECT_GT(enabled, 20);
}

// --- Bandwidth by frequency response

// The velocity loop of an axis in mode 3 without ramps; the reference is a sine around 300 rpm.
struct Response {
  std::complex<double> closed;  // speed by reference
  std::complex<double> open;
};
Response response(FactoryIsmkRig& rig, double hz) {
  const double cycle_s = rig.device.drive().axis().cycle_s;
  const auto cycle_ticks = static_cast<int>(std::lround(cycle_s / drive::tick_seconds));
  const int cycles = static_cast<int>(std::lround(std::max(6.0, 0.3 * hz) / (hz * cycle_s)));
  const double w = 2.0 * pi * hz;
  std::complex<double> in = 0.0;
  std::complex<double> out = 0.0;
  std::int64_t tick = 0;
  const int settle = static_cast<int>(0.15 / cycle_s);
  for (int k = -settle; k < cycles; ++k) {
    const double rpm = 300.0 + 40.0 * std::sin(w * k * cycle_s);
    rig.set(0x60FF, 0, std::llround(products::ismk::velocity_dec_from_rpm(rpm)));
    for (int i = 0; i < cycle_ticks; ++i) {
      const double speed = rig.plant.velocity_rpm();
      rig.tick();
      if (k < 0) continue;
      const std::complex<double> turn = std::polar(1.0, -w * static_cast<double>(tick++) * drive::tick_seconds);
      const double window = 1.0 - std::cos(2.0 * pi * static_cast<double>(tick) / (cycles * cycle_ticks));
      in += window * turn *
            (static_cast<double>(rig.device.drive().loops().velocity_reference_counts_per_s) * 60.0 / 65536.0 - 300.0);
      out += window * turn * (speed - 300.0);
    }
  }
  // Corrections for a velocity period of two ticks: the reference counts as held, which is half a tick late on average;
  // the measured speed is a difference over the period and half a period late.
  in *= std::polar(1.0, w * 0.5 * drive::tick_seconds);
  const std::complex<double> measured = std::polar(1.0, -w * drive::tick_seconds);
  const std::complex<double> closed = out / in;
  return {closed, closed / (1.0 - closed * measured)};
}

// A P loop without feedback filter on the bare rotor, for any kvp: its gain is 1 at the frequency of the formula. The
// -3 dB frequency of the closed loop is a little higher, and increases with the influence of the delays of sampling and
// current loop.
TEST(IsmkGains, BandwidthIsWhatTheFormulaSays) {
  for (const products::Model& model : products::ismk::ratings) {
    plant::Parameters parameters = test::ismk_plant(model.name);
    parameters.load.inertia_kgm2 = 0.0;
    parameters.load.coulomb_friction_nm = parameters.load.static_friction_nm = 0.0;
    for (const double wanted_hz : {25.0, 50.0, 100.0}) {
      FactoryIsmkRig rig(parameters, test::ismk_settings(model.name));
      rig.set(0x6060, 0, 3);
      rig.set(0x6083, 0, 1000000000);  // practically none
      rig.set(0x6084, 0, 1000000000);
      rig.set(0x60F9, 6, 0x81);
      rig.set(0x2FF0, 0x19, 0);
      rig.set(0x2FF0, 0x0A, static_cast<std::int64_t>(wanted_hz));
      ASSERT_TRUE(rig.enable());
      const auto kvp = static_cast<double>(rig.get(0x60F9, 1));
      const double formula_hz =
          products::ismk::bandwidth_of_kvp(kvp, static_cast<double>(model.motor.inertia_kgm2), model.motor);
      const double crossover_hz = formula_hz * std::abs(response(rig, formula_hz).open);  // |open| falls as 1/f
      double low = 0.5 * formula_hz;
      double high = 2.0 * formula_hz;
      for (int i = 0; i < 7; ++i) {
        const double middle = 0.5 * (low + high);
        (std::abs(response(rig, middle).closed) > std::numbers::sqrt2 / 2.0 ? low : high) = middle;
      }
      std::printf("%s kvp %3.0f: formula %6.2f Hz, crossover %6.2f Hz (%+.1f %%), -3 dB at %6.2f Hz\n",
                  model.name.data(), kvp, formula_hz, crossover_hz, 100.0 * (crossover_hz / formula_hz - 1.0), low);
      EXPECT_NEAR(crossover_hz, formula_hz, 0.02 * formula_hz);
      if (formula_hz < 60.0) {
        EXPECT_NEAR(low, formula_hz, 0.1 * formula_hz);
      }
    }
  }
}

// --- Gain sets

struct Sets : IsmkRig {
  Sets() {
    set(0x2340, 4, 40);
    set(0x2340, 5, 2);
    set(0x2340, 6, 3000);
    set(0x2340, 7, 60);
    set(0x2340, 8, 3);
    set(0x2340, 9, 4000);
    set(0x2340, 0x0A, 80);
    set(0x2340, 0x0B, 4);
    set(0x2340, 0x0C, 5000);
    run_ms(2);
  }
  // The set whose gains the loops have; -1: no set.
  int in_force() {
    const double unit = products::ismk::velocity_kp_unit(motor_of("60-040"));
    const drive::Gains& gains = gains_of(*this);
    const std::int64_t kvp[] = {get(0x60F9, 1), get(0x2340, 4), get(0x2340, 7), get(0x2340, 0x0A)};
    const std::int64_t kpp[] = {get(0x60FB, 1), get(0x2340, 6), get(0x2340, 9), get(0x2340, 0x0C)};
    for (int i = 0; i < 4; ++i) {
      const bool kp = std::fabs(static_cast<double>(gains.velocity_kp) / unit - static_cast<double>(kvp[i])) < 1e-3;
      const bool kx =
          std::fabs(static_cast<double>(gains.position_kp) - 2.0 * pi * 0.01 * static_cast<double>(kpp[i])) < 1e-3;
      const double kvi = i == 0 ? static_cast<double>(get(0x60F9, 7)) / 32.0 : i + 1.0;
      const bool ki = std::fabs(static_cast<double>(gains.velocity_ki) / unit / 4000.0 - kvi) < 1e-3;
      if (kp && kx && ki) return i;
    }
    return -1;
  }
};

TEST(IsmkGainSets, WrittenPointer) {  // method 3 (ch. 6.4)
  Sets rig;
  EXPECT_EQ(rig.in_force(), 0);
  for (const int set : {1, 2, 3, 0}) {
    EXPECT_EQ(rig.set(0x60F9, 0x28, set), AbortCode::none);
    rig.run_ms(2);
    EXPECT_EQ(rig.get(0x60F9, 0x28), set);
    EXPECT_EQ(rig.in_force(), set);
  }
  EXPECT_EQ(rig.set(0x60F9, 0x28, 4), AbortCode::value_too_high);
}

TEST(IsmkGainSets, Inputs) {  // method 1 (ch. 6.3.1)
  Sets rig;
  rig.plant.force_input(0, false);
  rig.plant.force_input(1, false);
  rig.set(0x2010, 3, 0x8020);
  rig.set(0x2010, 4, 0x8040);
  rig.set(0x60F9, 9, 1);  // it selects the set, unless inputs do (ch. 6.3.1)
  for (const unsigned set : {1U, 2U, 3U, 0U}) {
    rig.plant.force_input(0, (set & 1) != 0);
    rig.plant.force_input(1, (set & 2) != 0);
    rig.run_ms(2);
    EXPECT_EQ(rig.get(0x60F9, 0x28), set);
    EXPECT_EQ(rig.in_force(), static_cast<int>(set));
  }
}

TEST(IsmkGainSets, AutomaticByTargetReached) {  // method 2 (ch. 6.3.1)
  Sets rig;
  rig.set(0x60F9, 9, 1);
  rig.set(0x6060, 0, 1);
  rig.set(0x6081, 0, std::llround(products::ismk::velocity_dec_from_rpm(300.0)));
  rig.set(0x607A, 0, 65536);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(30);
  EXPECT_EQ(rig.in_force(), 1) << "at rest";
  rig.control(0x2F);
  rig.control(0x3F);
  rig.run_ms(60);
  EXPECT_EQ(rig.in_force(), 0) << "on the way";
  rig.run_ms(600);
  EXPECT_EQ(rig.in_force(), 1) << "arrived";
  EXPECT_EQ(rig.get(0x60F9, 0x28), 1);
  rig.set(0x60F9, 9, 0);
  rig.run_ms(2);
  EXPECT_EQ(rig.in_force(), 0);
}

// The manual prints factory values for set 0 only. The others have the same, and none of them is without gain.
TEST(IsmkGainSets, FactorySetsHoldALoad) {
  struct Case {
    const char* what;
    std::uint16_t index;
    std::uint8_t sub;
    std::int64_t value;
  };
  for (const Case& c : {Case{"set 1", 0x60F9, 0x28, 1}, Case{"set 2", 0x60F9, 0x28, 2}, Case{"set 3", 0x60F9, 0x28, 3},
                        Case{"automatic", 0x60F9, 9, 1}, Case{"input", 0x2010, 3, 0x8020}}) {
    SCOPED_TRACE(c.what);
    FactoryIsmkRig rig(test::hanging(test::ismk_plant(), 0.3, 1.5), test::ismk_settings());
    rig.run_ms(5);
    rig.set(0x6410, 0x17, 1);  // the brake
    rig.set(0x6060, 0, 1);
    rig.plant.force_input(0, true);
    ASSERT_TRUE(rig.enable());
    rig.run_ms(1500);
    const double there = static_cast<double>(rig.plant.position_counts()) / 65536.0;
    ASSERT_EQ(rig.set(c.index, c.sub, c.value), AbortCode::none);
    // Without the integral, which only set 0 has from the factory, the position loop yields.
    double farthest = 0.0;
    for (int i = 0; i < 1500; ++i) {
      rig.run_ms(1);
      farthest = std::max(farthest, std::abs(static_cast<double>(rig.plant.position_counts()) / 65536.0 - there));
    }
    EXPECT_LT(farthest, 0.4);
    EXPECT_EQ(rig.device.drive().state(), drive::PowerState::operation_enabled);
  }
  FactoryIsmkRig rig;
  for (const int sub : {4, 7, 10}) {
    EXPECT_EQ(rig.set(0x2340, static_cast<std::uint8_t>(sub), 0), AbortCode::value_too_low);
    EXPECT_EQ(rig.get(0x2340, static_cast<std::uint8_t>(sub)), 4);
    EXPECT_EQ(rig.get(0x2340, static_cast<std::uint8_t>(sub + 2)), 1000);
  }
}

// While the axis moves against friction, a change of sets causes no step of torque.
TEST(IsmkGainSets, SwitchWithoutABump) {
  Sets rig;
  rig.set(0x6060, 0, 3);
  rig.set(0x60FF, 0, std::llround(products::ismk::velocity_dec_from_rpm(500.0)));
  ASSERT_TRUE(rig.enable());
  rig.plant.set_external_torque_nm(0.4);
  rig.run_ms(600);
  const auto greatest_step = [&](int ticks) {
    double worst = 0.0;
    for (int i = 0; i < ticks; ++i) {
      const float before = rig.device.drive().loops().torque_reference;
      rig.tick();
      worst = std::max(worst, static_cast<double>(std::fabs(rig.device.drive().loops().torque_reference - before)));
    }
    return worst;
  };
  const double quiet = greatest_step(160);
  for (const int set : {1, 3, 2, 0, 3}) {
    rig.set(0x60F9, 0x28, set);
    // The noise of the encoder's counts grows with kvp; a step of the load itself would be 0.31.
    EXPECT_LT(greatest_step(160), quiet + 0.03) << set;
    rig.run_ms(50);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 500.0, 2.0) << set;
  }
}

}  // namespace
}  // namespace ismk_gains_test
}  // namespace servodrome
