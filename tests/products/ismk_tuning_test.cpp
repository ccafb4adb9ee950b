#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <numbers>

#include "ismk_rig.hpp"
#include "products/ismk/gains.hpp"

// Automatic tuning of the iSMK: 2340h sub 10h, inertia identification and rigidity, automatic notches.
namespace servodrome {
namespace ismk_tuning_test {
namespace {

using dictionary::AbortCode;
using drive::InertiaIdentification;
using products::ismk::LoopTuning;
using test::FactoryIsmkRig;

constexpr double rotor_kgm2 = 0.31e-4;  // 60-040

plant::Parameters loaded(double load_ratio) {
  plant::Parameters parameters = test::ismk_plant();
  parameters.load.inertia_kgm2 = load_ratio * rotor_kgm2;
  parameters.load.viscous_friction_nms = 2.0e-4;
  parameters.load.coulomb_friction_nm = 0.04;
  parameters.load.static_friction_nm = 0.06;
  // There is no internal chopper (ch. 1.3.1): the energy of heavy loads flows into a supply that other drives share.
  parameters.supply.capacitance_f = 0.1;
  return parameters;
}

struct TuningRig : FactoryIsmkRig {
  explicit TuningRig(const plant::Parameters& parameters, std::string_view rating = products::ismk::default_rating)
      : FactoryIsmkRig(parameters, test::ismk_settings(rating)) {
    set(0x6060, 0, 1);
    set(0x6081, 0, std::llround(products::ismk::velocity_dec_from_rpm(1000.0)));
    EXPECT_TRUE(enable());
    run_ms(50);
  }
  const LoopTuning& tuning() { return device.loop_tuning(); }
  double error_percent(double load_ratio) {
    return 100.0 * (tuning().inertia_kgm2() / ((1.0 + load_ratio) * rotor_kgm2) - 1.0);
  }

