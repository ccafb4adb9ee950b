// The examples of the iSMK manual (ch. 9.3.2, and the same over Modbus, Table 8-1, and RS232, Table 8-3): homing by
// method 33, position mode absolute and relative, speed mode. All written values are the manual's.
//
//   07_ismk [LINK]                                      node 4, as on the line that ./run starts
#include "axis/axis402.hpp"
#include "connection.hpp"
#include "master/canopen/sdo_client.hpp"

using namespace servodrome;
using namespace std::chrono_literals;

namespace {

struct Write {
  std::uint16_t index;
  std::uint8_t sub;
  std::int32_t value;
  std::uint8_t bytes;
};

// Speeds in DEC = rpm * 512 * 65536 / 1875, accelerations in DEC = rps/s * 65536 * 65536 / 4000000 (appendix II).
constexpr std::int32_t rpm_200 = 0x00369D03;
constexpr std::int32_t rpm_100 = 0x001B4E82;
constexpr std::int32_t rps2_100 = 0x0001A36E;

constexpr Write home[] = {{0x6040, 0, 0x0F, 2},    {0x6060, 0, 6, 1},       {0x6098, 0, 33, 1},
                          {0x6099, 1, rpm_200, 4}, {0x6099, 2, rpm_100, 4}, {0x6040, 0, 0x1F, 2}};
constexpr Write profile[] = {{0x6060, 0, 1, 1},
                             {0x607A, 0, 50000, 4},
                             {0x6081, 0, rpm_200, 4},
                             {0x6083, 0, rps2_100, 4},
                             {0x6084, 0, rps2_100, 4}};
constexpr Write absolute[] = {{0x6040, 0, 0x2F, 2}, {0x6040, 0, 0x3F, 2}};
constexpr Write relative[] = {{0x6040, 0, 0x4F, 2}, {0x6040, 0, 0x5F, 2}};
constexpr Write speed[] = {{0x6060, 0, 3, 1}, {0x60FF, 0, -rpm_100, 4}, {0x6040, 0, 0x2F, 2}};

void write(master::ObjectClient& drive, std::span<const Write> list) {
  for (const Write& one : list) {
    drive.download({one.index, one.sub}, std::as_bytes(std::span(&one.value, 1)).first(one.bytes));
    drive.wait(10ms);
  }
}

void wait_for(master::ObjectClient& drive, const char* what, std::uint16_t bit) {
  drive.wait(50ms);
  for (int i = 0; i < 4000; ++i) {
    if ((drive.read<std::uint16_t>(0x6041) & bit) != 0) return;
    drive.wait(5ms);
  }
  throw std::runtime_error(std::string("no ") + what + ": " +
                           master::text_of_statusword(drive.read<std::uint16_t>(0x6041)));
}

}  // namespace

int main(int argc, char** argv) {
  return examples::run(argc, argv, "usage: 07_ismk [LINK]", [](std::string_view link) {
    constexpr std::uint16_t target_reached = 1U << 10;
    constexpr std::uint16_t reference_found = 1U << 15;
    examples::Can can(link, "default.toml");
    master::SdoClient drive(can.bus(), 4);
    const examples::QuickStopOnFailure stop_on_failure(drive);

    write(drive, home);
    wait_for(drive, "reference found", reference_found);
    drive.wait(300ms);
    examples::expect_near("at home", drive.read<std::int32_t>(0x6063), 0, 10);

    write(drive, profile);
    write(drive, absolute);
    wait_for(drive, "target reached", target_reached);
    drive.wait(300ms);
    examples::expect_near("absolute", drive.read<std::int32_t>(0x6063), 50000, 10);
    write(drive, relative);
    wait_for(drive, "target reached", target_reached);
    drive.wait(300ms);
    examples::expect_near("relative", drive.read<std::int32_t>(0x6063), 100000, 10);

    write(drive, speed);
    const auto begin = drive.read<std::int32_t>(0x6063);
    drive.wait(1s);
    // 100 rpm for a second, minus the ramp.
    examples::expect_near("revolutions", (drive.read<std::int32_t>(0x6063) - begin) / 65536.0, -100.0 / 60.0, 0.1);
    drive.write<std::uint16_t>(0x6040, 0, 0x06);
  });
}
