#include <cmath>
#include <functional>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_bus.hpp"
#include "products/generic402/generic402.hpp"
#include "products/generic402/generic402_ec.hpp"
#include "products/ismc/ismc.hpp"
#include "products/ismk/ismk_ea.hpp"
#include "products/pronet/pronet.hpp"

// A missing cyclic set-point: the drive bridges one, two end the motion. On CANopen the SYNC is lost together with the
// PDO, on EtherCAT the frame of a cycle.
namespace servodrome {
namespace missed_cycle_test {
namespace {

using dictionary::AbortCode;

// One period of the bus, for an enabled axis; `set_point` in user units.
struct Master {
  virtual ~Master() = default;
  virtual void cycle(std::int32_t set_point) = 0;
  virtual void lost_cycle() = 0;
  virtual const drive::Drive& drive() = 0;
  virtual std::uint16_t status() = 0;
  virtual void set(std::uint16_t index, std::uint8_t sub, std::int64_t value) = 0;

  double period_ms = 1.0;
  std::function<void()> each_ms;
  // Position of the demand in counts; its velocity in counts/s.
  double place() { return static_cast<double>(generator().position()) + generator().fraction(); }
  double velocity() { return generator().velocity(); }
  const drive::Generator& generator() { return drive().axis().generator; }
  std::int32_t here() {
    return static_cast<std::int32_t>(drive().axis().to_user_position(drive().axis().generator.nearest_position()));
  }
  double to_counts(double user) { return user * drive().axis().units.position.value(); }
};

template <typename RigType>
struct Wired : Master {
  template <typename... Arguments>
  explicit Wired(Arguments&&... arguments) : rig(std::forward<Arguments>(arguments)...) {}
  const drive::Drive& drive() override { return rig.device.drive(); }
  std::uint16_t status() override { return rig.status(); }
  void set(std::uint16_t index, std::uint8_t sub, std::int64_t value) override { rig.set(index, sub, value); }
  void pass() {
    due_ += 16.0 * period_ms;
    for (int tick = 0; static_cast<double>(passed_) + 0.5 < due_; ++tick, ++passed_) {
      rig.tick();
      if (each_ms && tick % 16 == 15) each_ms();
    }
  }
  RigType rig;

 private:
  double due_ = 0.0;  // ticks
  std::int64_t passed_ = 0;
};

// RPDO 1 contains controlword and set-point, and takes effect at the SYNC.
template <typename RigType>
struct OnCan : Wired<RigType> {
  using Wired<RigType>::rig;
  using Wired<RigType>::pass;

  template <typename... Arguments>
  OnCan(std::int8_t mode, std::uint16_t object, int its_period_ms, Arguments&&... arguments)
      : Wired<RigType>(std::forward<Arguments>(arguments)...), word_(mode == 7 ? 0x1F : 0x0F) {
    this->period_ms = its_period_ms;
    rig.run_ms(1);
    for (std::uint16_t pdo = 0; pdo < 4; ++pdo) {
      const auto receive = static_cast<std::uint16_t>(0x1400 + pdo);
      const auto transmit = static_cast<std::uint16_t>(0x1800 + pdo);
      rig.set(receive, 1, 0x80000000 | rig.get(receive, 1));
      rig.set(transmit, 1, 0x80000000 | rig.get(transmit, 1));
    }
    must(0x1600, 0, 0);
    must(0x1600, 1, 0x60400010);
    must(0x1600, 2, object == 0x60C1 ? 0x60C10120 : 0x607A0020);
    must(0x1600, 0, 2);
    must(0x1400, 2, 1);
    must(0x1400, 1, 0x200 + rig.device.node_id());
    must(0x6060, 0, mode);
    EXPECT_TRUE(rig.enable());
    rig.send(0, {0x01, rig.device.node_id()});
  }
  void must(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
    EXPECT_EQ(rig.set(index, sub, value), AbortCode::none) << std::hex << index << ":" << int{sub};
  }
  void cycle(std::int32_t set_point) override {
    send(set_point);
    pass();
  }
  void send(std::int32_t set_point) {
    const auto value = static_cast<std::uint32_t>(set_point);
    rig.send(0x200U + rig.device.node_id(),
             {static_cast<std::uint8_t>(word_), static_cast<std::uint8_t>(word_ >> 8), static_cast<std::uint8_t>(value),
              static_cast<std::uint8_t>(value >> 8), static_cast<std::uint8_t>(value >> 16),
              static_cast<std::uint8_t>(value >> 24)});
    rig.send(0x080, {});
  }
  void lost_cycle() override { pass(); }

