#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>

#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// Interpolated position mode of the ProNet drive: no buffer, set-points take effect at the SYNC, alarm A 69.
namespace servodrome {
namespace pronet_interpolation_test {
namespace {

using products::Pronet;
using Axis = test::Rig<Pronet>;

constexpr std::uint16_t alarm_69 = 0x8169;

// The master: PDOs configured as in the manual (ch. 7.5.4), set-points and SYNCs.
class Master {
 public:
  explicit Master(Axis& axis, unsigned period_ms = 1) : axis_(axis), period_ms_(period_ms) {
    axis.run_ms(1);
    const auto set = [&](std::uint16_t index, std::uint8_t sub, std::int64_t value) {
      EXPECT_EQ(axis.set(index, sub, value), dictionary::AbortCode::none) << std::hex << index << "h:" << int{sub};
    };
    for (std::uint16_t pdo = 0; pdo < 4; ++pdo) set(0x1800 + pdo, 1, 0x80000000 | axis.get(0x1800 + pdo, 1));
    set(0x1600, 0, 0);
    set(0x1600, 1, 0x60400010);
    set(0x1600, 2, 0x60C10120);
    set(0x1600, 0, 2);
    set(0x1400, 2, 1);
    set(0x1006, 0, period_ms * 1000);
    set(0x2105, 0, period_ms * 1000);
    set(0x60C2, 1, period_ms);
    set(0x60C2, 2, -3);
    set(0x6060, 0, 7);
    axis.enable();
    axis.send(0x000, {0x01, 0x01});
  }

  void data(std::int32_t position, std::uint16_t controlword = 0x1F) {
    const auto word = static_cast<std::uint32_t>(position);
    axis_.send(0x201, {static_cast<std::uint8_t>(controlword), static_cast<std::uint8_t>(controlword >> 8),
                       static_cast<std::uint8_t>(word), static_cast<std::uint8_t>(word >> 8),
                       static_cast<std::uint8_t>(word >> 16), static_cast<std::uint8_t>(word >> 24)});
  }
  void sync() { axis_.send(0x080, {}); }
  void pause() { axis_.run_ms(period_ms_); }
  // A whole period that begins with the SYNC.
  void cycle(std::int32_t position, std::uint16_t controlword = 0x1F) {
    data(position, controlword);
    sync();
    pause();
  }

