// The buses of a computer, read from a directory tree like that of Linux.
#include "links/local_buses.hpp"

#include <fstream>
#include <gtest/gtest.h>
#include <unistd.h>

namespace servodrome::links {
namespace local_buses_test {
namespace {

namespace fs = std::filesystem;

class LocalBuses : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(root); }
  void TearDown() override { fs::remove_all(root); }

  void write(const fs::path& path, const std::string& text) {
    fs::create_directories((root / path).parent_path());
    std::ofstream(root / path) << text << "\n";
  }
  void interface(const std::string& name, const char* type, const char* flags, const char* carrier) {
    const fs::path folder = fs::path("sys/class/net") / name;
    write(folder / "type", type);
    write(folder / "flags", flags);
    write(folder / "carrier", carrier);
  }
  void tty(const std::string& name, bool hardware, const char* type = "4") {
    const fs::path folder = fs::path("sys/class/tty") / name;
    write(folder / "type", type);
    if (hardware) fs::create_directories(root / folder / "device");
    write(fs::path("dev") / name, "");
  }

  fs::path root = fs::temp_directory_path() / ("servodrome_buses_" + std::to_string(::getpid()));
};

TEST_F(LocalBuses, AreInterfacesAndSerialPorts) {
  interface("lo", "772", "0x9", "1");
  interface("enp3s0", "1", "0x1003", "1");
  interface("enp4s0", "1", "0x1003", "0");
  interface("br0", "1", "0x1003", "1");
  fs::create_directories(root / "sys/class/net/br0/bridge");
  interface("wlan0", "1", "0x1003", "1");
  fs::create_directories(root / "sys/class/net/wlan0/wireless");
  interface("can1", "280", "0x40080", "1");
  interface("can0", "280", "0x40081", "1");
  tty("ttyUSB0", true);
  tty("ttyS0", true);
  tty("ttyS1", true, "0");
  tty("tty7", false);
  fs::create_directories(root / "dev/serial/by-id");
  fs::create_symlink("../../ttyUSB0", root / "dev/serial/by-id/usb-FTDI_RS485-if00");

  const std::vector<LocalBus> found = local_buses(root);
  struct Row {
    LocalBus::Kind kind;
    const char* link;
    const char* state;
    const char* hardware;
  };
  const Row rows[] = {{LocalBus::Kind::can, "socketcan:can0", "up", ""},
                      {LocalBus::Kind::can, "socketcan:can1", "down", ""},
                      {LocalBus::Kind::ethernet, "raw:enp3s0", "up", ""},
                      {LocalBus::Kind::ethernet, "raw:enp4s0", "no cable", ""},
                      {LocalBus::Kind::serial, "serial:/dev/ttyS0", "", ""},
                      {LocalBus::Kind::serial, "serial:/dev/ttyUSB0", "", "usb-FTDI_RS485-if00"}};
  ASSERT_EQ(found.size(), std::size(rows));
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].kind, rows[i].kind) << i;
    EXPECT_EQ(found[i].link, rows[i].link);
    EXPECT_EQ(found[i].state, rows[i].state) << rows[i].link;
    EXPECT_EQ(found[i].hardware, rows[i].hardware);
  }
}

TEST_F(LocalBuses, ThereMayBeNone) { EXPECT_TRUE(local_buses(root / "nothing").empty()); }

}  // namespace
}  // namespace local_buses_test
}  // namespace servodrome::links
