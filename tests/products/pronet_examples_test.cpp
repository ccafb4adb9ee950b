#include <cmath>
#include <gtest/gtest.h>

#include "frames.hpp"
#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// The worked examples of the ProNet manual (in its order, called W1 to W25 here), frame by frame, and their motions,
// compared with calculated values. Where the manual has a misprint (W8, W18, W25), the test sends the corrected frame.
namespace servodrome {
namespace pronet_examples_test {
namespace {

using products::Pronet;
using test::Rig;
using Axis = Rig<Pronet>;

constexpr std::int32_t counts = 10000;  // per turn: the examples count in this encoder's increments (ch. 9.3)

plant::Parameters incremental_encoder() {
  plant::Parameters parameters = test::default_plant();
  parameters.encoder.counts_per_revolution = counts;
  return parameters;
}

struct Exchange {
  std::string request;
  std::string answer;  // empty: none
};

// "581 60 idx sub" for a download.
Exchange written(const std::string& request) {
  const canopen::Frame frame = test::frame_of(request);
  canopen::Frame answer{.id = frame.id - 0x80, .length = 8};
  answer.data = {0x60, frame.data[1], frame.data[2], frame.data[3], 0, 0, 0, 0};
  return {request, test::text_of(answer)};
}
Exchange silent(const std::string& request) { return {request, ""}; }

void wait(Axis& axis, double ms) { axis.run_ms(ms); }

struct Example {
  const char* name;
  std::vector<Exchange> exchanges;
  std::function<void(Axis&)> before{};
  std::function<void(Axis&)> after{};
};

// Sends the frames of an example, one every 2 ms, and compares the answers of the drive's SDO server and its boot-up
// message; PDOs and EMCYs do not count as answers.
void carry_out(Axis& axis, const Example& example, std::uint32_t node_id = 1) {
  SCOPED_TRACE(example.name);
  if (example.before) example.before(axis);
  for (const Exchange& exchange : example.exchanges) {
    axis.sent.clear();
    axis.device.receive(test::frame_of(exchange.request), axis.now());
    axis.drain();
    std::string answers;
    for (const canopen::Frame& frame : axis.sent) {
      if (frame.id == 0x580 + node_id || frame.id == 0x700 + node_id) answers += test::text_of(frame);
    }
    EXPECT_EQ(answers, exchange.answer) << exchange.request;
    wait(axis, 2);
  }
  if (example.after) example.after(axis);
}

void carry_out(Axis& axis, const std::vector<Example>& examples, std::uint32_t node_id = 1) {
  for (const Example& example : examples) carry_out(axis, example, node_id);
}

// Returns the time and the distance from now until the demand stands.
void expect_move(Axis& axis, double seconds, std::int64_t way, std::int64_t start) {
  const std::int64_t ticks =
      axis.run_until([&] { return (axis.status() & 0x400) != 0 && !axis.device.drive().in_motion(); }, 60000.0);
  ASSERT_GE(ticks, 0);
  EXPECT_NEAR(static_cast<double>(ticks) / 16000.0, seconds, 0.005);
  EXPECT_EQ(axis.get(0x6062), start + way);
  axis.run_ms(50);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), static_cast<double>(start + way), 2.0);
}

// 30 rpm with ramps of 10000 rpm/s (factory values of 6083h and 6084h).
constexpr double half_turn_per_second = 0.5;
double seconds_at_30_rpm(double turns) { return turns / half_turn_per_second + 30.0 / 10000.0; }

const std::vector<Example> transfers{
    {"W1",
     {{"601 # 40 61 60 00 00 00 00 00", "581 # 4F 61 60 00 01 00 00 00"}},
     [](Axis& axis) {
       axis.set(0x6060, 0, 1);
       axis.run_ms(1);
     }},
    {"W2", {written("601 # 2F 01 14 02 EF 00 00 00")}, {}, [](Axis& axis) { EXPECT_EQ(axis.get(0x1401, 2), 239); }},
    // W3 prints 1234h as an example; here 6041h has its real value: switch on disabled, main power on.
    {"W3", {{"601 # 40 41 60 00 00 00 00 00", "581 # 4B 41 60 00 50 00 00 00"}}},
    {"W4", {written("601 # 2B 40 60 00 E8 03 00 00")}, {}, [](Axis& axis) { EXPECT_EQ(axis.get(0x6040), 1000); }},
    {"W5", {written("601 # 23 93 60 01 78 56 34 12")}},
    {"W6", {{"601 # 40 93 60 01 00 00 00 00", "581 # 43 93 60 01 78 56 34 12"}}},
    {"W7", {written("601 # 2B 22 30 00 18 FC 00 00")}},
    {"W8", {{"601 # 40 22 30 00 00 00 00 00", "581 # 4B 22 30 00 18 FC 00 00"}}},
    {"W9",
     {written("601 # 2F 00 1A 00 00 00 00 00"), written("601 # 23 00 1A 01 10 00 41 60"),
      written("601 # 23 00 1A 02 08 00 61 60"), written("601 # 23 00 1A 03 20 00 FD 60"),
      written("601 # 2F 00 1A 00 03 00 00 00"), written("601 # 2F 00 18 02 FF 00 00 00"),
      written("601 # 2B 00 18 03 14 00 00 00"), written("601 # 2B 00 18 05 0A 00 00 00")},
     {},
     [](Axis& axis) {
       axis.send(0x000, {0x01, 0x01});
       axis.sent.clear();
       axis.run_ms(100.5);
       int frames = 0;
       for (const canopen::Frame& frame : axis.sent) {
         if (frame.id != 0x181) continue;
         ++frames;
         EXPECT_EQ(test::text_of(frame), "181 # 50 00 01 00 00 00 00");
       }
       EXPECT_EQ(frames, 10);  // event time 10 ms
       axis.send(0x000, {0x80, 0x01});
     }},
};

TEST(PronetExamples, TransfersAndMapping) {
  Axis axis(incremental_encoder());
  axis.run_ms(1);
  carry_out(axis, transfers);
}

// Ch. 9.2 and 9.3: profile position over two RPDOs.
TEST(PronetExamples, ProfilePosition) {
  Axis axis(incremental_encoder());
  axis.run_ms(1);
  carry_out(axis, {
                      {"W10",
                       {written("601 # 2F 00 16 00 00 00 00 00"), written("601 # 23 00 16 01 10 00 40 60"),
                        written("601 # 2F 00 16 00 01 00 00 00"), written("601 # 2F 01 16 00 00 00 00 00"),
                        written("601 # 23 01 16 01 20 00 7A 60"), written("601 # 23 01 16 02 20 00 81 60"),
                        written("601 # 2F 01 16 00 02 00 00 00")}},
                      {"W11", {silent("000 # 01 01")}},
                      {"W12",
                       {written("601 # 2F 60 60 00 01 00 00 00"), written("601 # 2B 40 60 00 06 00 00 00"),
                        written("601 # 2B 40 60 00 07 00 00 00"), written("601 # 2B 40 60 00 0F 00 00 00")},
                       {},
                       [](Axis& each) { EXPECT_EQ(each.status() & 0x6F, 0x27); }},
                      {"W13", {silent("301 # 50 C3 00 00 2C 01 00 00"), silent("201 # 0F 00")}},
                  });
  carry_out(axis, {"W13, the start", {silent("201 # 1F 00")}, {}, [](Axis& each) {
                     EXPECT_EQ(each.status() & 0x1400, 0x1000);
                     each.run_ms(100);
                     EXPECT_NEAR(static_cast<double>(each.get(0x606C)), 300.0, 6.0);  // 0.1 rpm
                     EXPECT_NEAR(each.plant.velocity_rpm(), 30.0, 0.5);
                   }});
  expect_move(axis, seconds_at_30_rpm(5.0) - 0.102, 5 * counts, 0);
  carry_out(axis, {"W14", {silent("201 # 0F 00"), silent("201 # 5F 00")}});
  expect_move(axis, seconds_at_30_rpm(5.0) - 0.002, 5 * counts, 5 * counts);
  carry_out(axis,
            {"W14, the end", {silent("201 # 0F 00")}, {}, [](Axis& each) { EXPECT_EQ(each.status() & 0x1000, 0); }});
  carry_out(axis, {"W15", {silent("301 # B0 3C FF FF 2C 01 00 00"), silent("201 # 0F 00"), silent("201 # 1F 00")}});
  expect_move(axis, seconds_at_30_rpm(15.0) - 0.002, -15 * counts, 10 * counts);
}

// Ch. 9.4: interpolated position, from the PDOs to the first set-points.
TEST(PronetExamples, InterpolatedPosition) {
  Axis axis(incremental_encoder());
  axis.run_ms(1);
  carry_out(axis, {
                      {"W16",
                       {written("601 # 2F 00 16 00 00 00 00 00"), written("601 # 23 00 16 01 10 00 40 60"),
                        written("601 # 2F 00 16 00 01 00 00 00"), written("601 # 2F 01 16 00 00 00 00 00"),
                        written("601 # 23 01 16 01 20 01 C1 60"), written("601 # 2F 01 16 00 01 00 00 00")}},
                      {"W17",
                       {written("601 # 2F 00 1A 00 00 00 00 00"), written("601 # 23 00 1A 01 10 00 41 60"),
                        written("601 # 2F 00 1A 00 01 00 00 00"), written("601 # 2F 01 1A 00 00 00 00 00"),
                        written("601 # 23 01 1A 01 20 00 64 60"), written("601 # 23 01 1A 02 20 00 6C 60"),
                        written("601 # 2F 01 1A 00 02 00 00 00")}},
                      {"W18",
                       {written("601 # 23 06 10 00 E8 03 00 00"), written("601 # 2F C2 60 01 01 00 00 00"),
                        written("601 # 2F C2 60 02 FD 00 00 00")},
                       {},
                       [](Axis& each) {
                         EXPECT_EQ(each.get(0x60C2, 2), -3);
                         EXPECT_EQ(each.get(0x2105), 1000);  // missing in the example; its factory value fits
                       }},
                      {"W19",
                       {written("601 # 2F 00 14 02 01 00 00 00"), written("601 # 2F 01 14 02 01 00 00 00"),
                        written("601 # 2F 00 18 02 01 00 00 00"), written("601 # 2F 01 18 02 01 00 00 00")}},
                      {"W20",
                       {{"000 # 82 01", "701 # 00"}},
                       {},
                       [](Axis& each) {  // the PDO setup is kept (ch. 9.2 and 9.4)
                         EXPECT_EQ(each.get(0x1400, 2), 1);
                         EXPECT_EQ(each.get(0x1601, 1), 0x60C10120);
                         EXPECT_EQ(each.get(0x1A01, 0), 2);
                         EXPECT_EQ(each.get(0x1006), 1000);
                       }},
                      {"W21",
                       {written("601 # 2F 60 60 00 07 00 00 00"), written("601 # 2B 40 60 00 06 00 00 00"),
                        written("601 # 2B 40 60 00 07 00 00 00"), written("601 # 2B 40 60 00 0F 00 00 00"),
                        silent("000 # 01 01")},
                       {},
                       [](Axis& each) { EXPECT_EQ(each.status() & 0x106F, 0x0027); }},
                  });
  for (int cycle = 0; cycle < 50; ++cycle) {  // W22
    axis.sent.clear();
    axis.device.receive(test::frame_of("301 # 10 00 00 00"), axis.now());
    axis.device.receive(test::frame_of("201 # 1F 00"), axis.now());
    axis.device.receive(test::frame_of("080 #"), axis.now());
    axis.drain();
    ASSERT_EQ(axis.sent.size(), 2U);  // TPDO 1 and 2 answer the SYNC
    EXPECT_EQ(axis.sent[0].id, 0x181U);
    EXPECT_EQ(axis.sent[1].id, 0x281U);
    axis.run_ms(1);
    if (cycle == 0) {
      EXPECT_EQ(axis.get(0x6062), 16);  // reached one period later
    }
  }
  EXPECT_EQ(axis.status() & 0x142F, 0x1427);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), 16.0, 1.0);
}

