#include "line/line.hpp"

#include <gtest/gtest.h>
#include <random>

#include "canopen/node.hpp"
#include "drive/drive.hpp"
#include "support.hpp"

namespace servodrome::line {
namespace line_test {
namespace {

using namespace test;

// The same scenario for every line: configure, home the left axis, send SYNCs and heartbeats.
struct Step {
  Time at;
  canopen::Frame frame;
};

std::vector<Step> story() {
  std::vector<Step> steps;
  Time at = 20ms;
  const auto add = [&](const canopen::Frame& frame) {
    steps.push_back({at, frame});
    at += 1'234'567ns;
  };
  for (const std::uint8_t node : {std::uint8_t{1}, std::uint8_t{2}}) {
    add(sdo_write(node, 0x1017, 0, 7, 2));
    add(sdo_write(node, 0x6060, 0, 3, 1));
    add(sdo_write(node, 0x6081, 0, 200000, 4));
    add(sdo_write(node, 0x6083, 0, 2000000, 4));
    add(sdo_write(node, 0x6084, 0, 2000000, 4));
    add(nmt(1, node));
    for (const std::uint32_t controlword : {6U, 7U, 15U}) {
      add(sdo_write(node, 0x6040, 0, controlword, 2));
      at += 60ms;
    }
    add(sdo_write(node, 0x60FF, 0, 100000, 4));
  }
  canopen::Frame sync;
  sync.id = 0x80;
  for (int i = 0; i < 40; ++i) add(sync);
  return steps;
}

// The data that must be equal in two runs: every frame with its times, and the final positions of the shafts.
std::string run(const std::function<void(Line&, Time)>& pass_time) {
  Line line(settings_of(two_axes));
  Recorder recorder(line.buses()[0]->bus);
  links::MemoryPort master(line.buses()[0]->bus);
  for (const Step& step : story()) {
    pass_time(line, step.at);
    EXPECT_EQ(line.now(), step.at);
    EXPECT_TRUE(master.send(step.frame, line.now()));
  }
  pass_time(line, 700ms);
  std::string result = recorder.text();
  for (const auto& axis : line.axes()) {
    result += fmt::format("{} {} {:a} {:a}\n", axis->settings().name, axis->plant().position_counts(),
                          axis->plant().position_fraction(), axis->plant().velocity_rpm());
  }
  return result;
}

void at_once(Line& line, Time target) { line.run_until(target); }

TEST(Line, TwoRunsAgreeToTheLastBit) {
  const std::string first = run(at_once);
  EXPECT_EQ(first, run(at_once));
  EXPECT_GT(first.size(), 4000U);
}

TEST(Line, HowTimeIsCutIntoCallsChangesNothing) {
  const std::string whole = run(at_once);
  std::mt19937_64 random(1);
  EXPECT_EQ(whole, run([&random](Line& line, Time target) {
              while (line.now() < target) {
                line.run_until(std::min(target, line.now() + Time(random() % 700'000)));
              }
            }));
  EXPECT_EQ(whole, run([](Line& line, Time target) {
              while (line.now() < target - 1ms) line.step();
              line.run_until(target);
            }));
}

TEST(Line, TheStoryMovesTheAxes) {
  Line line(settings_of(two_axes));
  links::MemoryPort master(line.buses()[0]->bus);
  for (const Step& step : story()) {
    line.run_until(step.at);
    master.send(step.frame, line.now());
  }
  line.run_until(700ms);
  for (const auto& axis : line.axes()) EXPECT_GT(axis->plant().position_counts(), 1000) << axis->settings().name;
}

TEST(Line, AFrameIsAnsweredWhereItEnded) {
  Line line(settings_of(two_axes));
  Recorder recorder(line.buses()[0]->bus);
  links::MemoryPort master(line.buses()[0]->bus);
  for (const Time at : {20'000'000ns, 22'013'777ns, 24'999'999ns}) {
    line.run_until(at);
    recorder.events.clear();
    master.send(sdo_read(1, 0x1000, 0), line.now());
    line.run_until(at + 1ms);
    ASSERT_EQ(recorder.events.size(), 2U);
    const links::BusEvent& request = recorder.events[0];
    const links::BusEvent& response = recorder.events[1];
    EXPECT_EQ(request.start, at);
    EXPECT_EQ(response.frame.id, 0x581U);
    // The answer is queued when the request ends, so it starts after the interframe space: 3 bits of 1 us.
    EXPECT_EQ(response.start, request.end + 3us);
  }
}

// A wrapper of a product that records when its drive worked and which times it received.
struct Calls {
  std::vector<std::pair<char, Time>> log;
};
Calls* calls = nullptr;

class Witness final : public products::Device {
 public:
  explicit Witness(const products::Settings& settings)
      : device_(find_product(all_products(), "generic402")->make(settings)) {}
  void power_on(const drive::Feedback& feedback, Time now) override { device_->power_on(feedback, now); }
  void power_off() override { device_->power_off(); }
  void cycle(Time now) override {
    note('c', now);
    device_->cycle(now);
  }
  void receive(const canopen::Frame& frame, Time now) override {
    note('r', now);
    device_->receive(frame, now);
  }
  void poll(Time now) override {
    note('p', now);
    device_->poll(now);
  }
  Time next_deadline() override { return device_->next_deadline(); }
  bool take(canopen::Frame& frame) override { return device_->take(frame); }
  const canopen::WaitingFrame* next_frame() override { return device_->next_frame(); }
  void frame_sent(const canopen::Frame& frame) override { device_->frame_sent(frame); }
  drive::Drive& drive() override { return device_->drive(); }
  dictionary::Dictionary& dictionary() override { return device_->dictionary(); }
  dictionary::Dictionary& bus_dictionary() override { return device_->bus_dictionary(); }
  canopen::Node* can_node() override { return device_->can_node(); }
  std::uint8_t node_id() const override { return device_->node_id(); }
  std::uint32_t bit_rate() const override { return device_->bit_rate(); }

 private:
  void note(char what, Time when) {
    if (calls != nullptr && device_->node_id() == 1) calls->log.emplace_back(what, when);
  }

  std::shared_ptr<products::Device> device_;
};

std::shared_ptr<products::Device> make_witness(const products::Settings& settings) {
  return std::make_shared<Witness>(settings);
}

// Two axes whose cycles are 3 ticks apart send to each other in every cycle. Neither of them may receive the other's
// frame at a wrong time.
TEST(Line, AnAxisIsCaughtUpToAFrameBeforeItReceivesIt) {
  const std::array<Product, 1> products{Product{"witness", "", make_witness, 1, 8, {}, nullptr}};
  const LineSettings settings = settings_of(
      "[[bus]]\nname='can0'\n[[axis]]\nname='a'\nproduct='witness'\nnode=1\n[[axis]]\nname='b'\nproduct='witness'"
      "\nnode=2\n",
      products);
  Calls log;
  calls = &log;
  Line line(settings);
  links::MemoryPort master(line.buses()[0]->bus);
  Axis& b = *line.find_axis("b");
  line.run_until(10ms);
  b.power_off(line.now());
  line.run_until(10ms + 3 * tick_length);
  b.power_on(line.now());
  for (int i = 0; i < 400; ++i) {
    line.run_until(line.now() + 777'777ns);
    master.send(sdo_read(i % 2 == 0 ? 1 : 2, 0x6064, 0), line.now());
  }
  calls = nullptr;

  Time last_cycle{};
  Time last{};
  Time period{};
  int received = 0;
  int cycles = 0;
  for (const auto& [what, when] : log.log) {
    EXPECT_GE(when, last);
    last = when;
    if (what == 'c') {
      EXPECT_EQ(when % tick_length, Time{});
      if (++cycles > 2) {
        EXPECT_EQ(when - last_cycle, period);
      }
      period = when - last_cycle;
      last_cycle = when;
    } else if (what == 'r' && cycles > 2) {
      ++received;
      EXPECT_LT(when - last_cycle, period) << "received before the cycle that was due";
    }
  }
  EXPECT_GT(received, 590);  // 400 requests, and b's 200 answers
  EXPECT_GT(cycles, 500);
}

TEST(Line, APowerCycleForgetsWhatIsNotStored) {
  Line line(settings_of(two_axes));
  Axis& axis = *line.find_axis("right");
  line.run_until(20ms);
  auto& dictionary = axis.device().dictionary();
  ASSERT_EQ(dictionary.set_number(0x6081, 0, 4321), dictionary::AbortCode::none);
  axis.power_off(line.now());
  EXPECT_FALSE(axis.powered());
  line.run_until(40ms);
  axis.power_on(line.now());
  line.run_until(60ms);
  EXPECT_NE(dictionary.number(0x6081), 4321);
  // A stored value survives: 1010h:01 = "save".
  ASSERT_EQ(dictionary.set_number(0x6081, 0, 4321), dictionary::AbortCode::none);
  ASSERT_EQ(dictionary.set_number(0x1010, 1, 0x65766173), dictionary::AbortCode::none);
  axis.power_off(line.now());
  axis.power_on(line.now());
  line.run_until(80ms);
  EXPECT_EQ(dictionary.number(0x6081), 4321);
}

TEST(Line, AnAxisWithoutPowerIsSilentAndAnnouncesItselfAgain) {
  Line line(settings_of(two_axes));
  links::MemoryPort master(line.buses()[0]->bus);
  line.run_until(20ms);
  line.find_axis("left")->power_off(line.now());
  while (master.receive()) {
  }
  master.send(sdo_read(1, 0x1000, 0), line.now());
  line.run_until(40ms);
  EXPECT_FALSE(master.receive());
  line.find_axis("left")->power_on(line.now());
  line.run_until(60ms);
  const auto boot_up = master.receive();
  ASSERT_TRUE(boot_up);
  EXPECT_EQ(boot_up->frame.id, 0x701U);
  EXPECT_GE(boot_up->at, 40ms);
}

TEST(Line, RunningOntoALimitSwitchIsSeenByTheDrive) {
  Line line(settings_of(two_axes));
  Axis& axis = *line.find_axis("left");
  line.run_until(10ms);
  EXPECT_EQ(axis.device().dictionary().number(0x60FD) & 7, 4);  // the home switch is active
  axis.plant().set_position_counts(1'000'000);
  line.run_until(20ms);
  EXPECT_EQ(axis.device().dictionary().number(0x60FD) & 7, 2);
  axis.plant().set_position_counts(-1'000'001);
  line.run_until(30ms);
  EXPECT_EQ(axis.device().dictionary().number(0x60FD) & 7, 1);
}

TEST(Line, EachCanProductOfTheRegistryRunsAndDescribesItself) {
  for (const Product& product : all_products()) {
    if (product.fieldbus != Fieldbus::can) continue;
    Line line(settings_of(
        fmt::format("[[bus]]\nname='can0'\n[[axis]]\nname='x'\nproduct='{}'\nserial_number=77\n", product.name)));
    Recorder recorder(line.buses()[0]->bus);
    links::MemoryPort listener(line.buses()[0]->bus);
    line.run_until(100ms);
    EXPECT_EQ(line.axes()[0]->device().node_id(), product.factory_node_id) << product.name;
    EXPECT_EQ(line.axes()[0]->device().dictionary().number(0x1018, 4), 77) << product.name;
    ASSERT_FALSE(recorder.events.empty()) << product.name;
    EXPECT_EQ(recorder.events[0].frame.id, 0x700U + product.factory_node_id) << product.name;
    const describe::Description description = product.describe();
    EXPECT_EQ(description.table.data(), line.axes()[0]->device().dictionary().table().data()) << product.name;
    EXPECT_NE(describe::eds(description).find("[6041]"), std::string::npos) << product.name;
  }
  EXPECT_EQ(find_product(all_products(), "toaster"), nullptr);
}

TEST(Line, AnIdealBusTakesNoTime) {
  Line line(settings_of("[[bus]]\nname='can0'\nideal=true\n[[axis]]\nname='x'\nproduct='ismc'\n"));
  links::MemoryPort master(line.buses()[0]->bus);
  line.run_until(20ms);
  while (master.receive()) {
  }
  master.send(sdo_read(1, 0x1000, 0), line.now());
  line.run_until(line.now());
  const auto answer = master.receive();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->at, 20ms);
  EXPECT_EQ(answer->frame.id, 0x581U);
}

}  // namespace
}  // namespace line_test
}  // namespace servodrome::line
