// The first program: enable a drive, home it, move it by three revolutions.
//
//   01_first_move                                       on a line of its own, in virtual time
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
    master::Axis402 axis(objects);            // CiA 402 above them
    const examples::QuickStopOnFailure stop_on_failure(objects);

    // Units are the drive's own: here encoder counts, 131072 for a revolution.
    constexpr std::int32_t revolution = 131072;
    const master::MotionProfile profile{
        .velocity = 5 * revolution, .acceleration = 50 * revolution, .deceleration = 50 * revolution};

    axis.reset_fault();              // nothing, if there is none
    axis.enable();                   // shutdown, switch on, enable operation, waiting for each
    axis.home({.method = 35}, 10s);  // home is here
    axis.move_to(3 * revolution, profile, 10s);
    examples::expect_near("revolutions", double(axis.position()) / revolution, 3.0, 0.001);
    axis.disable();
  });
}
