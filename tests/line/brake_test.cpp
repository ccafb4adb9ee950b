#include <gtest/gtest.h>

#include "line/support.hpp"

// A motor with a holding brake that a master enables without a setting of the brake.
namespace servodrome::line {
namespace brake_test {
namespace {

using namespace std::chrono_literals;

TEST(Brake, TheReferenceDriveKnowsTheTimesOfItsMotorsBrake) {
  Line line(test::settings_of(
      "clock=\"virtual\"\n[[bus]]\nname=\"can0\"\n[[axis]]\nname=\"x\"\nproduct=\"generic402\"\nnode=1\n"
      "[axis.motor]\nbrake_torque_nm = 1.5\nbrake_release_ms = 80.5\n"));
  links::MemoryPort master(line.buses()[0]->bus);
  line.run_until(300ms);
  const auto write = [&](std::uint16_t index, std::uint32_t value, unsigned size) {
    master.send(test::sdo_write(1, index, 0, value, size), line.now());
    line.run_until(line.now() + 10ms);
  };
  write(0x6060, 1, 1);
  write(0x6081, 131072 * 2, 4);
  write(0x6083, 131072 * 100, 4);
  write(0x607A, 131072 * 6, 4);
  for (const std::uint32_t word : {6U, 7U, 15U, 31U}) write(0x6040, word, 2);
  const plant::Plant& plant = line.axes()[0]->plant();
  double fastest_rpm = 0.0;
  for (int tick = 0; tick < 16000; ++tick) {
    line.run_until(line.now() + tick_length);
    fastest_rpm = std::max(fastest_rpm, plant.velocity_rpm());
  }
  // The move begins when the brake is open. With 2020h:01 = 0 it begins against the brake, and the shaft then catches
  // up at 448 rpm.
  EXPECT_GT(plant.velocity_rpm(), 115.0);
  EXPECT_LT(fastest_rpm, 130.0);
}

}  // namespace
}  // namespace brake_test
}  // namespace servodrome::line