 private:
  std::uint16_t word_;
};

struct Generic402OnCan : OnCan<test::Rig<products::Generic402>> {
  Generic402OnCan(std::int8_t mode, int period) : OnCan(mode, mode == 7 ? 0x60C1 : 0x607A, period) {
    must(0x60C2, 1, period);
  }
};
struct IsmcOnCan : OnCan<test::Rig<products::Ismc>> {
  explicit IsmcOnCan(int period) : OnCan(8, 0x607A, period) { must(0x60C2, 1, period); }
};
struct IsmkOnCan : OnCan<test::IsmkRig> {
  explicit IsmkOnCan(int period) : OnCan(7, 0x607A, period) {
    must(0x3011, 1, period == 1 ? 0 : period == 2 ? 1 : 2);
    must(0x3011, 2, 1);
  }
};
struct PronetOnCan : OnCan<test::Rig<products::Pronet>> {
  explicit PronetOnCan(int period) : OnCan(7, 0x60C1, period) {
    must(0x60C2, 1, period);
    must(0x2105, 0, period * 1000);
  }
};

// `sync0_ns` 0: synchronous with the event of the sync manager.
template <typename RigType>
struct OnEthercat : Wired<RigType> {
  using Wired<RigType>::rig;

  OnEthercat(std::uint32_t sync0_ns, std::size_t mode_at, std::size_t position_at, std::int8_t mode, std::uint16_t word)
      : position_at_(position_at) {
    rig.set(0x10F1, 2, 100);
    rig.to_pre_operational();
    if (sync0_ns != 0) {
      rig.start_sync0(sync0_ns);
      this->period_ms = 1e-6 * sync0_ns;
      // Frames come half a period after the pulses.
      const auto time = ethercat::load<std::uint64_t>(rig.read(ethercat::reg::system_time, 8).data());
      rig.run_ms(1e-6 * static_cast<double>((sync0_ns - time % sync0_ns + sync0_ns / 2) % sync0_ns));
    }
    rig.set_process_data();
    EXPECT_EQ(rig.request(4), rig.good(4));
    for (int i = 0; i < 20; ++i) again();
    rig.write(ethercat::reg::al_control, test::little_endian(std::uint16_t{8}));
    for (int i = 0; i < 20; ++i) again();
    EXPECT_EQ(rig.al_status(), rig.good(8));
    rig.template put<std::int8_t>(mode_at, mode);
    rig.template put<std::int32_t>(position_at, this->here());
    for (const std::uint16_t one : {std::uint16_t{0x06}, std::uint16_t{0x07}, word}) {
      rig.template put<std::uint16_t>(0, one);
      for (int i = 0; i < 200; ++i) again();
    }
    EXPECT_EQ(rig.device.drive().state(), drive::PowerState::operation_enabled);
  }
  void again() {
    rig.exchange();
    this->pass();
  }
  void cycle(std::int32_t set_point) override {
    rig.template put<std::int32_t>(position_at_, set_point);
    again();
  }
  void lost_cycle() override { this->pass(); }

