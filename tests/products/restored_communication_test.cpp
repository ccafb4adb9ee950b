#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// A fault because of lost communication stays until it is reset, even if the master returns: the same applies to 1001h
// and EMCY.
namespace servodrome {
namespace restored_communication_test {
namespace {

using drive::PowerState;
using products::Generic402;
using products::Ismc;

constexpr std::uint8_t node = 5;

// Returns true if an EMCY 0000h with the register `register_byte` was sent.
bool told_no_error(const std::vector<canopen::Frame>& frames, std::uint8_t register_byte) {
  for (const canopen::Frame& frame : frames) {
    if (frame.id == 0x80U + node && frame.data[0] == 0 && frame.data[1] == 0 && frame.data[2] == register_byte)
      return true;
  }
  return false;
}

template <typename Product>
struct Node : test::Rig<Product> {
  Node() : test::Rig<Product>(test::default_plant(), {.node_id = node}) { this->run_ms(20); }
  void move() {
    this->set(0x6007, 0, 1);  // a lost connection is a fault; the ISMC, without this object, always has it
    this->set(0x6060, 0, 3);
    this->set(0x60FF, 0, 131072);
    EXPECT_TRUE(this->enable());
  }
  // Calls `say` every `period_ms`, or does nothing.
  void run(int milliseconds, int period_ms = 0, const std::function<void()>& say = {}) {
    for (int i = 0; i < milliseconds; ++i) {
      if (say && i % period_ms == 0) say();
      this->run_ms(1);
    }
  }
  // A master that sends, stops, and sends again.
  void lose_and_find(int period_ms, const std::function<void()>& say, std::uint16_t code,
                     const std::function<void()>& reset) {
    run(300, period_ms, say);
    ASSERT_EQ(this->device.drive().state(), PowerState::operation_enabled);
    ASSERT_EQ(this->get(0x1001), 0);
    run(500);
    ASSERT_EQ(this->device.drive().state(), PowerState::fault);
    ASSERT_EQ(this->get(0x603F), code);
    const std::int64_t told = this->get(0x1001);
    ASSERT_NE(told & 0x01, 0);
    this->sent.clear();
    run(300, period_ms, say);
    EXPECT_EQ(this->device.drive().state(), PowerState::fault);
    EXPECT_EQ(this->get(0x603F), code);
    EXPECT_EQ(this->get(0x1001), told);
    EXPECT_FALSE(told_no_error(this->sent, 0));
    this->sent.clear();
    reset();
    run(20, period_ms, say);
    EXPECT_EQ(this->device.drive().state(), PowerState::switch_on_disabled);
    EXPECT_EQ(this->get(0x1001), 0);
    EXPECT_TRUE(told_no_error(this->sent, 0));
  }
};

template <typename Product>
void heartbeat() {
  Node<Product> rig;
  rig.send(0, {1, 0});
  rig.move();
  ASSERT_EQ(rig.set(0x1016, 1, 0x7F00C8), dictionary::AbortCode::none);
  rig.lose_and_find(
      50, [&] { rig.send(0x77F, {5}); }, 0x8130, [&] { rig.control(0x80); });
}
TEST(RestoredCommunication, HeartbeatOfGeneric402) { heartbeat<Generic402>(); }
TEST(RestoredCommunication, HeartbeatOfIsmc) { heartbeat<Ismc>(); }

template <typename Product>
void guarding() {
  Node<Product> rig;
  rig.send(0, {1, 0});
  rig.move();
  ASSERT_EQ(rig.set(0x100C, 0, 50), dictionary::AbortCode::none);
  ASSERT_EQ(rig.set(0x100D, 0, 3), dictionary::AbortCode::none);
  rig.lose_and_find(
      50, [&] { rig.send(0x700 + node, {}, true); }, 0x8130, [&] { rig.control(0x80); });
}
TEST(RestoredCommunication, GuardingOfGeneric402) { guarding<Generic402>(); }
TEST(RestoredCommunication, GuardingOfIsmc) { guarding<Ismc>(); }

// An RPDO with an event timer, which carries the controlword.
TEST(RestoredCommunication, ReceivePdoOfGeneric402) {
  Node<Generic402> rig;
  ASSERT_EQ(rig.set(0x1400, 5, 100), dictionary::AbortCode::none);
  rig.send(0, {1, 0});
  rig.move();
  std::uint8_t word = 0x0F;
  rig.lose_and_find(
      10,
      [&] {
        rig.send(0x200 + node, {word, 0});
      },
      0x8250, [&] { word = 0x8F; });
}

}  // namespace
}  // namespace restored_communication_test
}  // namespace servodrome