// Ch. 9.5. The printed example sets neither 6099h:01 nor 609Ah, whose factory value is 0: no motion (C33).
TEST(PronetExamples, Homing) {
  Axis axis(incremental_encoder());
  axis.run_ms(1);
  const std::vector<Example> printed{
      {"W23",
       {written("601 # 2F 60 60 00 06 00 00 00"), written("601 # 2F 98 60 00 04 00 00 00"),
        written("601 # 2B 40 60 00 06 00 00 00"), written("601 # 2B 40 60 00 07 00 00 00"),
        written("601 # 2B 40 60 00 0F 00 00 00"), written("601 # 23 99 60 02 64 00 00 00"), silent("000 # 01 01"),
        silent("201 # 1F 00 00 00 00 00")}},
  };
  carry_out(axis, printed);
  axis.run_ms(500);
  EXPECT_EQ(axis.plant.position_counts(), 0);
  EXPECT_EQ(axis.status() & 0x1400, 0);
  carry_out(axis, {"W23, cancelled", {silent("201 # 0F 00 00 00 00 00")}});

  // With the two values that are missing it finds the index behind the switch.
  plant::Parameters parameters = incremental_encoder();
  parameters.switches[0] = {.wire = 4, .from_counts = 2 * counts + 1234, .to_counts = 3 * counts};
  parameters.switch_count = 1;
  Axis complete(parameters);
  complete.run_ms(1);
  carry_out(complete,
            {"the rest of it", {written("601 # 23 99 60 01 E8 03 00 00"), written("601 # 23 9A 60 00 A0 86 01 00")}});
  carry_out(complete, printed);
  ASSERT_GE(complete.run_until([&] { return (complete.status() & 0x3400) == 0x1400; }, 20000.0), 0);
  EXPECT_EQ(complete.get(0x6063) - complete.plant.position_counts(), -3 * counts);  // index 0 of the third turn
}