  struct Move {
    double overshoot_percent = 0.0;  // beyond the target, in percent of the move's length
    double settled_ms = -1.0;        // from the start until it stays within 6067h
  };
  // One revolution relative to the last target, at 1000 rpm and 100 rps/s.
  Move turn(int revolutions = 1) {
    goal += revolutions * 65536;
    control(0x2F);
    set(0x607A, 0, goal);
    control(0x3F);
    Move move;
    for (int i = 0; i < 700 * 16; ++i) {
      tick();
      const double ahead = static_cast<double>(plant.position_counts()) - static_cast<double>(goal);
      const double beyond = revolutions > 0 ? ahead : -ahead;
      move.overshoot_percent = std::max(move.overshoot_percent, 100.0 * beyond / (std::abs(revolutions) * 65536.0));
      if (std::fabs(ahead) > 327.0)
        move.settled_ms = -1.0;
      else if (move.settled_ms < 0.0)
        move.settled_ms = i / 16.0;
    }
    return move;
  }
  std::int64_t goal = 0;
};

// The master moves the axis back and forth; the drive observes the motion and adapts.
TEST(IsmkAutoTuning, OnlineForLoadsOfHalfToTwentyRotors) {
  for (const double ratio : {0.5, 1.0, 2.0, 5.0, 10.0, 20.0}) {
    TuningRig rig(loaded(ratio));
    const TuningRig::Move before = rig.turn();
    EXPECT_FALSE(rig.tuning().identified());
    EXPECT_EQ(rig.get(0x60F9, 1), 4);
    rig.set(0x2340, 0x10, 7);  // tune, kvp, acceleration feed-forward
    for (int i = 0; i < 4; ++i) rig.turn(i % 2 == 0 ? -2 : 2);
    ASSERT_TRUE(rig.tuning().identified()) << ratio;
    EXPECT_NEAR(rig.error_percent(ratio), 0.0, 5.0) << ratio;
    const TuningRig::Move after = rig.turn();
    std::printf(
        "load %4.1f rotors: inertia %+5.2f %%, kvp %3d, K_Acc_FF %4d; one revolution: overshoot %.2f %% before, "
        "%.2f %% after, settled %.0f ms before, %.0f ms after\n",
        ratio, rig.error_percent(ratio), static_cast<int>(rig.get(0x60F9, 1)), static_cast<int>(rig.get(0x60FB, 3)),
        before.overshoot_percent, after.overshoot_percent, before.settled_ms, after.settled_ms);
    EXPECT_LE(after.overshoot_percent, 2.0) << ratio;
    EXPECT_GT(after.settled_ms, 0.0);
  }
}

TEST(IsmkAutoTuning, DoesWhatItsBitsSay) {  // Table 6-1
  const auto after_moves = [](int control, int revolutions) {
    TuningRig rig(loaded(3.0));
    rig.set(0x2340, 0x10, control);
    for (int i = 0; i < 4; ++i) rig.turn(revolutions);
    return std::array<std::int64_t, 3>{rig.tuning().identified() ? 1 : 0, rig.get(0x60F9, 1), rig.get(0x60FB, 3)};
  };
  using Result = std::array<std::int64_t, 3>;
  EXPECT_EQ(after_moves(12, 1), (Result{0, 4, 32767})) << "factory: off";
  EXPECT_EQ(after_moves(0x01, 1), (Result{1, 4, 32767})) << "identify only";
  EXPECT_EQ(after_moves(0x03, 1), (Result{1, 16, 32767}));
  EXPECT_EQ(after_moves(0x05, 1)[1], 4);
  EXPECT_NEAR(static_cast<double>(after_moves(0x05, 1)[2]), 2564.0, 50.0);
  EXPECT_EQ(after_moves(0x11, 1)[0], 0) << "not forward";
  EXPECT_EQ(after_moves(0x11, -1)[0], 1);
  EXPECT_EQ(after_moves(0x21, 1)[0], 1) << "not reverse";
  EXPECT_EQ(after_moves(0x21, -1)[0], 0);
}

// The bandwidth (Velocity_BW) is kept, and the gain kvp follows the identified load (Table 6-2).
TEST(IsmkAutoTuning, FollowsALoadThatChanges) {
  TuningRig rig(loaded(1.0));
  rig.set(0x2FF0, 0x0A, 30);
  rig.set(0x2340, 0x10, 7);
  for (int i = 0; i < 4; ++i) rig.turn(i % 2 == 0 ? 1 : -1);
  EXPECT_NEAR(rig.error_percent(1.0), 0.0, 5.0);
  EXPECT_EQ(rig.get(0x2FF0, 0x0A), 30);
  const std::int64_t light = rig.get(0x60F9, 1);
  rig.plant.set_load_inertia_kgm2(4.0 * rotor_kgm2);
  for (int i = 0; i < 60; ++i) rig.turn(i % 2 == 0 ? 1 : -1);
  EXPECT_NEAR(rig.error_percent(4.0), 0.0, 5.0);
  EXPECT_NEAR(static_cast<double>(rig.get(0x60F9, 1)), 2.5 * static_cast<double>(light), 1.5);
  EXPECT_EQ(rig.get(0x2FF0, 0x0A), 30);
  rig.set(0x2340, 0x10, 6);
  rig.plant.set_load_inertia_kgm2(1.0 * rotor_kgm2);
  for (int i = 0; i < 4; ++i) rig.turn(i % 2 == 0 ? 1 : -1);
  EXPECT_NEAR(rig.error_percent(4.0), 0.0, 5.0) << "switched off, it keeps what it knows";
}

// The axis is disabled during its moves and turned from outside before it is enabled again: this motion must not count
// as a response to the motor's torque.
TEST(IsmkAutoTuning, DisabledInMotionItLearnsNothingFalse) {
  TuningRig rig(loaded(3.0));
  rig.set(0x2340, 0x10, 7);
  for (int i = 0; i < 12; ++i) {
    rig.goal += (i % 2 == 0 ? 2 : -2) * 65536;
    rig.control(0x2F);
    rig.set(0x607A, 0, rig.goal);
    rig.control(0x3F);
    rig.run_ms(40 + 5 * i);  // while it accelerates
    EXPECT_GT(std::fabs(rig.plant.velocity_rpm()), 100.0);
    rig.control(i % 3 == 0 ? 0x06 : 0x00);
    rig.run_ms(5);
    rig.plant.set_external_torque_nm(i % 2 == 0 ? -0.5 : 0.5);
    rig.run_ms(30);
    rig.plant.set_external_torque_nm(0.0);
    rig.run_ms(500);
    ASSERT_TRUE(rig.enable());
    rig.run_ms(20);
    EXPECT_LT(std::fabs(rig.plant.velocity_rpm()), 10.0) << "enabling moves nothing";
    rig.goal = rig.get(0x6064);
  }
  for (int i = 0; i < 4; ++i) rig.turn(i % 2 == 0 ? 2 : -2);
  ASSERT_TRUE(rig.tuning().identified());
  EXPECT_NEAR(rig.error_percent(3.0), 0.0, 8.0);
}

// The procedure of the PC software: identify the inertia, then select a rigidity.
TEST(IsmkRecognition, AndRigidityOnEveryRating) {
  for (const products::Model& model : products::ismk::ratings) {
    const auto rotor = static_cast<double>(model.motor.inertia_kgm2);
    const auto rated = static_cast<double>(model.motor.rated_torque_nm);
    for (const double ratio : {0.5, 5.0, 20.0}) {
      plant::Parameters parameters = test::ismk_plant(model.name);
      parameters.load.inertia_kgm2 = ratio * rotor;
      parameters.load.coulomb_friction_nm = 0.03 * rated;
      parameters.load.static_friction_nm = 0.045 * rated;
      parameters.supply.capacitance_f = 0.1;
      TuningRig rig(parameters, model.name);
      ASSERT_TRUE(rig.device.recognise_inertia(1.0));
      rig.run_until([&] { return !rig.device.drive().identification().running(); }, 8000.0);
      ASSERT_EQ(rig.device.drive().identification().outcome(), InertiaIdentification::Outcome::done);
      rig.run_ms(2);
      const double error = 100.0 * (rig.tuning().inertia_kgm2() / ((1.0 + ratio) * rotor) - 1.0);
      EXPECT_NEAR(error, 0.0, 5.0) << model.name << ", load " << ratio;
      rig.device.set_rigidity(60.0);
      EXPECT_EQ(rig.get(0x2FF0, 0x0A), 60);
      rig.run_ms(500);
      rig.goal = rig.get(0x6063);
      const TuningRig::Move move = rig.turn();
      std::printf("%s load %4.1f rotors: inertia %+.2f %%, kvp %3d, Kpp %d, overshoot %.2f %%, settled %.0f ms\n",
                  model.name.data(), ratio, error, static_cast<int>(rig.get(0x60F9, 1)),
                  static_cast<int>(rig.get(0x60FB, 1)), move.overshoot_percent, move.settled_ms);
      EXPECT_LE(move.overshoot_percent, 2.0) << model.name << ", load " << ratio;
      EXPECT_GT(move.settled_ms, 0.0);
    }
  }
}

// The loops have the new gains immediately, not only after the next write of a parameter; an earlier kvi does not
// remain next to kvi/32.
TEST(IsmkRecognition, RigidityActsAtOnce) {
  TuningRig rig(loaded(1.0));
  rig.set(0x60F9, 2, 7);
  rig.set(0x60F9, 1, 20);
  const drive::Gains before = rig.device.drive().configuration().gains;
  rig.device.set_rigidity(90.0);
  const drive::Gains& now = rig.device.drive().configuration().gains;
  EXPECT_EQ(rig.get(0x60F9, 2), 0);
  EXPECT_NEAR(static_cast<double>(now.velocity_kp / before.velocity_kp), static_cast<double>(rig.get(0x60F9, 1)) / 20.0,
              1e-3);
  EXPECT_NEAR(static_cast<double>(now.velocity_ki / before.velocity_ki),
              static_cast<double>(rig.get(0x60F9, 7)) / 32.0 / (7.0 + 2.0 / 32.0), 1e-3);
}

// Disabled during the identification of the inertia: the axis rests, the gains are kept, and the identification can be
// started again.
TEST(IsmkRecognition, DisableEndsIt) {
  for (const int word : {0x07, 0x06, 0x00, 0x02}) {
    SCOPED_TRACE(word);
    TuningRig rig(loaded(3.0));
    const std::int64_t kvp = rig.get(0x60F9, 1);
    ASSERT_TRUE(rig.device.recognise_inertia(1.0));
    rig.run_until([&] { return std::fabs(rig.plant.velocity_rpm()) > 100.0; }, 8000.0);
    rig.control(static_cast<std::uint16_t>(word));
    rig.run_ms(2);
    EXPECT_EQ(rig.device.drive().identification().outcome(), InertiaIdentification::Outcome::interrupted);
    rig.run_ms(1500);
    EXPECT_LT(std::fabs(rig.plant.velocity_rpm()), 1.0);
    EXPECT_FALSE(rig.actuation.pwm_enabled);
    EXPECT_FALSE(rig.tuning().identified());
    EXPECT_EQ(rig.get(0x60F9, 1), kvp);
    ASSERT_TRUE(rig.enable());
    const auto stands = static_cast<double>(rig.plant.position_counts());
    rig.run_ms(200);
    EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), stands, 30.0);
    ASSERT_TRUE(rig.device.recognise_inertia(1.0));
    rig.run_until([&] { return !rig.device.drive().identification().running(); }, 8000.0);
    rig.run_ms(2);
    EXPECT_NEAR(rig.error_percent(3.0), 0.0, 5.0);
  }
}

TEST(IsmkRecognition, NeedsAnEnabledDrive) {
  FactoryIsmkRig rig;
  rig.run_ms(2);
  EXPECT_FALSE(rig.device.recognise_inertia(1.0));
}

// --- Notches

// A load on a spring, with gains that are too high for it.
struct RingingRig : TuningRig {
  RingingRig(double hz, double load_ratio, double bandwidth_hz) : TuningRig(elastic(hz, load_ratio)) {
    set(0x60F9, 1,
        std::lround(products::ismk::kvp_of_bandwidth(bandwidth_hz, (1.0 + load_ratio) * rotor_kgm2,
                                                     device.drive().configuration().motor)));
    set(0x60FB, 1, std::lround(25.0 * bandwidth_hz));
    set(0x60F9, 5, std::lround((4.0 * bandwidth_hz - 100.0) / 20.0));
  }
  static plant::Parameters elastic(double hz, double load_ratio) {
    plant::Parameters parameters = loaded(load_ratio);
    const double load = load_ratio * rotor_kgm2;
    const double reduced = rotor_kgm2 * load / (rotor_kgm2 + load);
    parameters.load.elastic = true;
    parameters.load.stiffness_nm_per_rad = reduced * std::pow(2.0 * std::numbers::pi * hz, 2);
    parameters.load.damping_nms = 0.02 * reduced * 2.0 * std::numbers::pi * hz;
    parameters.load.viscous_friction_nms = 0.0;
    parameters.load.coulomb_friction_nm = parameters.load.static_friction_nm = 0.01;
    return parameters;
  }
  // RMS of the current about its mean, some time after a torque pulse.
  double ringing_a() {
    plant.set_external_torque_nm(0.3);
    run_ms(2);
    plant.set_external_torque_nm(0.0);
    run_ms(300);
    double sum = 0.0;
    double square = 0.0;
    constexpr int ticks = 3200;
    for (int i = 0; i < ticks; ++i) {
      tick();
      sum += plant.current_a();
      square += plant.current_a() * plant.current_a();
    }
    return std::sqrt(std::max(square / ticks - sum / ticks * (sum / ticks), 0.0));
  }
  bool analyse(int control) {
    EXPECT_EQ(set(0x60F9, 4, control), AbortCode::none);
    return run_until([&] { return (get(0x60F9, 4) & 0x80) == 0; }, 6000.0) > 0;
  }
};

TEST(IsmkNotch, FoundSetAndQuiet) {
  struct Case {
    double hz, load_ratio, bandwidth_hz;
    int control;  // 128; +16: nothing else; +32: with the speed (Table 6-3)
  };
  for (const Case& c : {Case{150.0, 2.0, 50.0, 0x80},
                        {150.0, 1.0, 40.0, 0xA0},
                        {200.0, 1.0, 60.0, 0xB0},
                        {200.0, 3.0, 60.0, 0x90},
                        {300.0, 3.0, 80.0, 0xA0},
                        {450.0, 3.0, 100.0, 0xB0}}) {
    RingingRig rig(c.hz, c.load_ratio, c.bandwidth_hz);
    const double before = rig.ringing_a();
    ASSERT_TRUE(rig.analyse(c.control));
    EXPECT_EQ(rig.get(0x60F9, 4), (c.control & 0x7F) | 1) << "the first filter is on, bit 7 is off";
    const auto found = static_cast<double>(rig.get(0x60F9, 3));
    const double after = rig.ringing_a();
    std::printf(
        "%.0f Hz, load %.0f rotors, 60F9.04 = %02Xh: found %.0f Hz (%+.1f %%); current %.2f A rms before, %.3f A "
        "after\n",
        c.hz, c.load_ratio, static_cast<unsigned>(c.control), found, 100.0 * (found / c.hz - 1.0), before, after);
    EXPECT_NEAR(found, c.hz, 0.03 * c.hz);
    EXPECT_GT(before, 3.0);
    EXPECT_LT(after, 0.01 * before);
    EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), 0.0, 100.0) << "where it was told to stand";
    EXPECT_EQ(rig.get(0x250B, 1), 550) << "there is no second resonance";
  }
}

