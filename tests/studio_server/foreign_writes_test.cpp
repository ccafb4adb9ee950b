// The writes of other masters, as observed on a CAN bus.
#include "studio/foreign_writes.hpp"

#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "catalogue/product.hpp"

namespace servodrome::studio {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;
using Data = std::array<std::uint8_t, 8>;
using Bytes = std::vector<std::byte>;

class ForeignWritesTest : public testing::Test {
 protected:
  void hear(bool sent, std::uint32_t id, const Data& data) {
    canopen::Frame frame;
    frame.id = id;
    frame.length = 8;
    frame.data = data;
    heard_(sent, {reinterpret_cast<const std::uint8_t*>(&frame), sizeof frame});
  }
  void foreign(const Data& data) { hear(false, 0x605, data); }
  void own(const Data& data) { hear(true, 0x605, data); }
  void drive(const Data& data) { hear(false, 0x585, data); }

  std::vector<ForeignWrites::Node> nodes_{{4, "generic402"}, {5, "generic402"}};
  ForeignWrites writes_{nodes_};
  int passed_on_ = 0;
  links::Heard heard_ = writes_.heard([this](bool, std::span<const std::uint8_t>) { ++passed_on_; });
};

constexpr Data write_1000{0x23, 0x83, 0x60, 0x00, 0xE8, 0x03, 0x00, 0x00};
constexpr Data written{0x60, 0x83, 0x60, 0x00};
constexpr Data write_2000{0x23, 0x83, 0x60, 0x00, 0xD0, 0x07, 0x00, 0x00};
constexpr Data read{0x40, 0x83, 0x60, 0x00};
constexpr Data is_500{0x43, 0x83, 0x60, 0x00, 0xF4, 0x01, 0x00, 0x00};
constexpr Data refused{0x80, 0x83, 0x60, 0x00, 0x30, 0x00, 0x09, 0x06};
const Bytes bytes_500{std::byte{0xF4}, std::byte{1}, std::byte{0}, std::byte{0}};
const Bytes bytes_1000{std::byte{0xE8}, std::byte{3}, std::byte{0}, std::byte{0}};
const Bytes bytes_2000{std::byte{0xD0}, std::byte{7}, std::byte{0}, std::byte{0}};

TEST_F(ForeignWritesTest, AConfirmedWriteOfAnotherMasterCountsOnce) {
  foreign(write_1000);
  EXPECT_THAT(writes_.take(), IsEmpty()) << "the drive has not confirmed it";
  drive(written);
  const auto found = writes_.take();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].drive, 1U);
  EXPECT_EQ(found[0].object, (master::ObjectAddress{0x6083, 0}));
  EXPECT_THAT(found[0].value, ElementsAre(std::byte{0xE8}, std::byte{3}, std::byte{0}, std::byte{0}));
  EXPECT_THAT(writes_.take(), IsEmpty());
  EXPECT_EQ(passed_on_, 2);
}

TEST_F(ForeignWritesTest, OwnWritesReadsAndRefusedWritesDoNotCount) {
  own(write_1000);
  drive(written);
  foreign({0x40, 0x83, 0x60, 0x00});
  drive({0x43, 0x83, 0x60, 0x00, 0xE8, 0x03, 0x00, 0x00});
  foreign(write_1000);
  drive({0x80, 0x83, 0x60, 0x00, 0x30, 0x00, 0x09, 0x06});
  drive(written);
  hear(false, 0x607, write_1000);  // a node that is not in the plan
  hear(false, 0x587, written);
  EXPECT_THAT(writes_.take(), IsEmpty());
}

constexpr Data read_statusword{0x40, 0x41, 0x60, 0x00};
constexpr Data statusword{0x4B, 0x41, 0x60, 0x00, 0x37, 0x06};

// The drive answers each request in order, regardless of its sender.
TEST_F(ForeignWritesTest, AWriteBetweenOwnRequestsCounts) {
  foreign(write_1000);
  own(read_statusword);
  drive(written);
  drive(statusword);
  EXPECT_THAT(writes_.take(), SizeIs(1)) << "the foreign request came first";
  own(read_statusword);
  foreign(write_1000);
  drive(statusword);
  drive(written);
  EXPECT_THAT(writes_.take(), SizeIs(1)) << "the own request came first";
}

TEST_F(ForeignWritesTest, OfTwoWritesToOneObjectOneIsForeign) {
  own(write_2000);
  foreign(write_1000);
  drive(written);
  drive(refused);  // that of the other master
  EXPECT_THAT(writes_.take(), IsEmpty());
  foreign(write_1000);
  own(write_2000);
  drive(written);
  drive(refused);  // the own one
  const auto found = writes_.take();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].value[0], std::byte{0xE8});
  drive(written);
  EXPECT_THAT(writes_.take(), IsEmpty()) << "a response without a request";
}

