#include <gtest/gtest.h>
#include <set>

#include "object_csv.hpp"
#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// Compares the objects of the ProNet manual with the running drive.
namespace servodrome {
namespace pronet_objects_test {
namespace {

using dictionary::AbortCode;
using products::Pronet;
using Axis = test::Rig<Pronet>;

TEST(PronetObjects, AreThoseOfTheManual) {
  Axis axis;
  const auto differences = test::read_differences("pronet_od_differences.csv");
  EXPECT_EQ(test::compare_objects(axis.device.dictionary(), 1, test::read_csv("pronet_od.csv"), differences), 293U);
}

// Objects that the manual does not list are this project's choice, documented in its README.
TEST(PronetObjects, NothingElseButTheSettingsOfThePanel) {
  std::set<std::uint32_t> listed;
  for (const test::CsvRow& row : test::read_csv("pronet_od.csv")) {
    listed.insert(static_cast<std::uint32_t>(std::stoul(row.at("index"), nullptr, 16) << 8 |
                                             std::stoul(row.at("sub"), nullptr, 16)));
  }
  for (const dictionary::Entry& entry : Pronet::table) {
    if (entry.index >= 0x2F10 && entry.index <= 0x2F12) continue;  // Pn201, Pn202, and the resolution of the encoder
    EXPECT_TRUE(listed.contains(entry.key())) << std::hex << entry.index << " " << int{entry.sub};
  }
}

TEST(PronetObjects, RangesHoldAtTheirEnds) {
  Axis axis;
  axis.run_ms(1);
  for (const dictionary::Entry& entry : Pronet::table) {
    if (entry.index < 0x2000 || entry.index == 0x6086 || !entry.writable() || !entry.has_range) continue;
    SCOPED_TRACE(testing::Message() << std::hex << entry.index << "h:" << int{entry.sub});
    if (entry.maximum < dictionary::maximum_of(entry.type)) {
      EXPECT_EQ(axis.set(entry.index, entry.sub, entry.maximum + 1), AbortCode::value_too_high);
    }
    if (entry.minimum > dictionary::minimum_of(entry.type)) {
      EXPECT_EQ(axis.set(entry.index, entry.sub, entry.minimum - 1), AbortCode::value_too_low);
    }
    for (const std::int64_t value : {entry.minimum, entry.maximum}) {
      EXPECT_EQ(axis.set(entry.index, entry.sub, value), AbortCode::none) << value;
      EXPECT_EQ(axis.get(entry.index, entry.sub), value);
    }
  }
}

TEST(PronetObjects, ValuesThatAreNotInTheLists) {
  Axis axis;
  axis.run_ms(1);
  const auto accepts = [&](std::uint16_t index, const std::set<int>& values) {
    const std::int64_t before = axis.get(index);
    for (int value = -128; value < 128; ++value) {
      EXPECT_EQ(axis.set(index, 0, value), values.contains(value) ? AbortCode::none : AbortCode::value_invalid)
          << std::hex << index << " " << std::dec << value;
    }
    axis.set(index, 0, before);
  };
  accepts(0x605A, {0, 1, 2, 5, 6});
  accepts(0x605B, {0, 1});
  accepts(0x605C, {0, 1});
  accepts(0x605D, {1, 2});
  accepts(0x605E, {0});
  accepts(0x6060, {0, 1, 3, 6, 7});
  accepts(0x6086, {0, 2});
  accepts(0x6098, {1, 2, 3, 4, 17, 18, 19, 20, 35});
  EXPECT_EQ(axis.set(0x60C0, 0, 1), AbortCode::value_too_high);
}

// Pn006, Pn703 and Pn704 (ch. 8): impossible values are refused; if they were stored, the node would never answer
// again.
TEST(PronetObjects, SettingsOfTheBusThatCannotBeAreRefused) {
  Axis axis;
  axis.run_ms(1);
  for (unsigned value = 0; value <= 0xFFFF; ++value) {
    const bool bus = (value & 0xF) <= 3 && (value >> 4 & 0xF) == 0 && (value >> 8 & 0xF) <= 1 && value >> 12 <= 2;
    ASSERT_EQ(axis.set(0x3006, 0, value), bus ? AbortCode::none : AbortCode::value_invalid) << value;
    ASSERT_EQ(axis.set(0x30FF, 0, value), value <= 5 ? AbortCode::none : AbortCode::value_invalid) << value;
    const AbortCode address = value < 1     ? AbortCode::value_too_low
                              : value > 127 ? AbortCode::value_too_high
                                            : AbortCode::none;
    ASSERT_EQ(axis.set(0x3100, 0, value), address) << value;
  }
  EXPECT_EQ(axis.get(0x3006), 0x2103);
  EXPECT_EQ(axis.get(0x30FF), 5);
  EXPECT_EQ(axis.get(0x3100), 127);
}

// The objects from which a master calculates revolutions.
TEST(PronetObjects, TellsItsEncoder) {
  for (const std::int32_t counts : {10000, 65536, 131072, 4000}) {
    plant::Parameters parameters = test::default_plant();
    parameters.encoder.counts_per_revolution = counts;
    Axis axis(parameters);
    axis.run_ms(1);
    EXPECT_EQ(axis.get(0x2F12), counts);
    EXPECT_EQ(axis.set(0x2F12, 0, 5), AbortCode::read_only);
    for (const std::uint8_t command : {std::uint8_t{0x81}, std::uint8_t{0x82}}) {
      axis.send(0x000, {command, 0x01});
      axis.run_ms(2);
      EXPECT_EQ(axis.get(0x2F12), counts);
    }
  }
}

TEST(PronetObjects, FactorsWithoutADivisorAreRefused) {
  Axis axis;
  axis.run_ms(1);
  for (const std::uint16_t index : {std::uint16_t{0x6093}, std::uint16_t{0x6094}, std::uint16_t{0x6097}}) {
    EXPECT_EQ(axis.set(index, 2, 0), AbortCode::value_too_low);  // 0609 0032h
    EXPECT_EQ(axis.set(index, 2, 7), AbortCode::none);
  }
}

// Pn values are stored immediately, all other values are lost at power-off; Pn006, Pn703 and Pn704 take effect after a
// restart.
class Storage : public testing::Test {
 protected:
  std::array<std::byte, 16384> memory{};
  dictionary::RamMedium medium{memory};
  Axis axis{test::default_plant(), {.store = &medium}};