TEST(IsmkNotch, RunsOnlyWhileEnabled) {
  RingingRig rig(300.0, 2.0, 30.0);
  rig.control(0x06);
  rig.run_ms(5);
  EXPECT_EQ(rig.set(0x60F9, 4, 0x80), AbortCode::device_state);
  EXPECT_EQ(rig.get(0x60F9, 4), 0);
  EXPECT_EQ(rig.set(0x60F9, 4, 1), AbortCode::none);
  EXPECT_EQ(rig.set(0x60F9, 4, 0), AbortCode::none);
  ASSERT_TRUE(rig.enable());
  const float kp = rig.device.drive().configuration().gains.velocity_kp;
  // Switched off during the search: nothing is set, and the gains are restored.
  EXPECT_EQ(rig.set(0x60F9, 4, 0x80), AbortCode::none);
  rig.run_ms(300);
  EXPECT_LT(rig.device.drive().configuration().gains.velocity_kp, 0.2F * kp) << "soft meanwhile";
  rig.control(0x06);
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x60F9, 4), 0);
  EXPECT_EQ(rig.get(0x60F9, 3), 0);
  EXPECT_FLOAT_EQ(rig.device.drive().configuration().gains.velocity_kp, kp);
  // Cancelled by the user.
  ASSERT_TRUE(rig.enable());
  rig.set(0x60F9, 4, 0x80);
  rig.run_ms(300);
  rig.set(0x60F9, 4, 0);
  rig.run_ms(2);
  EXPECT_FLOAT_EQ(rig.device.drive().configuration().gains.velocity_kp, kp);
  EXPECT_EQ(rig.get(0x60F9, 3), 0);
}

