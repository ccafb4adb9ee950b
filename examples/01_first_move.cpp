// The first program: enable a drive, home it, move it by three revolutions.
//
//   01_first_move                                       with its own line, in virtual time
//   01_first_move socketcand:127.0.0.1:29536/can0       node 2 of the line that ./run starts, or of your own bus
#include "axis/axis402.hpp"
#include "connection.hpp"
#include "master/canopen/sdo_client.hpp"

using namespace servodrome;
using namespace std::chrono_literals;

int main(int argc, char** argv) {
  return examples::run(argc, argv, "usage: 01_first_move [LINK]", [](std::string_view link) {
    examples::Can can(link, "default.toml");
    master::SdoClient objects(can.bus(), 2);  // the drive's objects, over SDO
    master::Axis402 axis(objects);            // CiA 402 on top of them
    const examples::QuickStopOnFailure stop_on_failure(objects);

    // The axis uses the drive's units: here encoder counts, 131072 per revolution.
    constexpr std::int32_t revolution = 131072;
    const master::MotionProfile profile{
        .velocity = 5 * revolution, .acceleration = 50 * revolution, .deceleration = 50 * revolution};

    axis.reset_fault();              // does nothing if there is no fault
    axis.enable();                   // shutdown, switch on, enable operation; waits for each state
    axis.home({.method = 35}, 10s);  // method 35: the present position is home
    axis.move_to(3 * revolution, profile, 10s);
    examples::expect_near("revolutions", double(axis.position()) / revolution, 3.0, 0.001);
    axis.disable();
  });
}
