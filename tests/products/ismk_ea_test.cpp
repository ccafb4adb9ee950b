#include "products/ismk/ismk_ea.hpp"

#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <tuple>

#include "ethercat_rig.hpp"
#include "ismk_rig.hpp"

// The iSMK's variant EA: the dictionary of AA on EtherCAT, and each mode over process data.
namespace servodrome::test {
namespace ismk_ea_test {
namespace {

using products::Ismk;
using products::IsmkEa;
using products::ismk::acceleration_dec_from_rps_s;
using products::ismk::rpm_from_velocity_dec;
using products::ismk::velocity_dec_from_rpm;

struct Bus : private IsmkMemory, EthercatRig<IsmkEa> {
  // 1600h and 1A00h.
  struct Out {
    static constexpr std::size_t controlword = 0, position = 2, velocity = 6, current = 10, mode = 12;
  };
  struct In {
    static constexpr std::size_t statusword = 0, position = 2, velocity = 6, current = 10, mode = 12;
  };

  Bus() : EthercatRig(ismk_plant(), settings(medium)) {
    set(0x60F9, 6, 0x80);
    device.set_rigidity(150.0);
  }
  static products::Settings settings(dictionary::Medium& medium) {
    products::Settings settings = ismk_settings();
    settings.store = &medium;
    settings.serial_number = 99;
    return settings;
  }
  void connect(std::uint32_t sync0_ns = 0) {
    to_pre_operational();
    if (sync0_ns != 0) start_sync0(sync0_ns);
    set_process_data();
    put<std::uint16_t>(Out::controlword, 0x06);
    put<std::int8_t>(Out::mode, -4);
    ASSERT_EQ(request(4), good(4));
    run_cycles(20, 1);
    write(ethercat::reg::al_control, little_endian(std::uint16_t{8}));
    run_cycles(20, 1);
    ASSERT_EQ(al_status(), good(8));
  }
  void enable(std::int8_t mode, std::uint16_t word = 0x2F) {
    put<std::int8_t>(Out::mode, mode);
    put<std::int32_t>(Out::position, input<std::int32_t>(In::position));
    put<std::uint16_t>(Out::controlword, word);
    run_cycles(5, 1);
    ASSERT_EQ(status() & 0xFF, 0x37);
    ASSERT_EQ(input<std::int8_t>(In::mode), mode);
  }
  void word(std::uint16_t controlword, int cycles = 3) {
    put<std::uint16_t>(Out::controlword, controlword);
    run_cycles(cycles, 1);
  }
  std::uint16_t status() const { return input<std::uint16_t>(In::statusword); }
  std::int32_t position() const { return input<std::int32_t>(In::position); }
  double rpm() const { return rpm_from_velocity_dec(input<std::int32_t>(In::velocity)); }
};

TEST(IsmkEaDictionary, IsThatOfVariantAa) {
  std::vector<const dictionary::Entry*> aa, ea;
  const auto of_the_bus = [](const dictionary::Entry& entry) { return entry.index >= 0x1000 && entry.index < 0x2000; };
  for (const auto& entry : Ismk::table) {
    if (!of_the_bus(entry)) aa.push_back(&entry);
  }
  for (const auto& entry : IsmkEa::table) {
    if (!of_the_bus(entry) && entry.index != 0x60C2) ea.push_back(&entry);  // belongs to mode 8, which only the EA has
  }
  ASSERT_EQ(aa.size(), ea.size());
  for (std::size_t i = 0; i < aa.size(); ++i) {
    const dictionary::Entry &a = *aa[i], &b = *ea[i];
    ASSERT_EQ(a.key(), b.key());
    EXPECT_STREQ(a.name, b.name) << std::hex << a.index;
    EXPECT_STREQ(a.unit, b.unit);
    if (a.index == 0x6060) {  // also has mode 8
      EXPECT_EQ(b.maximum, a.maximum + 1);
      continue;
    }
    EXPECT_EQ(std::tie(a.code, a.type, a.access, a.pdo, a.saved, a.owner, a.has_range, a.minimum, a.maximum),
              std::tie(b.code, b.type, b.access, b.pdo, b.saved, b.owner, b.has_range, b.minimum, b.maximum))
        << std::hex << a.index;
    EXPECT_EQ(a.default_value, b.default_value) << std::hex << a.index;
  }
  // The station number of the RS485 port is kept, the objects of CANopen are not.
  Bus bus;
  EXPECT_EQ(bus.get(0x100B), 1);
  for (const std::uint16_t index :
       std::to_array<std::uint16_t>({0x1005, 0x100C, 0x100E, 0x1014, 0x1017, 0x1200, 0x1400, 0x1800})) {
    EXPECT_EQ(bus.device.dictionary().find(index, 0), nullptr) << std::hex << index;
  }
  EXPECT_EQ(bus.get(0x1018, 4), 99);
  EXPECT_NE(bus.device.serial_port(), nullptr);
}

TEST(IsmkEaMemory, HoldsWhatTheSlaveIs) {
  Bus bus;
  std::vector<std::uint8_t> image(IsmkEa::sii_bytes);
  products::Settings settings;
  settings.serial_number = 99;
  ASSERT_GT(
      ethercat::write_sii_image(IsmkEa::sii_description(settings), IsmkEa::ethercat_profile, IsmkEa::table, image), 0U);
  ASSERT_EQ(bus.device.sii().size(), image.size());
  EXPECT_TRUE(std::equal(image.begin(), image.end(), bus.device.sii().begin()));
}

class IsmkEaModes : public testing::TestWithParam<std::uint32_t> {
 protected:
  void start(std::int8_t mode, std::uint16_t word = 0x2F) {
    bus.connect(GetParam());
    bus.enable(mode, word);
  }
  Bus bus;
};
INSTANTIATE_TEST_SUITE_P(Synchronisation, IsmkEaModes, testing::Values(0U, 1'000'000U),
                         [](const auto& one) { return one.param == 0 ? "SyncManager" : "Sync0"; });

TEST_P(IsmkEaModes, Position) {
  start(1);
  bus.set(0x6081, 0, std::llround(velocity_dec_from_rpm(1000)));
  bus.set(0x6083, 0, std::llround(acceleration_dec_from_rps_s(200)));
  bus.set(0x6084, 0, std::llround(acceleration_dec_from_rps_s(200)));
  const std::int32_t target = bus.position() + 100000;
  bus.put<std::int32_t>(Bus::Out::position, target);
  bus.word(0x3F);
  bus.run_cycles(500, 1);
  EXPECT_NEAR(bus.position(), target, 65);
  EXPECT_EQ(bus.status() & 0x0400, 0x0400);
}

TEST_P(IsmkEaModes, Speed) {
  start(3);
  bus.set(0x6083, 0, std::llround(acceleration_dec_from_rps_s(100)));
  bus.put<std::int32_t>(Bus::Out::velocity, static_cast<std::int32_t>(velocity_dec_from_rpm(300)));
  bus.run_cycles(500, 1);
  EXPECT_NEAR(bus.rpm(), 300, 15);
}

TEST_P(IsmkEaModes, SpeedAtOnce) {
  start(-3);
  bus.put<std::int32_t>(Bus::Out::velocity, static_cast<std::int32_t>(velocity_dec_from_rpm(-300)));
  bus.run_cycles(300, 1);
  EXPECT_NEAR(bus.rpm(), -300, 15);
}

TEST_P(IsmkEaModes, Current) {
  start(4);
  bus.put<std::int16_t>(Bus::Out::current, 100);
  bus.run_cycles(100, 1);
  EXPECT_NEAR(bus.input<std::int16_t>(Bus::In::current), 100, 10);
  EXPECT_GT(bus.rpm(), 10);
}

TEST_P(IsmkEaModes, Interpolation) {
  bus.to_pre_operational();
  for (const auto& one : IsmkEa::start_up) {
    const dictionary::Entry* entry = bus.device.dictionary().find(one.index, one.sub);
    ASSERT_NE(entry, nullptr);
    ASSERT_EQ(bus.download(one.index, one.sub, one.value, dictionary::size_of(entry->type)),
              dictionary::AbortCode::none);
  }
  start(7);
  bus.word(0x3F);
  const std::int32_t begin = bus.position();
  bus.run_cycles(1000, 1, [&](int i) {
    const double phase = std::min(i, 800) / 800.0 * 3.14159265;
    bus.put<std::int32_t>(Bus::Out::position, begin + static_cast<std::int32_t>(20000 * (1 - std::cos(phase))));
  });
  EXPECT_NEAR(bus.position(), begin + 40000, 65);
  EXPECT_LE(bus.get(0x3011, 4), 1);  // lost set-points
}

// Mode 8 with a master that has no special support for this drive: 6060h = 8, enabled, 607Ah from 6064h on. With SYNC0
// its cycle is the time between targets, without SYNC0 60C2h is.
TEST_P(IsmkEaModes, CyclicSynchronousPosition) {
  bus.to_pre_operational();
  ASSERT_EQ(bus.download(0x6060, 0, 8, 1), dictionary::AbortCode::none);
  ASSERT_EQ(bus.download(0x60C2, 1, 1, 1), dictionary::AbortCode::none);
  ASSERT_EQ(bus.download(0x60C2, 2, -3, 1), dictionary::AbortCode::none);
  EXPECT_NE(bus.get(0x6502) & 1 << 7, 0);
  start(8, 0x0F);
  EXPECT_NE(bus.status() & 0x1000, 0) << "follows";
  const std::int32_t begin = bus.position();
  double greatest_lag = 0.0;
  bus.run_cycles(1000, 1, [&](int i) {
    const double phase = std::min(i, 800) / 800.0 * 3.14159265;
    const double before = std::min(std::max(i - 3, 0), 800) / 800.0 * 3.14159265;
    const auto& generator = bus.device.drive().axis().generator;
    const auto demanded = static_cast<double>(generator.position()) + generator.fraction();
    greatest_lag = std::max(greatest_lag, std::abs(demanded - (begin + 20000 * (1 - std::cos(before)))));
    bus.put<std::int32_t>(Bus::Out::position, begin + static_cast<std::int32_t>(20000 * (1 - std::cos(phase))));
  });
  EXPECT_LT(greatest_lag, 160.0) << "the demand is two milliseconds behind";  // 78 counts/ms at most
  EXPECT_NEAR(bus.position(), begin + 40000, 65);
  // In motion, quick stop, and back: no earlier target is followed.
  bus.put<std::int32_t>(Bus::Out::position, begin + 40000);
  bus.word(0x0B, 200);
  EXPECT_NE(bus.status() & 0xFF, 0x37);
  EXPECT_EQ(bus.status() & 0x1000, 0);
}

// 607Ah is far from the axis when mode 7 or 8 begins: the axis approaches it at 6080h with 6083h and 6084h. During
// this, bit 12 of mode 8 is 0; bit 12 of mode 7 equals bit 4 of the controlword.
TEST(IsmkEaFirstTarget, ThatIsFarIsCaughtUpWith) {
  for (const auto& [mode, sync0_ns] :
       {std::pair<std::int8_t, std::uint32_t>{7, 0}, {7, 1'000'000}, {8, 0}, {8, 1'000'000}}) {
    SCOPED_TRACE(int{mode});
    SCOPED_TRACE(sync0_ns);
    Bus bus;
    bus.set(0x6080, 0, 600);
    for (const std::uint16_t ramp : std::to_array<std::uint16_t>({0x6083, 0x6084}))
      bus.set(ramp, 0, std::llround(acceleration_dec_from_rps_s(100)));
    bus.connect(sync0_ns);
    bus.put<std::int8_t>(Bus::Out::mode, mode);
    const std::int32_t target = bus.position() + 5 * 65536;
    bus.put<std::int32_t>(Bus::Out::position, target);
    bus.put<std::uint16_t>(Bus::Out::controlword, 0x2F);
    bus.run_cycles(2, 1);
    bus.put<std::uint16_t>(Bus::Out::controlword, 0x3F);
    const drive::Generator& generator = bus.device.drive().axis().generator;
    double before = generator.velocity() / 65536.0;
    double fastest = 0.0;
    double steepest = 0.0;
    bus.run_cycles(300, 1, [&](int) {
      const double turns_per_s = generator.velocity() / 65536.0;
      fastest = std::max(fastest, turns_per_s);
      steepest = std::max(steepest, std::abs(turns_per_s - before));
      before = turns_per_s;
    });
    EXPECT_NEAR(fastest, 10.0, 0.1) << "6080h";
    EXPECT_NEAR(steepest, 0.1, 0.02) << "in a millisecond";
    EXPECT_EQ(bus.status() & 0x1000, mode == 7 ? 0x1000 : 0);
    bus.run_cycles(700, 1);
    EXPECT_NEAR(bus.position(), target, 65);
    EXPECT_EQ(bus.status() & 0x10FF, 0x1037);
  }
}

TEST_P(IsmkEaModes, ThePeriodIsOneWithThatOf3011) {
  bus.set(0x3011, 1, 3);
  EXPECT_EQ(bus.get(0x60C2, 1), 8);
  EXPECT_EQ(bus.get(0x60C2, 2), -3);
  bus.set(0x60C2, 1, 2);
  bus.set(0x60FB, 4, 3);
  EXPECT_EQ(bus.get(0x60C2, 1), 2);
}

TEST_P(IsmkEaModes, Homing) {
  start(6);
  bus.set(0x6098, 0, 34);  // to the index in the positive direction
  bus.set(0x6099, 1, std::llround(velocity_dec_from_rpm(100)));
  bus.set(0x6099, 2, std::llround(velocity_dec_from_rpm(60)));
  bus.word(0x3F);
  bus.run_cycles(8000, 1);
  EXPECT_EQ(bus.status() & 0x9000, 0x8000);  // home found, no error (C35)
}

// ---- A master that is lost (6007h, Table 9-26) ----

TEST(IsmkEaMaster, LostIsAnAlarmIfWanted) {
  for (const int wanted : {0, 1}) {
    Bus bus;
    bus.set(0x6007, 0, wanted);
    bus.connect();
    bus.enable(3);
    // The watchdog of the outputs: 1000 x 100 us from the factory.
    bus.run_ms(300);
    EXPECT_EQ(bus.al_status().code, ethercat::AlStatusCode::sync_manager_watchdog);
    bus.run_ms(20);
    EXPECT_EQ(bus.device.drive().is_active(drive::Cause::communication_lost), wanted == 1) << wanted;
    bus.fetch();
    if (wanted == 1) {
      ASSERT_EQ(bus.emergencies.size(), 1U);
      EXPECT_EQ(bus.emergencies[0].size(), 8U);
    }
  }
}

TEST(IsmkEaMaster, LeavingOperationalWithPowerIsAnAlarmIfWanted) {
  for (const std::uint8_t state : std::to_array<std::uint8_t>({4, 2, 1})) {
    for (const int wanted : {0, 1}) {
      SCOPED_TRACE(wanted);
      Bus bus;
      bus.set(0x6007, 0, wanted);
      bus.connect();
      bus.enable(3);
      bus.put<std::int32_t>(Bus::Out::velocity, static_cast<std::int32_t>(velocity_dec_from_rpm(300)));
      bus.run_cycles(300, 1);
      EXPECT_NEAR(bus.plant.velocity_rpm(), 300.0, 20.0);
      EXPECT_EQ(bus.request(state), bus.good(state));
      bus.run_ms(2000);
      EXPECT_EQ(bus.device.drive().is_active(drive::Cause::communication_lost), wanted == 1);
      EXPECT_NEAR(bus.plant.velocity_rpm(), wanted == 1 ? 0.0 : 300.0, 20.0);
    }
  }
}

TEST(IsmkEaMaster, LeavingOperationalWithoutPowerIsNone) {
  Bus bus;
  bus.set(0x6007, 0, 1);
  bus.connect();
  bus.enable(3);
  bus.word(0x06, 300);
  EXPECT_EQ(bus.request(4), bus.good(4));
  bus.run_ms(20);
  EXPECT_FALSE(bus.device.drive().is_active(drive::Cause::communication_lost));
}

TEST(IsmkEaStorage, AsOnCan) {
  Bus bus;
  bus.to_pre_operational();
  EXPECT_EQ(bus.download(0x6081, 0, 1234567, 4), dictionary::AbortCode::none);
  EXPECT_EQ(bus.download(0x607C, 0, 777, 4), dictionary::AbortCode::none);
  EXPECT_EQ(bus.download(0x2FF0, 1, 1, 1), dictionary::AbortCode::none);
  EXPECT_EQ(bus.download(0x2FFF, 0, 0xAA55, 2), dictionary::AbortCode::none);  // restart
  bus.run_ms(25);
  EXPECT_EQ(bus.al_status(), bus.good(1));  // the controller restarts
  EXPECT_EQ(bus.get(0x607C), 777);
  EXPECT_EQ(bus.get(0x6081), 0);  // not stored (ch. 7.5, 2508.09)
}

}  // namespace
}  // namespace ismk_ea_test
}  // namespace servodrome::test