 private:
  std::size_t position_at_;
};

struct Generic402OnEthercat : OnEthercat<test::EthercatRig<products::Generic402Ec>> {
  explicit Generic402OnEthercat(std::uint32_t sync0_ns) : OnEthercat(sync0_ns, 12, 2, 8, 0x0F) {}
};
struct IsmkEaRig : test::EthercatRig<products::IsmkEa> {
  IsmkEaRig() : EthercatRig(test::ismk_plant(), test::ismk_settings()) {
    set(0x60F9, 6, 0x80);
    device.set_rigidity(150.0);
    set(0x60C2, 1, 1);
  }
};
struct IsmkOnEthercat : OnEthercat<IsmkEaRig> {
  explicit IsmkOnEthercat(std::uint32_t sync0_ns, std::int8_t mode = 8)
      : OnEthercat(sync0_ns, 12, 2, mode, mode == 7 ? 0x1F : 0x0F) {
    if (mode == 7) rig.set(0x3011, 2, 1);
  }
};
struct JmcOnEthercat : Wired<test::JmcBus> {
  explicit JmcOnEthercat(std::uint32_t sync0_ns) {
    rig.set(0x10F1, 2, 100);
    rig.open_limits();
    rig.connect(sync0_ns);
    rig.enable_in(8);
    rig.cycles(200);
    period_ms = rig.period_ms;
  }
  void cycle(std::int32_t set_point) override {
    rig.put<std::int32_t>(test::JmcBus::Out::position, set_point);
    rig.exchange();
    pass();
  }
  void lost_cycle() override { pass(); }
};

struct Case {
  const char* name;
  std::function<std::unique_ptr<Master>()> make;
};
template <typename MasterType, typename... Arguments>
Case each(const char* name, Arguments... arguments) {
  return {name, [arguments...] { return std::make_unique<MasterType>(arguments...); }};
}
void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

class MissedCycle : public testing::TestWithParam<Case> {
 protected:
  // Sends set-points at constant speed, one revolution per second, for `periods`.
  void stream(int periods) {
    for (int i = 0; i < periods; ++i) master->cycle(next());
  }
  std::int32_t next() {
    ++number_;
    return begin_ + static_cast<std::int32_t>(step() * number_);
  }
  // Whole user units per period.
  std::int32_t step() {
    const double user_per_turn = master->drive().axis().units.counts_per_revolution / master->to_counts(1.0);
    return std::max(1, static_cast<std::int32_t>(user_per_turn * 1e-3 * master->period_ms * speed));
  }
  double speed_counts() { return master->to_counts(step()) / (1e-3 * master->period_ms); }
  // The greatest position of the demand while the axis is enabled.
  void watch(double& farthest) {
    master->each_ms = [this, &farthest] {
      if (master->drive().state() != drive::PowerState::operation_enabled) return;
      farthest = std::max(farthest, master->place());
    };
  }
  void skip() {
    ++number_;
    master->lost_cycle();
  }

