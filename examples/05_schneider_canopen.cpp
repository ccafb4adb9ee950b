// The Schneider example of the ISMC manual (ch. 6): this program takes the place of a TM241 with a CANopen master and
// SoMachine. The drive is node 1 at 1 Mbit/s; the process data are mapped as in SoMachine's expert mode (ch. 6);
// profile position, 100000 counts relative at 1000000 counts/s, ten times (ch. 6, 'Program modification and
// debugging').
//
//   05_schneider_canopen [LINK]                         node 1, as on the line that ./run starts
#include "axis/axis402.hpp"
#include "connection.hpp"
#include "master/canopen/master.hpp"
#include "master/canopen/pdo_set_up.hpp"
#include "master/canopen/sdo_client.hpp"

using namespace servodrome;
using namespace std::chrono_literals;

int main(int argc, char** argv) {
  return examples::run(argc, argv, "usage: 05_schneider_canopen [LINK]", [](std::string_view link) {
    constexpr std::uint8_t node = 1;
    examples::Can can(link, "default.toml");
    master::Master master(can.bus());
    master::SdoClient drive(can.bus(), node);
    const examples::QuickStopOnFailure stop_on_failure(drive);

    // Expert mode: event-driven PDOs, type 255.
    master.command(master::NmtCommand::enter_pre_operational, node);
    const master::PdoParameters pdos[] = {
        {false, 0, 0x200u + node, 255, {0x60400010, 0x60600008, 0x607A0020}},  // controlword, mode, target position
        {false, 1, 0x300u + node, 255, {0x60FF0020, 0x60810020}},              // target velocity, profile velocity
        {true, 0, 0x180u + node, 255, {0x60410010, 0x60610008, 0x60640020}},   // statusword, mode, position
        {true, 1, 0x280u + node, 255, {0x606C0020, 0x60780010}},               // velocity, current
    };
    for (const master::PdoParameters& pdo : pdos) master::write_pdo(drive, pdo);
    master.command(master::NmtCommand::start, node);

    // The latest values from the drive, like the PLC's input variables.
    std::uint16_t statusword = 0;
    const auto listening = can.bus().listen([&](const master::Frame& frame) {
      if (frame.id == 0x180u + node) statusword = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
    });
    const auto send = [&](std::uint8_t controlword) {
      // 100000 is 000186A0h, mode 1 (ch. 6, Table 5-2).
      master.send_pdo(0x200u + node, std::array<std::uint8_t, 7>{controlword, 0, 1, 0xA0, 0x86, 0x01, 0x00});
    };
    const auto wait_for = [&](const char* what, std::uint16_t mask, std::uint16_t value) {
      const bool came = can.bus().run_until(can.bus().now() + 3s, [&] { return (statusword & mask) == value; });
      if (!came) throw std::runtime_error(std::string("no ") + what + ": " + master::text_of_statusword(statusword));
    };
    master.send_pdo(0x300u + node, std::array<std::uint8_t, 8>{0, 0, 0, 0, 0x40, 0x42, 0x0F, 0x00});  // 1000000
    send(0x06);
    wait_for("ready to switch on", 0x6F, 0x21);
    send(0x07);
    wait_for("switched on", 0x6F, 0x23);
    send(0x4F);  // enabled, relative
    wait_for("operation enabled", 0x6F, 0x27);

    const auto begin = drive.read<std::int32_t>(0x6064);
    for (int run = 0; run < 10; ++run) {
      send(0x5F);                               // new set-point
      wait_for("acknowledge", 0x1400, 0x1000);  // and target reached of the previous move must be cleared
      send(0x4F);
      wait_for("target reached", 0x1400, 0x0400);
    }
    can.bus().run_for(300ms);
    examples::expect_near("counts in ten runs", drive.read<std::int32_t>(0x6064) - begin, 1'000'000, 30);
    send(0x06);
    wait_for("ready to switch on", 0x6F, 0x21);
    master.command(master::NmtCommand::enter_pre_operational, node);
  });
}
