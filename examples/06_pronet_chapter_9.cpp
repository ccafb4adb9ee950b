// Chapter 9 of the ProNet CANopen manual: a parameter by SDO (ch. 9.1), profile position by PDO (ch. 9.2 and 9.3),
// interpolated position synchronised by SYNC (ch. 9.4), homing (ch. 9.5).
//
//   06_pronet_chapter_9 [LINK]                          node 3, as on the line that ./run starts
#include "catalogue/product.hpp"
#include "axis/axis402.hpp"
#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/motion_group.hpp"
#include "connection.hpp"

using namespace servodrome;
using namespace std::chrono_literals;

namespace {

constexpr std::uint8_t node = 3;

void wait_for(master::SdoClient& drive, const char* what, std::uint16_t mask, std::uint16_t value) {
  for (int i = 0; i < 1000; ++i) {
    if ((drive.read<std::uint16_t>(0x6041) & mask) == value) return;
    drive.wait(5ms);
  }
  throw std::runtime_error(std::string("no ") + what + ": " +
                           master::text_of_statusword(drive.read<std::uint16_t>(0x6041)));
}

void enable(master::SdoClient& drive) {
  drive.write<std::uint16_t>(0x6040, 0, 0x06);
  wait_for(drive, "ready to switch on", 0x6F, 0x21);
  drive.write<std::uint16_t>(0x6040, 0, 0x07);
  wait_for(drive, "switched on", 0x6F, 0x23);
  drive.write<std::uint16_t>(0x6040, 0, 0x0F);
  wait_for(drive, "operation enabled", 0x6F, 0x27);
}

// 9.1: Pn304 (3022h) is -1000, FC18h.
void parameter(master::SdoClient& drive) {
  const auto before = drive.read<std::int16_t>(0x3022);
  drive.write<std::int16_t>(0x3022, 0, -1000);
  examples::expect_near("Pn304", drive.read<std::int16_t>(0x3022), -1000, 0);
  drive.write<std::int16_t>(0x3022, 0, before);
}

// 9.2: RPDO1 is the controlword, RPDO2 target position and velocity. 50000 position units at 30 rpm, absolute,
// relative, and back.
void profile_position(master::Master& master, master::SdoClient& drive) {
  master.command(master::NmtCommand::enter_pre_operational, node);
  master::write_pdo(drive, {false, 0, 0x200u + node, 255, {0x60400010}});
  master::write_pdo(drive, {false, 1, 0x300u + node, 255, {0x607A0020, 0x60810020}});
  master.command(master::NmtCommand::start, node);
  drive.write<std::int8_t>(0x6060, 0, 1);
  enable(drive);
  const auto control = [&](std::uint8_t word) {
    master.send_pdo(0x200u + node, std::array<std::uint8_t, 2>{word, 0});
    master.bus().run_for(20ms);
  };
  struct Move {
    const char* what;
    std::array<std::uint8_t, 8> target_and_speed;
    std::uint8_t new_set_point;  // absolute 1Fh, relative 5Fh
    double arrives_at;
  };
  const Move moves[] = {
      {"absolute", {0x50, 0xC3, 0x00, 0x00, 0x2C, 0x01, 0x00, 0x00}, 0x1F, 50000},
      {"relative", {0x50, 0xC3, 0x00, 0x00, 0x2C, 0x01, 0x00, 0x00}, 0x5F, 100000},
      {"back", {0xB0, 0x3C, 0xFF, 0xFF, 0x2C, 0x01, 0x00, 0x00}, 0x1F, -50000},
  };
  for (const Move& move : moves) {
    master.send_pdo(0x300u + node, move.target_and_speed);
    control(0x0F);
    control(move.new_set_point);
    wait_for(drive, "target reached", 0x0400, 0x0400);
    control(0x0F);
    drive.wait(200ms);
    examples::expect_near(move.what, drive.read<std::int32_t>(0x6064), move.arrives_at, 20);
  }
  drive.write<std::uint16_t>(0x6040, 0, 0x06);
}

// 9.3: synchronous PDOs; 60C2h and 2105h have the SYNC's period; controlword and 60C1h are sent in each cycle. The
// manual's host sends 16 positions and does not define the path; here the path is a jerk-limited trajectory of one
// revolution.
void interpolated_position(master::Bus& bus) {
  master::CanDrive drive = master::interpolated_position_drive(node);
  drive.values.push_back({{0x2105, 0}, 10'000, 4});  // us (ch. 7.5.4)
  master::CanCyclicBus cyclic(bus, {drive}, {.period = 10ms});
  const master::MotionAxisOptions options[] = {{.position_mode = master::OperationMode::interpolated_position}};
  master::MotionGroup axes(cyclic, options);
  axes.enable();
  const double begin = axes.axis(0).set_point().position;
  constexpr double revolution = 131072;
  const master::MotionLimits limits{2 * revolution, 20 * revolution, 20 * revolution, 500 * revolution};
  axes.axis(0).move_to(begin + revolution, 0.0, limits);
  axes.wait_until([&] { return axes.all_done(); }, 10s);
  axes.wait(200ms);
  examples::expect_near("interpolated", double(axes.axis(0).position()) - begin, revolution, 20);
  axes.disable(limits);
}

// 9.4, with method 35, because the manual's method 4 needs a home switch and an index. Writes both speeds; the manual
// omits 6099h sub 1.
void homing(master::SdoClient& drive) {
  master::Axis402 axis(drive, {.product = &catalogue::product_of("pronet")});
  axis.enable();
  axis.home({.method = 35, .switch_speed = 1000, .zero_speed = 100}, 30s);
  examples::expect_near("home", axis.position(), 0, 20);
  axis.disable();
}

}  // namespace

int main(int argc, char** argv) {
  return examples::run(argc, argv, "usage: 06_pronet_chapter_9 [LINK]", [](std::string_view link) {
    examples::Can can(link, "default.toml");
    master::Master master(can.bus());
    master::SdoClient drive(can.bus(), node);
    const examples::QuickStopOnFailure stop_on_failure(drive);
    parameter(drive);
    profile_position(master, drive);
    interpolated_position(can.bus());
    homing(drive);
  });
}