  double speed = 2.0;  // revolutions per second
  std::unique_ptr<Master> master = GetParam().make();
  std::int32_t begin_ = master->here();
  int number_ = 0;
};

TEST_P(MissedCycle, OneLostCycleLeavesNoHole) {
  stream(100);
  double least = 1e18;
  double most = -1e18;
  master->each_ms = [&] {
    least = std::min(least, master->velocity());
    most = std::max(most, master->velocity());
  };
  for (int i = 0; i < 20; ++i) {
    stream(20);
    skip();
  }
  stream(20);
  std::printf("%s: %.1f %% to %.1f %% of the speed\n", GetParam().name, 100.0 * least / speed_counts(),
              100.0 * most / speed_counts());
  EXPECT_GT(least, 0.9 * speed_counts());
  EXPECT_LT(most, 1.1 * speed_counts());
  EXPECT_EQ(master->drive().shown_fault(), nullptr);
}

TEST_P(MissedCycle, AStreamThatEndsRestsAtItsLastTarget) {
  stream(100);
  const double last = master->to_counts(begin_ + number_ * step());
  double farthest = 0.0;
  watch(farthest);
  for (int i = 0; i < 400 && master->drive().state() == drive::PowerState::operation_enabled; ++i) master->lost_cycle();
  const double cycle = master->drive().axis().cycle_s;
  std::printf("%s: %.2f periods beyond the last target\n", GetParam().name,
              (farthest - last) / speed_counts() / (1e-3 * master->period_ms));
  EXPECT_LT(farthest - last, speed_counts() * (1e-3 * master->period_ms + 2.0 * cycle));
  if (master->drive().state() != drive::PowerState::operation_enabled) return;  // the drive has its own fault: A 69
  EXPECT_EQ(master->velocity(), 0.0);
  EXPECT_NEAR(master->place(), last, 1.0);
}

// A motion that has ended must not continue when its master stops sending.
TEST_P(MissedCycle, AStreamThatSlowsDownIsNotCarriedOn) {
  stream(50);
  std::int32_t target = begin_ + number_ * step();
  for (int i = 20; i > 0; --i) {
    target += step() * i / 20;
    master->cycle(target);
  }
  const double last = master->to_counts(target);
  double farthest = 0.0;
  watch(farthest);
  for (int i = 0; i < 20 && master->drive().state() == drive::PowerState::operation_enabled; ++i) master->lost_cycle();
  EXPECT_LE(farthest - last, 0.05 * speed_counts() * 2.0 * master->drive().axis().cycle_s + 1.0);
}

// A command in place of the missing set-point acts as usual.
TEST_P(MissedCycle, ACommandEndsTheBridge) {
  struct Row {
    std::uint16_t word;
    bool halts;
  };
  for (const Row& row : {Row{0x010F, true}, Row{0x0002, false}, Row{0x0007, false}, Row{0x0000, false}}) {
    if (row.halts && master->drive().policy().modes.without_halt != 0) continue;
    SCOPED_TRACE(row.word);
    master = GetParam().make();
    begin_ = master->here();
    number_ = 0;
    for (const std::uint16_t ramp : std::to_array<std::uint16_t>({0x6083, 0x6084, 0x6085})) {
      master->set(ramp, 0, std::lround(5e6 / master->drive().axis().units.acceleration));
    }
    stream(100);
    const double last = master->to_counts(begin_ + number_ * step());
    master->lost_cycle();
    const auto with_bit_4 = static_cast<std::uint16_t>(row.word | (row.halts ? 0x10 : 0));
    master->set(0x6040, 0, with_bit_4);
    for (int i = 0; i < 500; ++i) master->lost_cycle();
    EXPECT_EQ(master->velocity(), 0.0);
    EXPECT_LT(std::abs(master->place() - last), 0.1 * master->drive().axis().units.counts_per_revolution);
  }
}

TEST_P(MissedCycle, TheSoftwareLimitHolds) {
  const std::int32_t limit = begin_ + 101 * step();
  master->set(0x607D, 1, begin_ - 100 * step());
  master->set(0x607D, 2, limit);
  if (!master->drive().axis().software_limits_active()) return;  // this drive needs homing first
  stream(100);
  double farthest = -1e18;
  master->each_ms = [&] { farthest = std::max(farthest, master->place()); };
  for (int i = 0; i < 20; ++i) master->lost_cycle();
  EXPECT_LE(farthest, master->to_counts(limit) + 0.5);
  EXPECT_EQ(master->drive().shown_fault(), nullptr);
}

INSTANTIATE_TEST_SUITE_P(
    Drives, MissedCycle,
    testing::Values(each<Generic402OnCan>("generic402_csp_2ms", std::int8_t{8}, 2),
                    each<Generic402OnCan>("generic402_csp_4ms", std::int8_t{8}, 4),
                    each<Generic402OnCan>("generic402_csp_1ms", std::int8_t{8}, 1),
                    each<Generic402OnCan>("generic402_ip_2ms", std::int8_t{7}, 2),
                    each<Generic402OnCan>("generic402_ip_1ms", std::int8_t{7}, 1),
                    each<Generic402OnCan>("generic402_ip_4ms", std::int8_t{7}, 4), each<IsmcOnCan>("ismc_2ms", 2),
                    each<IsmcOnCan>("ismc_4ms", 4), each<IsmkOnCan>("ismk_2ms", 2), each<IsmkOnCan>("ismk_1ms", 1),
                    each<PronetOnCan>("pronet_2ms", 2), each<PronetOnCan>("pronet_1ms", 1),
                    each<Generic402OnEthercat>("generic402_ec_sm", 0U),
                    each<Generic402OnEthercat>("generic402_ec_1ms", 1'000'000U),
                    each<Generic402OnEthercat>("generic402_ec_2ms", 2'000'000U), each<JmcOnEthercat>("jmc_ec_sm", 0U),
                    each<JmcOnEthercat>("jmc_ec_1ms", 1'000'000U), each<JmcOnEthercat>("jmc_ec_4ms", 4'000'000U),
                    each<IsmkOnEthercat>("ismk_ea_sm", 0U), each<IsmkOnEthercat>("ismk_ea_1ms", 1'000'000U),
                    each<IsmkOnEthercat>("ismk_ea_ip_1ms", 1'000'000U, std::int8_t{7}),
                    each<IsmkOnEthercat>("ismk_ea_2ms", 2'000'000U)),
    [](const testing::TestParamInfo<Case>& one) { return one.param.name; });

// A limit switch that is met during the bridging ends the motion as usual, and later targets do not continue it.
TEST(MissedCycleAt, ALimitSwitch) {
  for (const std::int8_t mode : {std::int8_t{7}, std::int8_t{8}}) {
    SCOPED_TRACE(int{mode});
    Generic402OnCan master(mode, 4);
    master.must(0x6085, 0, 5'000'000);
    int number = 0;
    const auto stream = [&](int periods) {
      for (int i = 0; i < periods; ++i) master.cycle(1000 * ++number);
    };
    stream(50);
    const double last = master.place();
    master.lost_cycle();
    master.rig.plant.force_input(1, true);
    master.lost_cycle();
    master.rig.run_ms(100);
    EXPECT_EQ(master.velocity(), 0.0);
    const double stood = master.place();
    EXPECT_LT(stood - last, 1000.0 + 125.0 + 250000.0 * 250000.0 / 2.0 / 5e6 + 1.0);
    number += 27;
    stream(50);
    EXPECT_EQ(master.place(), stood);
  }
}

// The time between set-points is that of SYNC0, even if 60C2h cannot hold its value: the motion is as smooth as with
// any other.
TEST(Sync0Period, MayBeAnything) {
  constexpr std::uint32_t period_ns = 3'333'000;
  const auto check = [](Master& master) {
    const std::int32_t begin = master.here();
    const double speed = 2.0 * master.drive().axis().units.counts_per_revolution;  // counts/s
    double least = 1e18;
    double most = -1e18;
    for (int i = 1; i <= 600; ++i) {
      if (i == 50) {
        master.each_ms = [&] {
          least = std::min(least, master.velocity());
          most = std::max(most, master.velocity());
        };
      }
      master.cycle(begin +
                   static_cast<std::int32_t>(std::lround(speed * i * 1e-9 * period_ns / master.to_counts(1.0))));
    }
    std::printf("SYNC0 of 3.333 ms: %.1f %% to %.1f %% of the speed\n", 100.0 * least / speed, 100.0 * most / speed);
    EXPECT_GT(least, 0.97 * speed);
    EXPECT_LT(most, 1.03 * speed);
  };
  Generic402OnEthercat generic402(period_ns);
  check(generic402);
  IsmkOnEthercat ismk(period_ns);
  check(ismk);
  // Another period from the next start on.
  EXPECT_EQ(generic402.rig.request(1), generic402.rig.good(1));
  EXPECT_EQ(generic402.drive().configuration().set_point_period_s, 0.0);
  // This drive only accepts periods that are multiples of 125 us (C-42).
  test::JmcBus jmc;
  jmc.to_pre_operational();
  jmc.start_sync0(period_ns);
  jmc.set_process_data();
  EXPECT_EQ(jmc.request(4), (test::JmcBus::AlStatus{0x12, ethercat::AlStatusCode::invalid_sync_cycle_time}));
}

}  // namespace
}  // namespace missed_cycle_test
}  // namespace servodrome
