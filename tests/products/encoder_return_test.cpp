#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// When an encoder returns at speed, its position changes by a large distance at once: this must not cause an over-speed
// fault, and the fault stays that of the encoder. An axis that is really too fast is still reported.
namespace servodrome {
namespace encoder_return_test {
namespace {

using drive::PowerState;
using products::Generic402;
using products::Ismc;
using products::Pronet;

template <typename Product>
struct Turning : test::Rig<Product> {
  // `velocity` in the product's units. The over-speed case turns 1.5 times as fast.
  Turning(std::int64_t velocity, double rpm) : rpm_(rpm) {
    drive::Configuration configuration = this->device.drive().configuration();
    configuration.monitors.over_speed_rpm = static_cast<float>(1.5 * rpm);
    this->device.drive().configure(configuration);
    this->set(0x6060, 0, 3);
    this->set(0x6083, 0, 1'000'000'000);
    this->set(0x60FF, 0, velocity);
    EXPECT_TRUE(this->enable());
    this->run_ms(800);
    EXPECT_NEAR(this->plant.velocity_rpm(), rpm, 0.02 * rpm);
  }
  void lose_encoder_for(double milliseconds) {
    this->plant.inject(plant::Injection::encoder_loss, true);
    this->run_ms(milliseconds);
    this->plant.inject(plant::Injection::encoder_loss, false);
  }
  // An external torque accelerates the shaft against all torque of the motor.
  void overhaul() {
    this->plant.set_external_torque_nm(-6.0);
    EXPECT_GE(this->run_until([&] { return this->plant.velocity_rpm() > 1.55 * rpm_; }, 1000), 0);
    this->run_ms(2);
  }

 private:
  double rpm_;
};

struct Case {
  std::int64_t velocity;
  double rpm;
  std::int64_t encoder;
  std::int64_t over_speed;
};

template <typename Product>
void comes_back(const Case& row) {
  for (const double away_ms : {10.0, 50.0}) {
    SCOPED_TRACE(away_ms);
    Turning<Product> rig(row.velocity, row.rpm);
    rig.lose_encoder_for(away_ms);
    EXPECT_EQ(rig.device.drive().state(), PowerState::fault);
    EXPECT_EQ(rig.get(0x603F), row.encoder);
    for (int i = 0; i < 100; ++i) {
      rig.run_ms(1);
      ASSERT_EQ(rig.get(0x603F), row.encoder) << i << " ms after its return";
    }
    EXPECT_EQ(rig.get(0x1003, 0), 1);
    EXPECT_EQ(rig.get(0x1003, 1) & 0xFFFF, row.encoder);
    // A later over-speed is reported.
    rig.overhaul();
    EXPECT_EQ(rig.get(0x603F), row.over_speed);
    EXPECT_EQ(rig.get(0x1003, 0), 2);
  }
  Turning<Product> undisturbed(row.velocity, row.rpm);
  undisturbed.overhaul();
  EXPECT_EQ(undisturbed.get(0x603F), row.over_speed) << "with an encoder that was never away";
}
TEST(EncoderReturn, Generic402) { comes_back<Generic402>({131072 * 16, 960.0, 0x7305, 0x8400}); }
TEST(EncoderReturn, Ismc) { comes_back<Ismc>({131072 * 16, 960.0, 0x7380, 0x8482}); }
TEST(EncoderReturn, Pronet) { comes_back<Pronet>({10000, 1000.0, 0x7303, 0x8480}); }

}  // namespace
}  // namespace encoder_return_test
}  // namespace servodrome