  void power_cycle() {
    axis.plant.sample(axis.feedback);
    axis.device.power_off();
    axis.device.power_on(axis.feedback, axis.now());
    axis.drain();
    axis.run_ms(1);
  }
};

TEST_F(Storage, ParametersAreKeptAndNothingElse) {
  axis.run_ms(1);
  std::int64_t value = 1000;
  std::size_t saved = 0;
  for (const dictionary::Entry& entry : Pronet::table) {
    if (!entry.saved) continue;
    ++saved;
    if (entry.index == 0x3006 || entry.index == 0x30FF || entry.index == 0x3100) continue;  // the bus itself
    ASSERT_EQ(axis.set(entry.index, 0, ++value), AbortCode::none) << std::hex << entry.index;
  }
  EXPECT_EQ(saved, 84U + 2U);
  axis.set(0x6065, 0, 1234);
  axis.set(0x2105, 0, 2000);
  axis.set(0x1017, 0, 50);
  axis.set(0x6093, 1, 5);
  power_cycle();
  value = 1000;
  for (const dictionary::Entry& entry : Pronet::table) {
    if (!entry.saved || entry.index == 0x3006 || entry.index == 0x30FF || entry.index == 0x3100) continue;
    EXPECT_EQ(axis.get(entry.index), ++value) << std::hex << entry.index;
  }
  EXPECT_EQ(axis.get(0x6065), 256);
  EXPECT_EQ(axis.get(0x2105), 1000);
  EXPECT_EQ(axis.get(0x1017), 0);
  EXPECT_EQ(axis.get(0x6093, 1), axis.get(0x2F10));  // from Pn201
  EXPECT_EQ(axis.get(0x6093, 2), axis.get(0x2F11));
}

TEST_F(Storage, AddressAndBitRateActAfterARestart) {
  axis.run_ms(1);
  EXPECT_EQ(axis.device.node_id(), 1);
  EXPECT_EQ(axis.device.bit_rate(), 1'000'000U);
  axis.set(0x3100, 0, 9);
  axis.set(0x30FF, 0, 3);
  axis.send(0x000, {0x81, 0x01});
  axis.run_ms(1);
  EXPECT_EQ(axis.device.node_id(), 1) << "a reset by NMT is no restart";
  EXPECT_EQ(axis.device.bit_rate(), 1'000'000U);
  axis.sent.clear();
  power_cycle();
  EXPECT_EQ(axis.device.node_id(), 9);
  EXPECT_EQ(axis.device.bit_rate(), 250'000U);
  ASSERT_FALSE(axis.sent.empty());
  EXPECT_EQ(axis.sent.front().id, 0x709U);
  EXPECT_EQ(axis.get(0x1800, 1), 0x189);
  constexpr std::uint32_t rates[] = {50'000, 100'000, 125'000, 250'000, 500'000, 1'000'000};  // ch. 8, Pn703
  for (unsigned code = 0; code < std::size(rates); ++code) {
    axis.set(0x30FF, 0, code);
    power_cycle();
    EXPECT_EQ(axis.device.bit_rate(), rates[code]);
  }
}

TEST_F(Storage, WithoutCanopenTheNodeIsSilent) {
  axis.run_ms(1);
  axis.set(0x3006, 0, 1);  // PROFIBUS
  axis.sent.clear();
  power_cycle();
  axis.send(0x601, {0x40, 0x41, 0x60, 0, 0, 0, 0, 0});
  axis.send(0x000, {0x01, 0x00});
  axis.run_ms(50);
  EXPECT_TRUE(axis.sent.empty());
}

TEST(PronetObjects, TellTheSerialNumber) {
  test::Rig<products::Pronet> axis(test::default_plant(), {.serial_number = 4711});
  EXPECT_EQ(axis.get(0x1018, 4), 4711);
}

// After NMT 81h, too, the factor group has the values of Pn201 and Pn202; parameters are kept.
TEST_F(Storage, ResetNodeRestoresTheObjects) {
  axis.run_ms(1);
  axis.set(0x2F10, 0, 3);
  axis.set(0x2F11, 0, 2);
  axis.set(0x3022, 0, 77);
  EXPECT_EQ(axis.get(0x6093, 1), 1);
  axis.set(0x6081, 0, 500);
  axis.set(0x1400, 2, 1);
  axis.set(0x2001, 1, 0);
  axis.send(0x000, {0x81, 0x01});
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x6093, 1), 3);
  EXPECT_EQ(axis.get(0x6093, 2), 2);
  EXPECT_EQ(axis.get(0x3022), 77);
  EXPECT_EQ(axis.get(0x6081), 0);
  EXPECT_EQ(axis.get(0x1400, 2), 255);
  EXPECT_EQ(axis.get(0x2001, 1), 0xFFFFFFFF);
}

}  // namespace
}  // namespace pronet_objects_test
}  // namespace servodrome
