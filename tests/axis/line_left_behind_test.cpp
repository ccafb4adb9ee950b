// A line that catches up lazily (Line::keep_up) must answer every frame exactly like one that catches up for each
// frame. Compares the same master session byte by byte: scan, moving drives, and a fault.
#include <gtest/gtest.h>

#include "axis/axis402.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "master/ethercat/coe_objects.hpp"
#include "master/ethercat/operation.hpp"

namespace servodrome::master {
namespace line_left_behind_test {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

constexpr const char* three_drives = R"(
clock = "virtual"
[[bus]]
name = "ring"
type = "ethercat"
[[axis]]
name = "x"
product = "generic402-ec"
oscillator_ppm = 60
cable_ns = 120
[[axis]]
name = "y"
product = "jmc_ec"
[[axis]]
name = "z"
product = "generic402-ec"
oscillator_ppm = -90
)";

// The bytes of an answer and the time of its arrival.
struct Answer {
  Time at;
  Bytes bytes;
  bool operator==(const Answer&) const = default;
};

struct Session {
  std::vector<Answer> answers;
  Time behind{};              // greatest lag of the line behind its master
  std::uint16_t too_short{};  // 1C32h:0C of the first drive
};

// A master's link that advances the line for every frame, or lazily. Records all answers.
class Client final : public links::EthercatClient {
 public:
  Client(line::Line& line, bool leaves_behind, Session& session)
      : line_(line), leaves_behind_(leaves_behind), session_(session), now_(line.now()) {}

  void send(std::span<const std::uint8_t> content) override {
    leaves_behind_ ? line_.keep_up(now_) : line_.run_until(now_);
    session_.behind = std::max(session_.behind, now_ - line_.now());
    links::EthercatBus& bus = line_.ethercat_buses()[0]->bus;
    Bytes bytes(content.begin(), content.end());
    const auto passage =
        bus.pass(bytes, now_, links::EthercatBus::Port::primary, links::EthercatBus::Encapsulation::payload);
    bus.settle(now_);
    if (passage.exit != links::EthercatBus::Exit::lost) returning_.push_back({passage.leaves, std::move(bytes)});
  }
  std::size_t receive(std::span<std::uint8_t> into, Time timeout) override {
    if (returning_.empty() || returning_.front().at > now_ + timeout) {
      now_ += timeout;
      return 0;
    }
    const Answer answer = std::move(returning_.front());
    returning_.erase(returning_.begin());
    now_ = std::max(now_, answer.at);
    session_.answers.push_back(answer);
    const std::size_t size = std::min(into.size(), answer.bytes.size());
    std::copy_n(answer.bytes.begin(), size, into.begin());
    return size;
  }
  Time now() const override { return now_; }
  void wait(Time span) override { now_ += span; }
  std::string name() const override { return "test"; }

 private:
  line::Line& line_;
  bool leaves_behind_;
  Session& session_;
  Time now_;
  std::vector<Answer> returning_;  // in the order of sending, which on a line is also the order of time
};

// A soft coupling, by which each of the two drives turns the other.
constexpr const char* coupled = R"(
[[coupling]]
axes = ["x", "z"]
stiffness_nm_per_rad = 0.02
)";

struct Cycle {
  Time period;
  bool clocks;
  const char* more = "";  // of the line file
};

Session hold_session(const Cycle& cycle, bool leaves_behind) {
  Session session;
  line::Line line{line::test::settings_of(std::string(three_drives) + cycle.more)};
  // Makes the control loops of the drives start at different ticks.
  for (std::size_t i = 0; i < 3; ++i) {
    line.run_until(line.now() + 200us);
    line.axes()[i]->power_off(line.now());
    line.axes()[i]->power_on(line.now());
  }
  auto client = std::make_unique<Client>(line, leaves_behind, session);
  const Client& clock = *client;
  EthercatMaster master{std::move(client)};
  const std::vector<FoundSlave> found = scan_slaves(master);
  std::vector<std::unique_ptr<EthercatSlave>> slaves;
  std::vector<EthercatSlave*> all;
  for (const FoundSlave& one : found) {
    slaves.push_back(std::make_unique<EthercatSlave>(master, one));
    all.push_back(slaves.back().get());
    all.back()->to_pre_operational();
  }
  {
    EthercatOperation operation(
        master, found, all,
        {.cyclic = {.period = cycle.period}, .distributed_clocks = cycle.clocks, .clock = {.drift_frames = 1000}});
    CoeObjects objects(*all[0], operation.exchange(), 0);
    CoeObjects others(*all[2], operation.exchange(), 2);
    Axis402 axis(objects);
    Axis402 other(others);
    axis.enable();
    axis.home({35, {}, {}, {}, 0}, 5s);
    axis.move_to(40'000, {1'000'000, 10'000'000, 10'000'000}, 5s);
    other.enable();
    other.run_at(3'000'000, {{}, 100'000'000, 100'000'000}, 5s);
    axis.run_at(3'000'000, {{}, 100'000'000, 100'000'000}, 5s);
    for (int i = 0; i < 60; ++i) {
      master.wait(137us);
      if (i % 2 == 0) master.wait(line::tick_length - clock.now() % line::tick_length);  // a frame on a tick
      for (const std::size_t member : {0U, 2U}) all[member]->coe().read<std::int32_t>(0x6064);
    }
    // A fault that the drive detects by itself, in the middle of a move.
    line.run_until(clock.now());
    line.axes()[0]->inject(drive::Cause::over_voltage, true);
    master.wait(20ms);
    line.run_until(clock.now());
    line.axes()[0]->inject(drive::Cause::over_voltage, false);
    EXPECT_TRUE(axis.state() == PowerState::fault_reaction_active || axis.state() == PowerState::fault);
    session.too_short = all[0]->coe().read<std::uint16_t>(0x1C32, 0x0C);
  }
  return session;
}

class LineLeftBehind : public testing::TestWithParam<Cycle> {};
INSTANTIATE_TEST_SUITE_P(Cycles, LineLeftBehind,
                         testing::Values(Cycle{70us, false}, Cycle{125us, false}, Cycle{300us, false},
                                         Cycle{1ms, false}, Cycle{750us, true}, Cycle{1ms, true},
                                         Cycle{300us, false, coupled}, Cycle{1ms, true, coupled}),
                         [](const auto& tested) {
                           return std::to_string(tested.param.period / 1us) + (tested.param.clocks ? "usDc" : "us") +
                                  (*tested.param.more != '\0' ? "Coupled" : "");
                         });

TEST_P(LineLeftBehind, AnswersEveryFrameAsOneThatIsUpToDate) {
  const Session here = hold_session(GetParam(), true);
  const Session reference = hold_session(GetParam(), false);
  ASSERT_EQ(here.answers.size(), reference.answers.size());
  EXPECT_GT(here.answers.size(), 300U);
  for (std::size_t i = 0; i < here.answers.size(); ++i) {
    ASSERT_EQ(here.answers[i], reference.answers[i]) << "frame " << i << " at " << reference.answers[i].at.count();
  }
  EXPECT_EQ(here.too_short, reference.too_short);
  EXPECT_GT(here.behind, line::tick_length);  // the line did lag
  EXPECT_EQ(reference.behind, Time{});
}

}  // namespace
}  // namespace line_left_behind_test
}  // namespace servodrome::master
