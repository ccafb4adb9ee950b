// Every alarm that a drive can raise has a text, and every text belongs to an alarm that a drive can raise.
#include "catalogue/fault_texts.hpp"

#include <algorithm>
#include <gtest/gtest.h>
#include <set>

#include "products/generic402/policy.hpp"
#include "products/ismc/faults.hpp"
#include "products/ismk/faults.hpp"
#include "products/jmc_ec/faults.hpp"
#include "products/pronet/policy.hpp"

namespace servodrome::catalogue {
namespace fault_texts_test {
namespace {

struct ProductFaults {
  const char* product;
  std::span<const drive::FaultRow> rows;
  std::uint16_t alarm_mask = 0xFFFF;  // the bits of FaultRow::alarm that are the number
};
const ProductFaults all[] = {{"generic402", products::generic402::faults},
                             {"generic402-ec", products::generic402::faults},
                             {"ismc", products::ismc::faults},
                             {"pronet", products::pronet::faults},
                             {"ismk", products::ismk::faults, 0x00FF},
                             {"ismk-ea", products::ismk::faults, 0x00FF},
                             {"jmc_ec", products::jmc_ec::faults}};

class FaultTexts : public ::testing::TestWithParam<ProductFaults> {};
INSTANTIATE_TEST_SUITE_P(Products, FaultTexts, ::testing::ValuesIn(all), [](const auto& row) {
  std::string name = row.param.product;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST_P(FaultTexts, EveryRowOfTheDriveHasOneAndEveryTextARow) {
  const auto [product, rows, mask] = GetParam();
  std::set<const FaultText*> used;
  for (const drive::FaultRow& row : rows) {
    const auto alarm = static_cast<std::uint16_t>(row.alarm & mask);
    const FaultText* own = nullptr;
    for (const FaultText& text : fault_texts(product, row.code)) {
      if (text.alarm == alarm) own = &text;
    }
    ASSERT_NE(own, nullptr) << product << ", " << row.name << ", code " << std::hex << row.code << ", alarm " << alarm;
    used.insert(own);
    for (const std::string_view words : {own->text, own->cause, own->remedy}) EXPECT_GT(words.size(), 2U) << row.name;
    EXPECT_TRUE(own->remedy.ends_with('.') && own->cause.ends_with('.')) << row.name;
    if (alarm != 0) {
      EXPECT_EQ(find_alarm_text(product, alarm)->code, row.code) << row.name;
      EXPECT_FALSE(alarm_name(product, alarm).empty());
    }
    EXPECT_NE(find_fault_text(product, row.code), nullptr);
  }
  if (product == std::string_view("pronet")) {  // 603Fh also has this code if homing is not possible
    for (const FaultText& text : fault_texts(product, products::pronet::homing_error_codes.not_possible)) {
      used.insert(&text);
    }
  }
  for (const FaultText& text : fault_texts(product)) {
    EXPECT_TRUE(used.contains(&text)) << product << ": no drive raises " << text.text;
  }
}

TEST(FaultText, ListsAllAlarmsOfACode) {
  const auto eeprom = fault_texts("jmc_ec", 0x5003);
  ASSERT_EQ(eeprom.size(), 2U);
  EXPECT_EQ(alarm_name("jmc_ec", eeprom[0].alarm), "AL.051");
  EXPECT_EQ(alarm_name("jmc_ec", eeprom[1].alarm), "AL.062");
  EXPECT_EQ(fault_texts("ismk", 0x7331).size(), 2U);
  EXPECT_TRUE(fault_texts("ismk", 0x1234).empty());
}

TEST(FaultText, NamesAlarmsAsTheMakersPrintThem) {
  EXPECT_EQ(alarm_name("jmc_ec", 0xE105), "E105");
  EXPECT_EQ(alarm_name("pronet", 0x69), "A 69");
  EXPECT_EQ(alarm_name("ismk", 9), "2601h bit 9 (020.0)");
  EXPECT_EQ(alarm_name("ismk", 20), "2602h bit 4 (001.0)");
  EXPECT_EQ(alarm_name("ismk-ea", 35), "2605h sub 7 bit 3");
  EXPECT_EQ(alarm_name("ismc", 0), "");
}

TEST(FaultText, FallsBackToTheStandardsClass) {
  EXPECT_EQ(fault_class_text(0x8611)->text, "following error");
  EXPECT_EQ(fault_class_text(0x8619)->code, 0x8600);
  EXPECT_EQ(fault_class_text(0x2345)->code, 0x2340);
  EXPECT_EQ(fault_class_text(0x0000), nullptr);
  EXPECT_EQ(fault_class_text(0xB010), nullptr) << "a manufacturer's range";
  EXPECT_EQ(find_fault_text("ismc", 0xB010)->text, "position unsteady in angle identification");
  EXPECT_EQ(find_fault_text("ismc", 0x8619)->code, 0x8600);
  EXPECT_EQ(find_fault_text("unheard of", 0x3210)->text, "DC link over-voltage");
}

}  // namespace
}  // namespace fault_texts_test
}  // namespace servodrome::catalogue