// The search softens the loops, so it neither begins in a motion or under a step stop, nor continues into a motion.
TEST(IsmkNotch, RunsOnlyAtRest) {
  using test::IsmkRig;
  const auto position_move = [](IsmkRig& rig) {
    rig.set(0x6060, 0, 1);
    rig.set(0x6081, 0, std::llround(products::ismk::velocity_dec_from_rpm(300.0)));
    rig.set(0x607A, 0, 20 * 65536);
    rig.control(0x0F);
    rig.run_ms(2);
    rig.control(0x1F);
    rig.run_ms(20);
  };
  {
    IsmkRig rig;
    rig.run_ms(5);
    rig.set(0x6060, 0, 1);
    rig.control(0x0F);
    rig.run_ms(200);
    const float kp = rig.device.drive().configuration().gains.velocity_kp;
    ASSERT_EQ(rig.set(0x60F9, 4, 0x80), AbortCode::none);
    rig.run_ms(200);
    ASSERT_NE(rig.get(0x60F9, 4) & 0x80, 0);
    position_move(rig);
    EXPECT_GT(rig.plant.velocity_rpm(), 1.0);
    EXPECT_EQ(rig.get(0x60F9, 4), 0) << "the set-point ends the search, and no notch is on";
    EXPECT_FLOAT_EQ(rig.device.drive().configuration().gains.velocity_kp, kp);
    EXPECT_EQ(rig.set(0x60F9, 4, 0x80), AbortCode::device_state) << "in motion";
  }
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x2340, 2, 1000);  // step stop
  rig.set(0x2340, 1, 1);
  position_move(rig);
  ASSERT_GE(rig.run_until([&] { return rig.device.drive().axis().demand.loop == drive::Loop::locked; }, 30000), 0);
  EXPECT_EQ(rig.set(0x60F9, 4, 0x80), AbortCode::device_state) << "no loop to excite";
  rig.set(0x2340, 1, 0);
  rig.run_ms(100);
  EXPECT_EQ(rig.set(0x60F9, 4, 0x80), AbortCode::none);
  rig.run_ms(100);
  ASSERT_NE(rig.get(0x60F9, 4) & 0x80, 0);
  rig.set(0x2340, 1, 1);
  EXPECT_GE(rig.run_until([&] { return (rig.get(0x60F9, 4) & 0x80) == 0; }, 1500), 0)
      << "the step stop ends the search";
}

