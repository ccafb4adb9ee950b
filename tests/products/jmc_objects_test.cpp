#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <set>

#include "jmc_rig.hpp"
#include "object_csv.hpp"

// Compares Table 219 of the JMC manual (tests/data/jmc_od.csv) with the running drive.
namespace servodrome {
namespace jmc_objects_test {
namespace {

using dictionary::AbortCode;
using products::JmcEc;
using test::JmcRig;

// The drive whose nameplate the table prints: 6 A, 4.436 Nm.
constexpr std::string_view printed_rating = "2hss458-ec";

TEST(JmcObjects, AreThoseOfTable219) {
  JmcRig rig(printed_rating);
  rig.run_ms(1);
  auto rows = test::read_csv("jmc_od.csv");
  // Mentioned as "not used"; not in the table (D-30).
  std::erase_if(rows, [](const test::CsvRow& row) { return row.at("index") == "0x60D0"; });
  EXPECT_EQ(rig.device.dictionary().find(0x60D0, 1), nullptr);
  // The manual does not print slot 0Ch of the last six maps, except a second 1602h:0Ch (D-04).
  EXPECT_EQ(
      test::compare_objects(rig.device.bus_dictionary(), 0, rows, test::read_differences("jmc_od_differences.csv")),
      218U);
}

// Only the table, the sub-indices of ETG.1020 and the twelfth slots.
TEST(JmcObjects, NoOthers) {
  std::set<std::uint32_t> printed;
  for (const test::CsvRow& row : test::read_csv("jmc_od.csv")) {
    printed.insert(static_cast<std::uint32_t>(std::stoul(row.at("index"), nullptr, 16) << 8 |
                                              std::stoul(row.at("sub"), nullptr, 16)));
  }
  for (const dictionary::Entry& entry : JmcEc::bus_table) {
    const bool synchronisation = (entry.index == 0x1C32 || entry.index == 0x1C33) && entry.sub > 3;
    const bool slot = entry.sub == 12 && (entry.index == 0x1603 || (entry.index >= 0x1A00 && entry.index <= 0x1A03));
    EXPECT_EQ(printed.count(entry.key()) == 0, synchronisation || slot)
        << std::hex << entry.index << "h:" << int{entry.sub};
  }
}

// Table 219: bytes of the default PDOs, and the values of the unused slots.
TEST(JmcObjects, DefaultPdos) {
  JmcRig rig;
  const auto bytes = [&rig](std::uint16_t pdo) {
    unsigned bits = 0;
    for (int sub = 1; sub <= 12; ++sub) {
      const auto entry = static_cast<std::uint32_t>(rig.get(pdo, static_cast<std::uint8_t>(sub)));
      EXPECT_EQ(sub > rig.get(pdo), entry == 0xFFFFFFFF) << std::hex << pdo << "h:" << sub;
      if (sub <= rig.get(pdo)) bits += entry & 0xFF;
    }
    return bits / 8;
  };
  EXPECT_EQ(bytes(0x1600), 17U);
  EXPECT_EQ(bytes(0x1601), 17U);
  EXPECT_EQ(bytes(0x1602), 24U);
  EXPECT_EQ(bytes(0x1603), 17U);
  EXPECT_EQ(bytes(0x1A00), 27U);
  EXPECT_EQ(bytes(0x1A01), 9U);
  EXPECT_EQ(bytes(0x1A02), 4U);
  EXPECT_EQ(bytes(0x1A03), 0U);
}

TEST(JmcObjects, ValuesThatAreNotThere) {
  JmcRig rig;
  rig.run_ms(1);
  for (int mode = -3; mode <= 12; ++mode) {  // 'Control articles', object 6060h
    const bool there =
        mode == 0 || mode == 1 || mode == 3 || mode == 4 || mode == 6 || mode == 8 || mode == 9 || mode == 10;
    EXPECT_EQ(rig.set(0x6060, 0, mode), there ? AbortCode::none : AbortCode::value_invalid) << mode;
  }
  for (int method = -128; method <= 127; ++method) {  // D-23
    const bool there = method >= 0 && method <= 35;
    EXPECT_EQ(rig.set(0x6098, 0, method), there ? AbortCode::none : AbortCode::value_invalid) << method;
  }
  const auto codes = [&rig](std::uint16_t index, std::initializer_list<int> good, std::initializer_list<int> bad) {
    for (const int code : good) EXPECT_EQ(rig.set(index, 0, code), AbortCode::none) << std::hex << index << " " << code;
    for (const int code : bad) {
      EXPECT_EQ(rig.set(index, 0, code), AbortCode::value_invalid) << std::hex << index << " " << code;
    }
  };
  codes(0x605A, {1, 2, 3, 4, 32767}, {-1, 0});
  codes(0x605B, {0, 1}, {-1, 2, 3});
  codes(0x605C, {0, 1}, {-1, 2, 3});
  codes(0x605D, {1, 2, 3, 32767}, {-1, 0});
  codes(0x605E, {0, 1, 2, 3, 4}, {-1, 5, 32767});
}

// Each rating shows its own name, identity and nameplate, also in its slave information memory.
// Power and supply of Table 1 (ch. 2.1), the names by the rules of ch. 2.2, 3000 rpm (ch. 2.2). The rated torque is the
// power at that speed. The torque constant is our choice (ratings.hpp): 4500 rpm with 80 % of the supply.
struct Plate {
  const char* model;
  const char* device_name;
  unsigned product_code;
  double power_w;
  double supply_v;
};
constexpr auto plates = std::to_array<Plate>({
    {"ihsv42-78", "IHSV42-30-07-24-EC", 0x45430401, 78.0, 24.0},
    {"ihsv57-140", "IHSV57-30-14-36-EC", 0x45430501, 140.0, 36.0},
    {"ihsv57-180", "IHSV57-30-18-36-EC", 0x45430502, 180.0, 36.0},
    {"ihsv60-200", "IHSV60-30-20-48-EC", 0x45430601, 200.0, 48.0},
    {"ihsv60-400", "IHSV60-30-40-48-EC", 0x45430602, 400.0, 48.0},
    {"ihsv86-440", "IHSV86-30-44-72-EC", 0x45430801, 440.0, 72.0},
    {"ihsv86-660", "IHSV86-30-66-72-EC", 0x45430802, 660.0, 72.0},
});

TEST(JmcObjects, NameplatesOfTheManual) {
  ASSERT_EQ(products::jmc_ec::ratings.size(), plates.size() + 2U);  // and two stepper drives
  for (const Plate& plate : plates) {
    SCOPED_TRACE(plate.model);
    JmcRig rig(plate.model);
    rig.to_pre_operational();
    const products::Model& model = rig.device.rating().model;
    EXPECT_EQ(static_cast<double>(model.supply_v), plate.supply_v);
    EXPECT_EQ(model.motor.counts_per_revolution, 4000U);  // 1000 lines
    EXPECT_EQ(model.motor.rated_speed_rpm, 3000.0F);
    EXPECT_EQ(std::string(rig.device.rating().device_name), plate.device_name);
    EXPECT_EQ(rig.upload(0x1018, 2), plate.product_code);
    const double torque_nm = plate.power_w / (3000.0 * std::numbers::pi / 30.0);
    const double constant = 1.5 * 0.8 * plate.supply_v / std::sqrt(3.0) / (4500.0 * std::numbers::pi / 30.0);
    EXPECT_NEAR(rig.upload(0x6076, 0), 1000.0 * torque_nm, 1.0);
    EXPECT_NEAR(rig.upload(0x6075, 0), 1000.0 * torque_nm / constant / std::sqrt(2.0), 2.0);
    EXPECT_NEAR(static_cast<double>(model.motor.peak_current_a / model.motor.rated_current_a), 3.0,
                1e-6);  // 300 % (ch. 2.1)
  }
  JmcRig half("2hss458-ec");
  EXPECT_EQ(half.get(0x6075), 6000);  // Table 219
  EXPECT_EQ(half.get(0x6076), 4436);  // Table 219
  JmcRig open("2dm542-ec");
  EXPECT_EQ(open.get(0x6075), 2970);  // 4.2 A from its name, as an r.m.s. value
  EXPECT_EQ(open.get(0x6076), 1800);
}

TEST(JmcObjects, EveryRatingSaysTheSameEverywhere) {
  std::set<std::int64_t> product_codes;
  for (const products::jmc_ec::Rating& rating : products::jmc_ec::ratings) {
    SCOPED_TRACE(rating.device_name);
    JmcRig rig(rating.model.name);
    rig.to_pre_operational();
    EXPECT_EQ(rig.upload(0x1018, 1), 0x66668888U);
    product_codes.insert(rig.upload(0x1018, 2));
    const std::span<const std::uint8_t> sii = rig.device.sii();
    for (std::uint8_t sub = 1; sub <= 4; ++sub) {
      EXPECT_EQ(ethercat::load_u32(&sii[2U * (0x08U + 2U * (sub - 1U))]), rig.upload(0x1018, sub)) << int{sub};
    }
    const test::Bytes answer =
        rig.sdo(test::little_endian(std::uint8_t{0x40}, std::uint16_t{0x1008}, std::uint8_t{0}, 0U));
    ASSERT_GT(answer.size(), 8U);
    EXPECT_EQ(std::string(answer.begin() + 8, answer.end()), rating.device_name);
  }
  EXPECT_EQ(product_codes.size(), products::jmc_ec::ratings.size());
  JmcRig printed(printed_rating);
  EXPECT_EQ(printed.get(0x6075), 6000);
  EXPECT_EQ(printed.get(0x6076), 4436);
}

}  // namespace
}  // namespace jmc_objects_test
}  // namespace servodrome
