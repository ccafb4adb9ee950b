#include <gtest/gtest.h>
#include <random>
#include <vector>

#include "draws.hpp"
#include "drive/drive.hpp"
#include "line/line.hpp"
#include "line/line_file.hpp"
#include "links/can/memory_port.hpp"

// Two runs of the same scenario in virtual time are equal to the last bit: 60 s, eight axes of two products on one bus,
// and a master that enables, homes, moves in every mode and disturbs. Every millisecond is recorded.
namespace servodrome::line {
namespace determinism_test {
namespace {

struct Sample {
  std::int64_t position;
  std::uint64_t velocity_bits;
  std::uint64_t torque_bits;
  std::uint64_t temperature_bits;
  std::int64_t position_actual;
  std::int64_t statusword;
  std::int64_t current;
  friend bool operator==(const Sample&, const Sample&) = default;
};

struct Recording {
  std::vector<Sample> samples;
  std::vector<canopen::Frame> frames;
  std::vector<Time> times;
};

std::string eight_axes() {
  std::string text = "clock = \"virtual\"\n[api]\nenabled = false\n[[bus]]\nname = \"can0\"\nbit_rate = 1_000_000\n";
  for (int i = 1; i <= 8; ++i) {
    text += "[[axis]]\nname = \"a" + std::to_string(i) + "\"\nproduct = \"" + (i % 2 != 0 ? "ismc" : "generic402") +
            "\"\nbus = \"can0\"\nnode = " + std::to_string(i) + "\n";
  }
  return text;
}

canopen::Frame frame(std::uint32_t id, std::initializer_list<std::uint8_t> bytes) {
  canopen::Frame result{.id = id, .length = static_cast<std::uint8_t>(bytes.size())};
  std::copy(bytes.begin(), bytes.end(), result.data.begin());
  return result;
}

canopen::Frame download(std::uint8_t node, std::uint16_t index, std::uint8_t sub, std::uint8_t size,
                        std::uint32_t value) {
  const auto command = static_cast<std::uint8_t>(0x23 | (4 - size) << 2);
  return frame(0x600U + node, {command, static_cast<std::uint8_t>(index), static_cast<std::uint8_t>(index >> 8), sub,
                               static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value >> 8),
                               static_cast<std::uint8_t>(value >> 16), static_cast<std::uint8_t>(value >> 24)});
}

// `piece` is the time between two calls of run_until; it must not change the result.
Recording run(std::chrono::milliseconds piece, int seconds) {
  const LineFile file = parse_line_file(eight_axes(), "eight.toml", all_products());
  EXPECT_TRUE(file.diagnostics.empty());
  Line line(file.settings);
  links::MemoryPort master(line.buses()[0]->bus);
  Recording recording;
  std::mt19937 random(2026);
  constexpr std::array<std::uint32_t, 6> controls{0x06, 0x07, 0x0F, 0x1F, 0x3F, 0x0F};
  constexpr std::array<std::uint32_t, 5> modes{1, 3, 4, 6, 8};
  for (int ms = 0; ms < seconds * 1000; ++ms) {
    const Time now = std::chrono::milliseconds(ms);
    if (ms % static_cast<int>(piece.count()) == 0) line.run_until(now);
    if (ms % 10 != 0) continue;
    line.run_until(now);
    // One command to each axis every 80 ms, and a SYNC.
    const auto node = static_cast<std::uint8_t>(1 + ms / 10 % 8);
    const int round = ms / 80;
    if (ms == 0) master.send(frame(0, {1, 0}), now);
    if (round % 50 == 49) {
      master.send(download(node, 0x6060, 0, 1, modes[static_cast<std::size_t>(round / 50) % modes.size()]), now);
    } else if (round % 10 == 9) {
      master.send(download(node, 0x607A, 0, 4, static_cast<std::uint32_t>(random() % 400000)), now);
    } else if (round % 10 == 8) {
      master.send(download(node, 0x60FF, 0, 4, static_cast<std::uint32_t>(random() % 600000)), now);
    } else if (round < 4) {
      master.send(download(node, round % 2 == 0 ? 0x6081 : 0x6099, round % 2 == 0 ? 0 : 1, 4, 400000), now);
    } else {
      master.send(download(node, 0x6040, 0, 2, controls[static_cast<std::size_t>(round) % controls.size()]), now);
    }
    master.send(frame(0x80, {}), now);
    if (ms % 20000 == 10000) {
      line.axes()[0]->plant().set_external_torque_nm(0.3);
      line.axes()[1]->plant().inject(plant::Injection::encoder_loss, true);
    }
    for (const auto& axis : line.axes()) {
      dictionary::Dictionary& objects = axis->device().dictionary();
      recording.samples.push_back({axis->plant().position_counts(),
                                   std::bit_cast<std::uint64_t>(axis->plant().velocity_rpm()),
                                   std::bit_cast<std::uint64_t>(axis->plant().torque_nm()),
                                   std::bit_cast<std::uint64_t>(axis->plant().winding_temperature_c()),
                                   objects.number(0x6064), objects.number(0x6041), objects.number(0x6078)});
    }
    while (const auto received = master.receive()) {
      recording.frames.push_back(received->frame);
      recording.times.push_back(received->at);
    }
  }
  return recording;
}

TEST(Determinism, SixtySecondsOfEightAxesAgreeToTheLastBit) {
  const int seconds = servodrome::test::draws(60);
  const Recording one = run(std::chrono::milliseconds(1), seconds);
  const Recording other = run(std::chrono::milliseconds(1), seconds);
  EXPECT_GT(one.frames.size(), 150U * static_cast<unsigned>(seconds));
  ASSERT_EQ(one.samples.size(), other.samples.size());
  EXPECT_TRUE(one.samples == other.samples);
  EXPECT_TRUE(one.frames == other.frames);
  EXPECT_TRUE(one.times == other.times);
  // The test is meaningful only if the axes moved, and moved differently.
  std::int64_t moved = 0;
  for (const Sample& sample : one.samples) moved += sample.velocity_bits != std::bit_cast<std::uint64_t>(0.0) ? 1 : 0;
  EXPECT_GT(moved, static_cast<std::int64_t>(one.samples.size() / 10));
}

TEST(Determinism, HowTimeIsCutIntoCallsChangesNothing) {
  const Recording one = run(std::chrono::milliseconds(1), 5);
  const Recording other = run(std::chrono::milliseconds(10), 5);
  EXPECT_TRUE(one.samples == other.samples);
  EXPECT_TRUE(one.frames == other.frames);
  EXPECT_TRUE(one.times == other.times);
}

}  // namespace
}  // namespace determinism_test
}  // namespace servodrome::line
