#include <cmath>
#include <gtest/gtest.h>

#include "frames.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// The worked examples of the ISMC manual (ch. 2 to 6), frame by frame; their motions are compared with values that
// follow from the documented defaults.
namespace servodrome {
namespace ismc_examples_test {
namespace {

using products::Ismc;
using test::Rig;

constexpr std::int64_t ticks_per_cycle = Ismc::policy.loops.position_ticks;
constexpr double ticks_per_s = 16000.0;

// The motion after a frame: from the frame until the demand stands, or has its new speed.
struct Motion {
  double seconds;
  double counts;
};

constexpr double ramp = 1310720.0;          // 6083h, 6084h (ch. 4.3.5)
constexpr double quick_ramp = 5242880.0;    // 6085h (ch. 4.3.5)
constexpr double fast = 1000000.0;          // 6081h of example 8
constexpr double slow_velocity = 500000.0;  // of the velocity step

const Motion triangle{2.0 * std::sqrt(100000.0 / ramp), 100000.0};                            // 0.552 s
const Motion triangle_back{2.0 * std::sqrt(100000.0 / ramp), -100000.0};                      //
const Motion trapezium{2000000.0 / fast + fast / ramp, 2000000.0};                            // 2.763 s
const Motion quick_stop{fast / quick_ramp, fast* fast / 2.0 / quick_ramp};                    // 0.191 s, 95367
const Motion halt{fast / ramp, fast* fast / 2.0 / ramp};                                      // 0.763 s, 381470
const Motion velocity_step{slow_velocity / ramp, slow_velocity* slow_velocity / 2.0 / ramp};  // 0.381 s

struct Step {
  const char* request;
  const char* response = "";  // every frame except TPDOs, in order, separated by "; "
  std::uint16_t mask = 0;     // of the statusword a millisecond later ...
  std::uint16_t status = 0;   // ... and its value there
  const Motion* motion = nullptr;
  double wait_ms = 1.0;
};

struct Example {
  const char* name;
  std::uint8_t node_id;
  std::vector<Step> steps;
};

constexpr std::uint16_t state = 0x6F;
constexpr std::uint16_t acknowledge = 0x1000;
constexpr std::uint16_t reached = 0x0400;

const Step start_node{"000 # 01 01"};
const Step to_pp{"601 # 2F 60 60 00 01 00 00 00", "581 # 60 60 60 00 00 00 00 00"};
const Step velocity_1000000{"601 # 23 81 60 00 40 42 0F 00", "581 # 60 81 60 00 00 00 00 00"};
const Step target_100000{"601 # 23 7A 60 00 A0 86 01 00", "581 # 60 7A 60 00 00 00 00 00"};
const Step target_0{"601 # 23 7A 60 00 00 00 00 00", "581 # 60 7A 60 00 00 00 00 00"};
const Step target_2000000{"601 # 23 7A 60 00 80 84 1E 00", "581 # 60 7A 60 00 00 00 00 00"};
const Step target_far{"601 # 23 7A 60 00 00 2D 31 01", "581 # 60 7A 60 00 00 00 00 00"};  // 20000000

Step control(const char* request, std::uint16_t mask, std::uint16_t status, const Motion* motion = nullptr,
             double wait_ms = 1.0) {
  return {request, "581 # 60 40 60 00 00 00 00 00", mask, status, motion, wait_ms};
}
const Step shutdown = control("601 # 2B 40 60 00 06 00 00 00", state, 0x21);
const Step switch_on = control("601 # 2B 40 60 00 07 00 00 00", state, 0x23);
const Step enable_0f = control("601 # 2B 40 60 00 0F 00 00 00", state, 0x27);

std::vector<Example> examples() {
  std::vector<Example> all{
      {"1: node 2, 60FFh = 1000", 2, {{"602 # 23 FF 60 00 E8 03 00 00", "582 # 60 FF 60 00 00 00 00 00"}}},
      {"2: node 2, 60FFh with a wrong length",
       2,
       {{"602 # 2B FF 60 00 E8 03 00 00", "582 # 80 FF 60 00 10 00 07 06"},
        {"602 # 2F FF 60 00 E8 00 00 00", "582 # 80 FF 60 00 10 00 07 06"},
        {"602 # 27 FF 60 00 E8 03 00 00", "582 # 80 FF 60 00 10 00 07 06"},
        {"602 # 23 40 60 00 06 00 00 00", "582 # 80 40 60 00 10 00 07 06"}}},
      {"3: node 2 in profile velocity, read 6061h",
       2,
       {{"602 # 2F 60 60 00 03 00 00 00", "582 # 60 60 60 00 00 00 00 00"},
        {"602 # 40 61 60 00 00 00 00 00", "582 # 4F 61 60 00 03 00 00 00"}}},
      {"4: node 2, invalid command specifier", 2, {{"602 # E0 61 60 00 00 00 00 00", "582 # 80 61 60 00 01 00 04 05"}}},
      {"5: enable TPDO3",
       1,
       {{"601 # 40 02 18 01 00 00 00 00", "581 # 43 02 18 01 81 03 00 80"},
        {"601 # 23 02 18 01 81 03 00 00", "581 # 60 02 18 01 00 00 00 00"},
        {"601 # 40 02 18 01 00 00 00 00", "581 # 43 02 18 01 81 03 00 00"}}},
      {"6: NMT, each state seen by guarding",
       1,
       {{"000 # 01 01"},
        {"701 # RTR", "701 # 05"},
        {"000 # 02 01"},
        {"701 # RTR", "701 # 84"},
        {"000 # 80 00"},
        {"701 # RTR", "701 # 7F"},
        {"000 # 81 01", "701 # 00"},
        {"701 # RTR", "701 # 7F"},
        {"000 # 82 01", "701 # 00"},
        {"000 # 01 02"},
        {"701 # RTR", "701 # 7F"}}},
      {"7: node guarding in pre-operational", 1, {{"701 # RTR", "701 # 7F"}, {"701 # RTR", "701 # FF"}}},
      {"8b: through the PDOs of the example mapping",
       1,
       {start_node,
        {"301 # 00 00 00 00 40 42 0F 00"},
        {"201 # 06 00 01 A0 86 01 00", "", state, 0x21},
        {"201 # 07 00 01 A0 86 01 00", "", state, 0x23},
        {"201 # 4F 00 01 A0 86 01 00", "", state, 0x27},
        {"201 # 5F 00 01 A0 86 01 00", "", acknowledge, acknowledge, &triangle},
        {"201 # 4F 00 01 A0 86 01 00", "", acknowledge, 0},
        {"201 # 5F 00 01 60 79 FE FF", "", acknowledge, acknowledge, &triangle_back}}},
      {"9: absolute, single",
       1,
       {to_pp, velocity_1000000, shutdown, switch_on, enable_0f, target_2000000,
        control("601 # 2B 40 60 00 1F 00 00 00", acknowledge | reached, acknowledge, &trapezium),
        control("601 # 2B 40 60 00 0F 00 00 00", acknowledge | reached, reached)}},
      {"10: immediate, relative then absolute",
       1,
       {to_pp, velocity_1000000, shutdown, switch_on, control("601 # 2B 40 60 00 6F 00 00 00", state, 0x27),
        target_100000, control("601 # 2B 40 60 00 7F 00 00 00", acknowledge | reached, acknowledge, &triangle),
        control("601 # 2B 40 60 00 6F 00 00 00", acknowledge | reached, reached),
        control("601 # 2B 40 60 00 2F 00 00 00", acknowledge | reached, reached), target_0,
        control("601 # 2B 40 60 00 3F 00 00 00", acknowledge | reached, acknowledge, &triangle_back),
        control("601 # 2B 40 60 00 2F 00 00 00", acknowledge | reached, reached)}},
      {"11: point-to-point, quick stop",
       1,
       {to_pp,
        velocity_1000000,
        shutdown,
        switch_on,
        enable_0f,
        target_far,
        control("601 # 2B 40 60 00 1F 00 00 00", acknowledge, acknowledge, nullptr, 1000.0),
        control("601 # 2B 40 60 00 0B 00 00 00", 0, 0, &quick_stop),
        {"601 # 40 61 60 00 00 00 00 00", "581 # 4F 61 60 00 01 00 00 00", state, 0x40}}},
      {"11: point-to-point, halt; the point must be triggered anew",
       1,
       {to_pp, velocity_1000000, shutdown, switch_on, enable_0f, target_far,
        control("601 # 2B 40 60 00 1F 00 00 00", acknowledge, acknowledge, nullptr, 1000.0),
        control("601 # 2B 40 60 00 0F 01 00 00", 0, 0, &halt),
        control("601 # 2B 40 60 00 0F 01 00 00", static_cast<std::uint16_t>(state | reached), 0x27 | reached),
        control("601 # 2B 40 60 00 0F 00 00 00", state, 0x27, nullptr, 500.0),
        // From the resting position of the halt it makes the same triangular motion.
        target_100000, control("601 # 2B 40 60 00 5F 00 00 00", acknowledge, acknowledge, &triangle)}},
      {"12: profile velocity",
       1,
       {{"601 # 2F 60 60 00 03 00 00 00", "581 # 60 60 60 00 00 00 00 00"},
        {"601 # 23 83 60 00 00 00 14 00", "581 # 60 83 60 00 00 00 00 00"},
        {"601 # 23 84 60 00 00 00 14 00", "581 # 60 84 60 00 00 00 00 00"},
        {"601 # 23 FF 60 00 20 A1 07 00", "581 # 60 FF 60 00 00 00 00 00"},
        shutdown,
        switch_on,
        control("601 # 2B 40 60 00 0F 00 00 00", 0, 0, &velocity_step),
        control("601 # 2B 40 60 00 06 00 00 00", state, 0x21)}},
      {"13: profile torque",
       1,
       {{"601 # 2F 60 60 00 04 00 00 00", "581 # 60 60 60 00 00 00 00 00"},
        {"601 # 23 87 60 00 10 27 00 00", "581 # 60 87 60 00 00 00 00 00"},  // 10000: 1000 %/s
        {"601 # 2B 15 21 00 E8 03 00 00", "581 # 60 15 21 00 00 00 00 00"},
        {"601 # 2B 16 21 00 E8 03 00 00", "581 # 60 16 21 00 00 00 00 00"},
        {"601 # 2B 71 60 00 64 00 00 00", "581 # 60 71 60 00 00 00 00 00"},
        shutdown,
        switch_on,
        control("601 # 2B 40 60 00 0F 00 00 00", static_cast<std::uint16_t>(state | reached), 0x27, nullptr, 9.0),
        // 100 after 10 ms, with 10 per millisecond
        {"601 # 40 74 60 00 00 00 00 00", nullptr, reached, reached, nullptr, 11.0},
        {"601 # 40 74 60 00 00 00 00 00", "581 # 4B 74 60 00 64 00 00 00", reached, reached},
        control("601 # 2B 40 60 00 07 00 00 00", state, 0x23)}},
      {"14: cyclic synchronous position",
       1,
       {{"601 # 2F 60 60 00 08 00 00 00", "581 # 60 60 60 00 00 00 00 00"},
        shutdown,
        switch_on,
        control("601 # 2B 40 60 00 0F 00 00 00", static_cast<std::uint16_t>(state | acknowledge), 0x27 | acknowledge),
        {"601 # 23 7A 60 00 E8 03 00 00", "581 # 60 7A 60 00 00 00 00 00"},
        {"601 # 40 62 60 00 00 00 00 00", "581 # 43 62 60 00 E8 03 00 00"}}},
  };
  Example ten_times{
      "8: profile position, relative, ten times", 1, {to_pp, target_100000, velocity_1000000, shutdown, switch_on}};
  for (int i = 0; i < 10; ++i) {
    ten_times.steps.push_back(control("601 # 2B 40 60 00 4F 00 00 00", state, 0x27));
    ten_times.steps.push_back(control("601 # 2B 40 60 00 5F 00 00 00", acknowledge | reached, acknowledge, &triangle));
  }
  all.push_back(ten_times);
  return all;
}

std::string responses(const std::vector<canopen::Frame>& frames) {
  std::string text;
  for (const canopen::Frame& frame : frames) {
    const std::uint32_t service = frame.id & 0x780;
    if (service >= 0x180 && service <= 0x480) continue;  // TPDOs
    text += (text.empty() ? "" : "; ") + test::text_of(frame);
  }
  return text;
}

TEST(IsmcExamples, FramesAndMotions) {
  for (const Example& example : examples()) {
    SCOPED_TRACE(example.name);
    products::Settings settings;
    settings.node_id = example.node_id;
    Rig<Ismc> rig(test::default_plant(), settings);
    rig.run_ms(1);
    for (const Step& step : example.steps) {
      SCOPED_TRACE(step.request);
      rig.sent.clear();
      ASSERT_EQ(rig.ticks() % ticks_per_cycle, 0) << "a control event lies right before a cycle";
      const std::int64_t before = rig.ticks();
      const std::int64_t demand_before = rig.get(0x60FC);
      rig.device.receive(test::frame_of(step.request), rig.now());
      rig.drain();
      if (step.response != nullptr) {
        EXPECT_EQ(responses(rig.sent), step.response);
      }
      rig.run_ms(1);
      for (int i = 0; i < 2 && (rig.status() & step.mask) != step.status; ++i) rig.run_ms(1);  // the DC link (G54)
      EXPECT_EQ(rig.status() & step.mask, step.status) << std::hex << rig.status();
      if (step.motion != nullptr) {
        const auto done = [&] {
          const auto& generator = rig.device.drive().axis().generator;
          return generator.finished();
        };
        ASSERT_GE(rig.run_until(done, 10000.0), 0);
        EXPECT_NEAR(static_cast<double>(rig.ticks() - before) / ticks_per_s, step.motion->seconds, 0.0005);
        // At the end of a ramp that continues at its speed, the cycle in which it ended counts as well.
        const double after_end =
            (static_cast<double>((rig.ticks() - before + ticks_per_cycle - 1) / ticks_per_cycle * ticks_per_cycle) /
                 ticks_per_s -
             step.motion->seconds) *
            rig.device.drive().axis().generator.velocity();
        EXPECT_NEAR(static_cast<double>(rig.get(0x60FC) - demand_before), step.motion->counts + after_end, 1.0);
        const std::int64_t off_grid = rig.ticks() % ticks_per_cycle;
        for (std::int64_t i = off_grid; i != 0 && i < ticks_per_cycle; ++i) rig.tick();
        rig.run_ms(1);
      } else {
        rig.run_ms(step.wait_ms - 1.0);
      }
    }
  }
}

}  // namespace
}  // namespace ismc_examples_test
}  // namespace servodrome