TEST(IsmkNotch, OfARigidLoadThereIsNone) {
  TuningRig rig(loaded(1.0));
  rig.set(0x60F9, 4, 0x82);
  rig.run_until([&] { return (rig.get(0x60F9, 4) & 0x80) == 0; }, 6000.0);
  EXPECT_EQ(rig.get(0x60F9, 4), 2) << "as it was";
  EXPECT_EQ(rig.get(0x60F9, 3), 0);
  EXPECT_EQ(rig.get(0x250B, 1), 550);
}

// The rate of sampling (60F9h sub 6, bit 7) acts when the motor has no power: estimator and search use the rate in
// force.
TEST(IsmkAutoTuning, ComputesWithTheRateInForce) {
  TuningRig rig(loaded(3.0));
  rig.set(0x2340, 0x10, 0x01);
  const std::int64_t slow = rig.get(0x60F9, 6);
  rig.turn(1);
  rig.control(0x06);
  rig.run_ms(300);
  ASSERT_EQ(rig.set(0x60F9, 6, slow ^ 0x80), AbortCode::none);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(50);
  rig.goal = rig.get(0x6064);
  for (int i = 0; i < 6; ++i) rig.turn(i % 2 == 0 ? 1 : -1);
  EXPECT_TRUE(rig.tuning().identified());
  EXPECT_NEAR(rig.error_percent(3.0), 0.0, 5.0);
}
TEST(IsmkNotch, ComputesWithTheRateInForce) {
  RingingRig rig(200.0, 1.0, 60.0);
  ASSERT_EQ(rig.set(0x60F9, 6, rig.get(0x60F9, 6) ^ 0x80), AbortCode::none);
  ASSERT_TRUE(rig.analyse(0xA0));
  EXPECT_NEAR(static_cast<double>(rig.get(0x60F9, 3)), 200.0, 6.0);
}

}  // namespace
}  // namespace ismk_tuning_test
}  // namespace servodrome