 private:
  Axis& axis_;
  unsigned period_ms_;
};

bool alarmed(Axis& axis) { return axis.get(0x603F) == alarm_69; }

// A sine of half a turn at 1 Hz for a minute of virtual time.
TEST(PronetInterpolation, AMinuteOfSyncsWithoutAlarm) {
  Axis axis;
  Master master(axis);
  constexpr double amplitude = 65536.0;
  constexpr double two_pi = 6.283185307179586;
  std::int64_t most = 0;
  double roughest = 0.0;
  for (int i = 0; i < 60000; ++i) {
    const double phase = two_pi * i / 1000.0;
    master.cycle(static_cast<std::int32_t>(std::lround(amplitude * (1.0 - std::cos(phase)))));
    ASSERT_FALSE(alarmed(axis)) << i << " ms";
    most = std::max(most, std::abs(axis.device.drive().loops().following_error_counts));
    // The demand's velocity follows the sine's: steps at the cycle would cause a sawtooth.
    const double wanted = amplitude * two_pi * std::sin(phase - two_pi * 0.0005);
    if (i > 10) roughest = std::max(roughest, std::abs(axis.device.drive().axis().generator.velocity() - wanted));
  }
  std::printf(
      "60 s of 1 ms SYNC: following error at most %lld counts (%.4f turns), demand velocity within %.0f counts/s\n",
      static_cast<long long>(most), static_cast<double>(most) / 131072.0, roughest);
  EXPECT_EQ(axis.status() & 0x106F, 0x1027);
  EXPECT_LT(most, 131072 / 100);
  EXPECT_LT(roughest, 3000.0);  // 0.7 % of the greatest, 411775 counts/s
}

// SYNCs that deviate by up to three ticks, from a clock that differs from the drive's: the drive adjusts its time base,
// and the velocity is not affected.
TEST(PronetInterpolation, TheTimeBaseLocksToTheSync) {
  Axis axis;
  Master master(axis);
  constexpr double velocity = 100.0;  // counts per period
  double due = 0.0;
  std::int64_t ticks = 0;
  std::uint32_t random = 1;
  double least = 1e9;
  double most = 0.0;
  for (int i = 0; i < 5000; ++i) {
    random = random * 1664525U + 1013904223U;
    due += 16.0 * 1.0005;                                             // the master's millisecond is 500 ppm longer
    const auto jitter = static_cast<std::int64_t>(random >> 30) - 1;  // ticks
    while (ticks < static_cast<std::int64_t>(due) + jitter) {
      axis.tick();
      ++ticks;
      const double now = axis.device.drive().axis().generator.velocity();
      if (i > 500) {
        least = std::min(least, now);
        most = std::max(most, now);
      }
    }
    master.data(static_cast<std::int32_t>(velocity * i));
    master.sync();
    ASSERT_FALSE(alarmed(axis)) << i;
  }
  std::printf("jitter of 0.19 ms and a clock 500 ppm off: demand velocity %.0f to %.0f counts/s for 99950\n", least,
              most);
  EXPECT_GT(least, 0.93 * 99950.0);
  EXPECT_LT(most, 1.07 * 99950.0);
}

TEST(PronetInterpolation, ASetPointIsReachedOnePeriodAfterItsSync) {
  for (const unsigned period : {1U, 2U, 4U, 10U}) {
    Axis axis;
    Master master(axis, period);
    master.cycle(0);
    master.data(400);
    axis.run_ms(period);
    EXPECT_EQ(axis.get(0x6062), 0) << "before the SYNC the drive does not know it";
    master.sync();
    axis.run_ms(period * 0.5);
    EXPECT_NEAR(static_cast<double>(axis.get(0x6062)), 200.0, 1.0);
    axis.run_ms(period * 0.5);
    EXPECT_EQ(axis.get(0x6062), 400);
    EXPECT_FALSE(alarmed(axis));
  }
}

// Without a buffer the last set-point before the SYNC counts (ch. 7.5.4).
TEST(PronetInterpolation, OnlyTheLastSetPointIsKept) {
  Axis axis;
  Master master(axis);
  master.cycle(0);
  master.data(100);
  master.data(-50);
  master.data(30);
  master.sync();
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x6062), 30);
}

// Our interpretation of ch. 7.5.4: one SYNC period without a new set-point is tolerated, the second one raises A 69.
struct Late {
  const char* what;
  std::function<void(Axis&, Master&)> run;
  bool alarm;
};

TEST(PronetInterpolation, AlarmA69ExactlyWhenDataIsLate) {
  const std::vector<Late> cases{
      {"a set-point with every SYNC", [](Axis&, Master& master) { master.cycle(0); }, false},
      {"one SYNC without a set-point",
       [](Axis&, Master& master) {
         master.sync();
         master.pause();
         master.cycle(0);
       },
       false},
      {"every other SYNC without a set-point",
       [](Axis&, Master& master) {
         for (int i = 0; i < 100; ++i) {
           master.sync();
           master.pause();
           master.cycle(0);
         }
       },
       false},
      {"two SYNCs without a set-point",
       [](Axis&, Master& master) {
         master.sync();
         master.pause();
         master.sync();
         master.pause();
       },
       true},
      {"one SYNC missing",
       [](Axis&, Master& master) {
         master.pause();
         master.cycle(0);
       },
       false},
      {"just before the second period without a SYNC ends", [](Axis& axis, Master&) { axis.run_ms(0.9); }, false},
      {"the second period without a SYNC over", [](Axis& axis, Master&) { axis.run_ms(2.1); }, true},
      {"set-points without any SYNC",
       [](Axis& axis, Master& master) {
         for (int i = 0; i < 5; ++i) {
           master.data(0);
           axis.run_ms(1);
         }
       },
       true},
      {"a SYNC without a set-point, then none",
       [](Axis& axis, Master& master) {
         master.sync();
         axis.run_ms(2.1);
       },
       true},
      {"ip mode switched off in time",
       [](Axis& axis, Master& master) {
         master.cycle(0, 0x0F);
         axis.run_ms(20);
       },
       false},
      {"operation disabled in time",
       [](Axis& axis, Master& master) {
         master.cycle(0, 0x07);
         axis.run_ms(20);
       },
       false},
  };
  for (const Late& late : cases) {
    SCOPED_TRACE(late.what);
    Axis axis;
    Master master(axis);
    for (int i = 0; i < 20; ++i) master.cycle(0);
    late.run(axis, master);
    axis.run_ms(0.6);  // the position cycle that detects it
    EXPECT_EQ(alarmed(axis), late.alarm);
    EXPECT_EQ((axis.status() & 0x4F) == 0x08, late.alarm);
    EXPECT_EQ(axis.actuation.pwm_enabled, !late.alarm && (axis.status() & 0x6F) == 0x27) << "the servo drive stops";
  }
}

// A period of 0 in 60C2h is no fault of this product, and hides none.
TEST(PronetInterpolation, AlarmA69AlsoWithAPeriodOfZero) {
  Axis axis;
  Master master(axis);
  ASSERT_EQ(axis.set(0x60C2, 1, 0), dictionary::AbortCode::none);
  for (int i = 0; i < 20; ++i) master.cycle(0);
  EXPECT_FALSE(alarmed(axis));
  axis.run_ms(5);
  EXPECT_TRUE(alarmed(axis));
}

TEST(PronetInterpolation, TheAlarmIsNotArmedBeforeTheFirstSync) {
  Axis axis;
  Master master(axis);
  axis.control(0x1F);
  axis.run_ms(500);
  EXPECT_FALSE(alarmed(axis));
  EXPECT_EQ(axis.status() & 0x106F, 0x1027);
  master.sync();  // activates it, although it has no set-point
  axis.run_ms(1.5);
  EXPECT_FALSE(alarmed(axis));
  axis.run_ms(1.5);
  EXPECT_TRUE(alarmed(axis));
}

// 2105h is the expected period of the SYNC, 60C2h the interpolation period: both must be set (ch. 7.5.4).
TEST(PronetInterpolation, BothPeriodObjectsMustBeSet) {
  // Sends set-points at constant speed with a SYNC each 4 ms. Returns whether there was no alarm, and the lowest speed
  // of the demand.
  const auto run = [](std::int64_t sync_us, std::int64_t interpolation_ms) {
    Axis axis;
    Master master(axis, 4);
    axis.set(0x2105, 0, sync_us);
    axis.set(0x60C2, 1, interpolation_ms);
    double least = 1e9;
    for (int i = 0; i < 100; ++i) {
      master.data(100 * i);
      master.sync();
      for (int tick = 0; tick < 64; ++tick) {
        axis.tick();
        if (i > 20) least = std::min(least, axis.device.drive().axis().generator.velocity());
      }
    }
    return std::pair{!alarmed(axis), least};
  };
  EXPECT_TRUE(run(4000, 4).first);
  EXPECT_GT(run(4000, 4).second, 20000.0) << "smooth";
  EXPECT_TRUE(run(4000, 1).first);
  EXPECT_LT(run(4000, 1).second, 1.0) << "60C2h forgotten: it stands between the set-points";
  EXPECT_FALSE(run(1000, 4).first) << "2105h forgotten: A 69";
}

// Set-points of 160 counts each millisecond with a SYNC, which comes `off` ticks after the drive's own cycle.
class Stream {
 public:
  explicit Stream(std::int64_t interpolation_ms, unsigned off = 0, bool by_both_objects = false) : master_(axis, 1) {
    axis.set(0x60C2, 1, interpolation_ms);
    if (by_both_objects) axis.set(0x2105, 0, 1000 * interpolation_ms);
    for (unsigned tick = 0; tick < off; ++tick) axis.tick();
  }
  // `lost`: neither set-point nor SYNC; `word`: the controlword.
  void cycle(std::int32_t step = 160, bool lost = false, std::uint16_t word = 0x1F, unsigned ticks = 16) {
    target += step;
    if (!lost) {
      master_.data(target, word);
      master_.sync();
    }
    for (unsigned tick = 0; tick < ticks; ++tick) {
      axis.tick();
      const double velocity = axis.device.drive().axis().generator.velocity() / 1000.0;  // counts/ms
      most = std::max(most, velocity);
      least = std::min(least, velocity);
    }
  }
  void forget() { most = -1e9, least = 1e9; }
  std::int32_t demand() { return static_cast<std::int32_t>(axis.get(0x6062)); }

