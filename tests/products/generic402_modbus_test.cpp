#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "rig.hpp"
#include "rs485.hpp"

// Registers of the reference drive that one Modbus request writes act as a whole.
namespace servodrome {
namespace generic402_modbus_test {
namespace {

using drive::PowerState;
using products::Generic402;
using test::Rig;
using test::Rs485Master;

class Positioning : public testing::Test {
 protected:
  Positioning() {
    rig.set(0x6081, 0, 500000);
    rig.set(0x6083, 0, 5000000);
    rig.set(0x6084, 0, 5000000);
    rig.set(0x6060, 0, 1);
    EXPECT_TRUE(rig.enable());
    rig.set(0x607A, 0, 100000);
  }
  double position() { return static_cast<double>(rig.get(0x6064)); }

  Rig<Generic402> rig;
  Rs485Master<Rig<Generic402>> master{rig};
};

TEST_F(Positioning, TheControlwordActsWithTheTargetOfItsRequest) {
  // 6040h, 6060h, 607Ah, 60FFh
  EXPECT_EQ(master.ask_modbus("02 10 00 00 00 06 0C 00 1F 00 01 00 03 0D 40 00 00 00 00"), "02 10 00 00 00 06");
  rig.run_ms(2000);
  EXPECT_NEAR(position(), 200000.0, 5.0);
  EXPECT_EQ(master.ask_modbus("02 10 00 00 00 01 02 00 0F"), "02 10 00 00 00 01");
  // 17h: the same objects, and the answer is statusword and mode
  const std::string answer = master.ask_modbus("02 17 01 01 00 01 00 00 00 04 08 00 1F 00 01 00 04 93 E0");
  EXPECT_EQ(answer, "02 17 02 00 01");
  rig.run_ms(2000);
  EXPECT_NEAR(position(), 300000.0, 5.0);
}

TEST_F(Positioning, ARefusedRequestChangesNothing) {
  const double start = position();
  // mode 5 does not exist
  EXPECT_EQ(master.ask_modbus("02 10 00 00 00 06 0C 00 1F 00 05 00 06 1A 80 00 00 00 00"), "02 90 03");
  rig.run_ms(500);
  EXPECT_NEAR(position(), start, 5.0);
  EXPECT_EQ(rig.get(0x6040), 0x0F);
  EXPECT_EQ(rig.get(0x6060), 1);
  EXPECT_EQ(rig.get(0x607A), 100000);
  EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
}

}  // namespace
}  // namespace generic402_modbus_test
}  // namespace servodrome