// Ch. 10.2, on node 2.
TEST(PronetExamples, CobIdsOfNodeTwo) {
  Axis axis(incremental_encoder(), {.node_id = 2});
  axis.run_ms(1);
  carry_out(axis,
            {"W24",
             {written("602 # 23 00 14 01 01 02 00 80"), written("602 # 23 00 14 01 01 02 00 00"),
              written("602 # 23 01 18 01 82 02 00 80"), silent("000 # 01 00")},
             {},
             [](Axis& each) {
               each.send(0x201, {0x06, 0x00, 0, 0, 0, 0});
               EXPECT_EQ(each.get(0x6040), 6);
               each.sent.clear();
               each.run_ms(100);
               bool first = false;
               for (const canopen::Frame& frame : each.sent) {
                 EXPECT_NE(frame.id, 0x282U) << "switched off by bit 31";
                 first |= frame.id == 0x182;
               }
               EXPECT_TRUE(first);
             }},
            2);
}

// Ch. 10.2: one frame for two drives, each with a dummy at the place of the other's set-point.
TEST(PronetExamples, OneFrameServesTwoNodes) {
  Axis one(incremental_encoder(), {.node_id = 1});
  Axis two(incremental_encoder(), {.node_id = 2});
  carry_out(one, {"W25",
                  {written("601 # 2F 00 16 00 00 00 00 00"), written("601 # 23 00 16 01 20 01 C1 60"),
                   written("601 # 23 00 16 02 20 00 07 00"), written("601 # 2F 00 16 00 02 00 00 00"),
                   silent("000 # 01 00")}});
  carry_out(
      two,
      {"W25",
       {written("602 # 2F 00 16 00 00 00 00 00"), written("602 # 23 00 16 01 20 00 07 00"),
        written("602 # 23 00 16 02 20 01 C1 60"), written("602 # 2F 00 16 00 02 00 00 00"),
        written("602 # 23 00 14 01 01 02 00 80"), written("602 # 23 00 14 01 01 02 00 00"), silent("000 # 01 00")}},
      2);
  const canopen::Frame frame = test::frame_of("201 # 39 30 00 00 C7 CF FF FF");  // 12345 and -12345
  one.device.receive(frame, one.now());
  two.device.receive(frame, two.now());
  EXPECT_EQ(one.get(0x60C1, 1), 12345);
  EXPECT_EQ(two.get(0x60C1, 1), -12345);
}

}  // namespace
}  // namespace pronet_examples_test
}  // namespace servodrome
