// Recordings of drives on a CAN bus: when TPDOs are set up for them, and that they are restored.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "api/scope/recordings.hpp"
#include "bus_of_rig.hpp"
#include "studio/real_drives.hpp"

namespace servodrome::studio {
namespace real_recordings_test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class RealRecordingsTest : public testing::Test {
 protected:
  RealRecordingsTest() {
    BusPlan plan{.link = "mem:", .type = "can", .drives = {{"reference", "generic402", 1}}};
    plan.open = [this](const links::Heard&) { return std::make_unique<BusOfRig>(rig_, BusOfRig::Pace::real_time); };
    std::vector<BusPlan> plans;
    plans.push_back(std::move(plan));
    drives_ = std::make_unique<RealDrives>(std::move(plans));
    drives_->set_wait([](master::Time) { std::this_thread::sleep_for(1ms); });
    until([this] { return !drives_->state_of(axis()).problem; });
  }

  template <typename Condition>
  void until(const Condition& condition) {
    for (int i = 0; i < 60'000 && !condition(); ++i) std::this_thread::sleep_for(1ms);
    ASSERT_TRUE(condition());
  }
  const RealDrives::Axis& axis() const { return *drives_->find("reference"); }
  // The answer to the request for an armed recording of the position and of an object that is never mapped.
  api::Json begin(double rate_hz) {
    const api::Json body{
        {"channels", {{{"axis", "reference"}, {"object", "6064:00"}}, {{"axis", "reference"}, {"object", "2010:02"}}}},
        {"rate_hz", rate_hz},
        {"duration_ms", 1000},
        {"trigger", {{"kind", "edge"}, {"channel", 0}, {"level", 1e9}}}};
    return recordings_.add(*drives_, body.dump()).view();
  }
  unsigned type_of_tpdo() { return drives_->open(axis())->read<std::uint8_t>(0x1800, 2); }

  master::test::AxisRig rig_{{"generic402"}};
  std::unique_ptr<RealDrives> drives_;
  api::Recordings recordings_{[](const api::Recording&) {}};
};

TEST_F(RealRecordingsTest, SetsUpTpdosAndRestoresThemWhenItIsDeleted) {
  const unsigned before = type_of_tpdo();
  ASSERT_NE(before, 1U);
  const api::Json view = begin(1000);
  EXPECT_EQ(view["rate_hz"], 1000);
  EXPECT_THAT(view["channels"][0]["sampled"]["by"].get<std::string>(), HasSubstr("TPDOs with SYNC"));
  EXPECT_EQ(view["channels"][0]["sampled"]["due_hz"], 1000);
  EXPECT_FALSE(view["channels"][0]["sampled"].contains("limit"));
  EXPECT_EQ(view["channels"][1]["sampled"]["by"], "read as an object");
  EXPECT_THAT(view["channels"][1]["sampled"]["limit"]["what"].get<std::string>(), HasSubstr("does not map"));
  EXPECT_EQ(type_of_tpdo(), 1U);
  EXPECT_THROW(drives_->open(axis())->write<std::uint8_t>(0x1800, 2, 255), master::ObjectError);
  recordings_.remove(1);
  until([&] { return type_of_tpdo() == before; });
}

TEST_F(RealRecordingsTest, RestoresBeforeTheDriveStoresItsParameters) {
  const unsigned before = type_of_tpdo();
  begin(1000);
  EXPECT_EQ(type_of_tpdo(), 1U);
  drives_->open(axis())->write<std::uint32_t>(0x1010, 1, 0x65766173);
  EXPECT_EQ(type_of_tpdo(), before);
}

TEST_F(RealRecordingsTest, ReadsObjectsAtAHundredHertz) {
  const api::Json view = begin(100);
  EXPECT_EQ(view["channels"][0]["sampled"]["by"], "read as an object");
  EXPECT_NE(type_of_tpdo(), 1U);
}

TEST_F(RealRecordingsTest, AllChannelsBeginWithTheSameRowAndNotInThePast) {
  std::vector<api::NamedChannel> channels{drives_->object("reference", 0x6064, 0),
                                          drives_->object("reference", 0x2010, 2)};
  const auto prepared = drives_->prepare(100, channels);
  const std::int64_t present = drives_->now() / 62'500ns;
  const auto first = channels[0].open(prepared.stride);
  std::this_thread::sleep_for(25ms);
  const auto again = channels[0].open(prepared.stride);
  const auto second = channels[1].open(prepared.stride);
  EXPECT_EQ(first, again);
  EXPECT_EQ(first->due(), second->due());
  EXPECT_GT(first->due(), present);
}

// Without a heartbeat another master may have started the node: to pre-operational and back could stop the axis.
TEST_F(RealRecordingsTest, ChangesNothingWhileADriveWithoutHeartbeatHasTorque) {
  const auto objects = drives_->open(axis());
  objects->write<std::uint16_t>(0x1017, 0, 0);
  master::Axis402(*objects, drives_->options("reference")).enable();
  api::Json view = begin(1000);
  EXPECT_EQ(view["channels"][0]["sampled"]["by"], "read as an object");
  EXPECT_THAT(view["channels"][0]["sampled"]["limit"]["what"].get<std::string>(), HasSubstr("heartbeat"));
  EXPECT_LE(view["rate_hz"], 100);
  EXPECT_NE(type_of_tpdo(), 1U);
  objects->write<std::uint16_t>(0x1017, 0, 100);
  view = begin(1000);
  EXPECT_EQ(type_of_tpdo(), 1U);
  EXPECT_EQ(master::Axis402(*objects, drives_->options("reference")).state(), master::PowerState::operation_enabled);
}

// The second recording uses the TPDOs of the first; they stay as long as one of both needs them.
TEST_F(RealRecordingsTest, TwoRecordingsShareTheTpdos) {
  const unsigned before = type_of_tpdo();
  begin(1000);
  const api::Json view = begin(500);
  EXPECT_THAT(view["channels"][0]["sampled"]["by"].get<std::string>(), HasSubstr("TPDOs with SYNC"));
  recordings_.remove(1);
  std::this_thread::sleep_for(100ms);
  EXPECT_EQ(type_of_tpdo(), 1U);
  recordings_.remove(2);
  until([&] { return type_of_tpdo() == before; });
}

}  // namespace
}  // namespace real_recordings_test
}  // namespace servodrome::studio