  Axis axis{};
  std::int32_t target = 0;
  double most = -1e9;
  double least = 1e9;

 private:
  Master master_;
};

// Ch. 7.5.4: "the sync period should be not bigger than interpolation cycle period". A set-point is reached one period
// 60C2h after its SYNC, for any period of the SYNC.
TEST(PronetInterpolation, TheLagIsOnePeriod) {
  for (const bool by_both_objects : {false, true}) {
    for (const int period_ms : {1, 2, 3, 4, 8, 20}) {
      Stream stream(period_ms, 0, by_both_objects);
      for (int i = 0; i < 1000; ++i) stream.cycle();
      const double lag_ms = 1.0 + (stream.target - stream.demand()) / 160.0;  // the last SYNC was 1 ms ago
      std::printf("60C2h = %d ms, SYNC 1 ms: lag %.2f ms\n", period_ms, lag_ms);
      EXPECT_NEAR(lag_ms, period_ms, 0.05) << period_ms;
      EXPECT_FALSE(alarmed(stream.axis));
    }
  }
}

// "After receiving the synchronization information, servo drive will synchronize its internal clock" (ch. 7.5.4): at
// any phase of the SYNC in the drive's cycle, the demand has the speed of the set-points and is not faster.
TEST(PronetInterpolation, ASyncAnywhereInTheCycleDoesNotRing) {
  for (unsigned off = 0; off < 8; ++off) {
    SCOPED_TRACE(off);
    Stream stream(1, off);
    for (int i = 0; i < 30; ++i) stream.cycle();
    std::printf("SYNC %u ticks off: demand %.1f to %.1f for 160 counts/ms\n", off, stream.least, stream.most);
    EXPECT_LT(stream.most, 161.0);
    stream.forget();
    for (int i = 0; i < 100; ++i) stream.cycle();
    EXPECT_GT(stream.least, 159.0);
    for (int i = 0; i < 30; ++i) stream.cycle(0);
    EXPECT_GT(stream.least, -1.0) << "nor does it swing back at the end";
    EXPECT_LT(stream.most, 161.0);
    EXPECT_EQ(stream.demand(), stream.target);
    EXPECT_FALSE(alarmed(stream.axis));
  }
}

// A master whose clock drifts through the whole cycle of the drive, with a speed that changes all the time.
TEST(PronetInterpolation, ADriftingSyncDoesNotRing) {
  for (const int drift : {-1, 1}) {
    Stream stream(1);
    double roughest = 0.0;
    for (int i = 0; i < 4000; ++i) {
      const double wanted = 160.0 * std::sin(i * 0.01);
      stream.forget();
      // A tick in 100 ms: 625 ppm.
      stream.cycle(static_cast<std::int32_t>(std::lround(wanted)), false, 0x1F,
                   i % 100 == 99 ? static_cast<unsigned>(16 + drift) : 16U);
      if (i > 10) roughest = std::max({roughest, std::abs(stream.most - wanted), std::abs(stream.least - wanted)});
    }
    std::printf("drift of %d: demand within %.1f counts/ms of 160\n", 625 * drift, roughest);
    EXPECT_LT(roughest, 16.0);
    EXPECT_FALSE(alarmed(stream.axis));
  }
}

// Events during the exchange of set-points: a lost SYNC, quick stop, another mode, disable and enable twice, NMT stop,
// power off.
TEST(PronetInterpolation, InterruptionsOfAStream) {
  const auto is_calm = [](Stream& stream, const char* what) {
    EXPECT_LT(stream.most, 420.0) << what << ": beyond the motor";
    EXPECT_GT(stream.least, -420.0) << what;
  };
  for (const unsigned off : {0U, 5U}) {
    for (const int period_ms : {1, 4}) {
      SCOPED_TRACE(testing::Message() << off << " ticks, " << period_ms << " ms");
      {
        Stream stream(period_ms, off);
        for (int i = 0; i < 100; ++i) stream.cycle();
        stream.cycle(160, true);
        for (int i = 0; i < 100; ++i) stream.cycle();
        EXPECT_FALSE(alarmed(stream.axis)) << "one period without data is tolerated";
        EXPECT_NEAR(1.0 + (stream.target - stream.demand()) / 160.0, period_ms, 0.6);
        is_calm(stream, "a lost SYNC");
      }
      {
        Stream stream(period_ms, off);
        for (int i = 0; i < 100; ++i) stream.cycle();
        for (int i = 0; i < 300; ++i) stream.cycle(0, false, 0x0002);
        is_calm(stream, "quick stop");
        EXPECT_FALSE(stream.axis.device.drive().in_motion());
      }
      {
        Stream stream(period_ms, off);
        for (int i = 0; i < 100; ++i) stream.cycle();
        stream.axis.set(0x6060, 0, 3);
        for (int i = 0; i < 300; ++i) stream.cycle(0);
        is_calm(stream, "another mode");
        EXPECT_FALSE(stream.axis.device.drive().in_motion()) << "60FFh is 0";
        stream.axis.set(0x6060, 0, 7);
        stream.target = stream.demand();
        stream.cycle(0, false, 0x0F);
        for (int i = 0; i < 100; ++i) stream.cycle();
        is_calm(stream, "and back");
      }
      {
        Stream stream(period_ms, off);
        for (int again = 0; again < 2; ++again) {
          for (int i = 0; i < 100; ++i) stream.cycle();
          for (int i = 0; i < 500; ++i) stream.cycle(0, false, 0x0007);
          stream.target = static_cast<std::int32_t>(stream.axis.get(0x6064));
          stream.cycle(0, false, 0x0F);
          for (int i = 0; i < 100; ++i) stream.cycle(0, false, 0x0F);
        }
        is_calm(stream, "enabled twice");
      }
      {
        Stream stream(period_ms, off);
        for (int i = 0; i < 100; ++i) stream.cycle();
        stream.axis.send(0x000, {0x02, 0x01});
        for (int i = 0; i < 50; ++i) stream.cycle();
        EXPECT_TRUE(alarmed(stream.axis)) << "no set-point reaches a node that is stopped";
        EXPECT_FALSE(stream.axis.actuation.pwm_enabled);
        is_calm(stream, "NMT stop");
      }
      {
        Stream stream(period_ms, off);
        for (int i = 0; i < 100; ++i) stream.cycle();
        stream.axis.plant.sample(stream.axis.feedback);
        stream.axis.device.power_off();
        stream.axis.device.power_on(stream.axis.feedback, stream.axis.now());
        for (int i = 0; i < 50; ++i) stream.cycle();
        EXPECT_FALSE(stream.axis.actuation.pwm_enabled);
        EXPECT_EQ(stream.axis.status() & 0x4F, 0x40);
        is_calm(stream, "power");
      }
    }
  }
}

TEST(PronetInterpolation, HaltStopsAndGoesOn) {
  Axis axis;
  Master master(axis);
  for (int i = 0; i < 200; ++i) master.cycle(i * 50);
  for (int i = 200; i < 400; ++i) master.cycle(10000, 0x011F);
  EXPECT_EQ(axis.status() & 0x1467, 0x1427);
  EXPECT_FALSE(axis.device.drive().in_motion());
  const auto stands = static_cast<std::int32_t>(axis.get(0x6062));
  for (int i = 0; i < 10; ++i) master.cycle(stands + i * 50);
  EXPECT_EQ(axis.get(0x6062), stands + 450);
  EXPECT_FALSE(alarmed(axis));
}

// The end of a halt is no command: a set-point that came during the halt does not move the axis.
TEST(PronetInterpolation, ASetPointDuringAHaltDoesNotActAtItsEnd) {
  Axis axis;
  Master master(axis);
  for (int i = 0; i < 200; ++i) master.cycle(i * 50);
  for (int i = 0; i < 200; ++i) master.cycle(10000, 0x011F);
  axis.set(0x60C1, 1, 50000);
  const std::int64_t stands = axis.get(0x6062);
  axis.set(0x6040, 0, 0x1F);
  axis.run_ms(1);
  master.sync();
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x6062), stands);
  master.cycle(static_cast<std::int32_t>(stands) + 50);
  EXPECT_EQ(axis.get(0x6062), stands + 50);
}

TEST(PronetInterpolation, InactiveItHoldsItsPosition) {
  Axis axis;
  Master master(axis);
  for (int i = 0; i < 50; ++i) master.cycle(1000, 0x0F);
  EXPECT_EQ(axis.get(0x6062), 0);
  EXPECT_EQ(axis.status() & 0x1000, 0);
  for (int i = 0; i < 100; ++i) master.cycle(i);
  EXPECT_EQ(axis.get(0x6062), 99);
  for (int i = 0; i < 50; ++i) master.cycle(5000, 0x0F);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6062)), 99.0, 60.0) << "comes to rest by 6084h";
  EXPECT_EQ(axis.status() & 0x1000, 0);
}

}  // namespace
}  // namespace pronet_interpolation_test
}  // namespace servodrome
