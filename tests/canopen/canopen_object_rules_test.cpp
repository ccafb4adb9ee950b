#include "test_device.hpp"

// The ranges of the objects 1003h to 1029h (CiA 301 7.5.2): values just inside and just outside.
namespace servodrome::canopen::test {
namespace canopen_object_rules_test {
namespace {

constexpr AbortCode ok = AbortCode::none;
constexpr AbortCode no = AbortCode::value_invalid;

struct Row {
  std::uint32_t value;
  AbortCode answer;
};

// Writes each value to a node that has just started.
void expect_answers(std::uint16_t index, std::uint8_t sub, unsigned bytes, std::initializer_list<Row> rows) {
  for (const auto& [value, answer] : rows) {
    auto device = make_device();
    device->start();
    EXPECT_EQ(device->write(index, sub, value, bytes), answer) << std::hex << index << " := " << value;
  }
}

TEST(ObjectRules, ErrorFieldIsClearedWithZeroOnly) { expect_answers(0x1003, 0, 1, {{0, ok}, {1, no}, {255, no}}); }

// CAN-IDs of CiA 301 table 40 are restricted; bits 29 and 11 to 28 are 0.
TEST(ObjectRules, CobIdOfSync) {
  expect_answers(
      0x1005, 0, 4,
      {{0x00000080, ok}, {0x00000081, ok}, {0x0000007F, no}, {0x00000000, no}, {0x00000100, ok}, {0x00000101, no},
       {0x00000180, no}, {0x00000181, ok}, {0x00000580, ok}, {0x00000581, no}, {0x000005FF, no}, {0x00000600, ok},
       {0x00000601, no}, {0x0000067F, no}, {0x00000680, ok}, {0x000006DF, ok}, {0x000006E0, no}, {0x000006FF, no},
       {0x00000700, ok}, {0x00000701, no}, {0x000007FF, no}, {0x00000880, no}, {0x10000080, no}, {0x20000080, no},
       {0x40000080, ok}, {0x80000080, ok}});
}

TEST(ObjectRules, AProducersSyncKeepsItsIdentifier) {
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->write(0x1005, 0, 0x40000080, 4), ok);
  EXPECT_EQ(device->write(0x1005, 0, 0x40000081, 4), no);
  EXPECT_EQ(device->write(0x1005, 0, 0x00000081, 4), no) << "not with the write that ends it either";
  EXPECT_EQ(device->write(0x1005, 0, 0x40000080, 4), ok);
  EXPECT_EQ(device->write(0x1005, 0, 0x00000080, 4), ok);
  EXPECT_EQ(device->write(0x1005, 0, 0x00000081, 4), ok);
}

TEST(ObjectRules, CounterOfSync) {
  expect_answers(0x1019, 0, 1, {{0, ok}, {1, no}, {2, ok}, {240, ok}, {241, no}, {255, no}});
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1006, 0, 1000, 4), ok);
  EXPECT_EQ(device->write(0x1019, 0, 10, 1), AbortCode::device_state) << "7.5.2.22: only while 1006h is 0";
  ASSERT_EQ(device->write(0x1006, 0, 0, 4), ok);
  EXPECT_EQ(device->write(0x1019, 0, 10, 1), ok);
}

TEST(ObjectRules, CobIdOfTime) {
  expect_answers(0x1012, 0, 4,
                 {{0x80000100, ok},
                  {0x00000100, ok},
                  {0x80000181, ok},
                  {0x8000007F, no},
                  {0x80000101, no},
                  {0xC0000100, no},
                  {0x40000100, no},
                  {0xA0000100, no},
                  {0x80000900, no}});
}

// While the PDO is valid its identifier cannot change; bit 30 does not exist.
TEST(ObjectRules, CobIdsOfEmergencies) {
  expect_answers(0x1014, 0, 4,
                 {{0x00000081, ok},
                  {0x80000081, ok},
                  {0x00000082, no},
                  {0x80000082, ok},
                  {0x80000101, no},
                  {0x40000081, no},
                  {0x20000081, no},
                  {0x00000881, no}});
  auto device = make_device();
  device->start();
  ASSERT_EQ(device->write(0x1014, 0, 0x80000081, 4), ok);
  EXPECT_EQ(device->write(0x1014, 0, 0x00000101, 4), no);
  EXPECT_EQ(device->write(0x1014, 0, 0x00000082, 4), ok) << "it becomes valid with another one";
  EXPECT_EQ(device->write(0x1014, 0, 0x00000083, 4), no);
}

TEST(ObjectRules, HeartbeatsOfOtherNodes) {
  const auto entry = [](unsigned node, unsigned milliseconds) { return node << 16 | milliseconds; };
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->write(0x1016, 1, entry(5, 100), 4), ok);
  EXPECT_EQ(device->write(0x1016, 1, entry(5, 200), 4), ok) << "its own entry";
  EXPECT_EQ(device->write(0x1016, 2, entry(5, 100), 4), AbortCode::parameter_incompatible);
  EXPECT_EQ(device->write(0x1016, 2, entry(5, 0), 4), ok) << "without a time it is none";
  EXPECT_EQ(device->write(0x1016, 2, entry(0, 100), 4), ok);
  EXPECT_EQ(device->write(0x1016, 3, entry(127, 100), 4), ok);
  EXPECT_EQ(device->write(0x1016, 2, entry(127, 100), 4), AbortCode::parameter_incompatible);
  auto strict = make_device<>({.consumers_have_possible_nodes = true});
  strict->start();
  EXPECT_EQ(strict->write(0x1016, 1, entry(127, 100), 4), ok);
  EXPECT_EQ(strict->write(0x1016, 1, entry(128, 100), 4), no);
  EXPECT_EQ(strict->write(0x1016, 1, entry(128, 0), 4), ok);
}

TEST(ObjectRules, ErrorBehaviour) { expect_answers(0x1029, 1, 1, {{0, ok}, {1, ok}, {2, ok}, {3, no}}); }

}  // namespace
}  // namespace canopen_object_rules_test
}  // namespace servodrome::canopen::test