TEST_F(ForeignWritesTest, AWriteInSegmentsCountsWithItsWholeValue) {
  foreign({0x21, 0x08, 0x20, 0x00, 9, 0, 0, 0});
  drive({0x60, 0x08, 0x20, 0x00});
  foreign({0x00, 1, 2, 3, 4, 5, 6, 7});
  drive({0x20});
  EXPECT_THAT(writes_.take(), IsEmpty());
  foreign({0x1B, 8, 9});
  drive({0x30});
  const auto found = writes_.take();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].object, (master::ObjectAddress{0x2008, 0}));
  EXPECT_THAT(found[0].value, SizeIs(9));
}

// The value before a write, and how it became known.
class ValuesBefore : public ForeignWritesTest {
 protected:
  Bytes before() {
    foreign(write_1000);
    drive(written);
    const auto found = writes_.take();
    EXPECT_THAT(found, SizeIs(1));
    return found.empty() ? Bytes{std::byte{}} : found[0].before;
  }
};

TEST_F(ValuesBefore, IsNotKnownIfItHasNotPassed) { EXPECT_EQ(before(), Bytes{}); }

TEST_F(ValuesBefore, IsThatOfAReadOfThisProgram) {
  own(read);
  drive(is_500);
  EXPECT_EQ(before(), bytes_500);
  EXPECT_EQ(before(), bytes_1000) << "the last write";
}

TEST_F(ValuesBefore, IsThatOfAReadOfTheOtherMaster) {
  foreign(read);
  drive(is_500);
  EXPECT_EQ(before(), bytes_500);
}

TEST_F(ValuesBefore, IsThatOfAWriteOfThisProgram) {
  own(write_2000);
  drive(written);
  EXPECT_EQ(before(), bytes_2000);
}

TEST_F(ValuesBefore, IsNotThatOfARefusedWrite) {
  own(read);
  drive(is_500);
  own(write_2000);
  drive(refused);
  foreign(write_2000);
  drive(refused);
  EXPECT_EQ(before(), bytes_500);
}

TEST_F(ValuesBefore, IsNotKnownAfterAWriteWithoutAnAnswer) {
  own(read);
  drive(is_500);
  own(write_2000);
  own({0x80, 0x83, 0x60, 0x00, 0x00, 0x00, 0x04, 0x05});  // timeout
  EXPECT_EQ(before(), Bytes{});
}

TEST_F(ValuesBefore, IsThatOfAReadWhileTheWriteIsUnderWay) {
  own(read);
  foreign(write_1000);
  drive(is_500);
  drive(written);
  const auto found = writes_.take();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].before, bytes_500);
}

TEST_F(ValuesBefore, IsOfThisObjectAndThisDrive) {
  own({0x40, 0x84, 0x60, 0x00});
  drive({0x43, 0x84, 0x60, 0x00, 0xF4, 0x01, 0x00, 0x00});
  hear(true, 0x604, read);
  hear(false, 0x584, is_500);
  EXPECT_EQ(before(), Bytes{});
}

TEST_F(ValuesBefore, IsNotKnownAfterARestartARestoreOrAnotherOpeningOfTheBus) {
  const auto boot = [this] {
    canopen::Frame frame;
    frame.id = 0x705;
    frame.length = 1;
    heard_(false, {reinterpret_cast<const std::uint8_t*>(&frame), sizeof frame});
  };
  const auto restore = [this] {
    own({0x23, 0x11, 0x10, 0x01, 'l', 'o', 'a', 'd'});
    drive({0x60, 0x11, 0x10, 0x01});
  };
  const auto reopen = [this] { heard_ = writes_.heard([](bool, std::span<const std::uint8_t>) {}); };
  for (const std::function<void()>& happens : std::initializer_list<std::function<void()>>{boot, restore, reopen}) {
    own(read);
    drive(is_500);
    happens();
    EXPECT_EQ(before(), Bytes{});
  }
}

// The second store would else be a write that leaves the value as it was.
TEST_F(ValuesBefore, OfACommandIsNotKnown) {
  for (int i = 0; i < 2; ++i) {
    foreign({0x23, 0x10, 0x10, 0x01, 's', 'a', 'v', 'e'});
    drive({0x60, 0x10, 0x10, 0x01});
    const auto found = writes_.take();
    ASSERT_THAT(found, SizeIs(1));
    EXPECT_EQ(found[0].before, Bytes{});
  }
}

TEST(HeardValues, AreLimited) {
  HeardValues values(catalogue::product_of("generic402").rules);
  for (std::size_t i = 0; i <= HeardValues::most_objects; ++i) {
    values.note_read({static_cast<std::uint16_t>(0x6100 + i / 0x100), static_cast<std::uint8_t>(i)}, bytes_500);
  }
  EXPECT_TRUE(values.note_write({0x6100, 0}, bytes_1000).known());
  EXPECT_FALSE(values.note_write({0x6100 + HeardValues::most_objects / 0x100, 0}, bytes_1000).known());
}

}  // namespace
}  // namespace servodrome::studio
