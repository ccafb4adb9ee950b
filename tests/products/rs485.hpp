#pragma once

#include "modbus/ismk_objects.hpp"
#include "products/serial_port.hpp"

namespace servodrome::test {

// A master on the RS485 port of a drive in a rig. `characters` take the time of the port's format.
template <typename RigType>
class Rs485Master {
 public:
  explicit Rs485Master(RigType& rig) : rig_(rig) {}

  // Returns the answer to these characters, in hexadecimal; afterwards the drive has two milliseconds to execute
  // commands.
  std::string ask(const std::string& request) { return ask(bytes_of(request)); }
  std::string ask(const std::vector<std::uint8_t>& request) {
    products::SerialPort& port = *rig_.device.serial_port();
    time_ = std::max(time_, rig_.now());
    std::vector<std::uint8_t> answer;
    const auto take = [&] {
      const auto bytes = port.take();
      answer.insert(answer.end(), bytes.begin(), bytes.end());
    };
    for (const std::uint8_t byte : request) {
      port.receive(byte, true, time_ += port.format().character_time());
      take();
    }
    if (port.next_deadline() != modbus::never) {
      time_ = port.next_deadline();
      port.poll(time_);
      take();
    }
    rig_.run_ms(2);
    return hex_of(answer);
  }
  // The same for a Modbus frame: appends the CRC, and removes it from the answer.
  std::string ask_modbus(const std::string& request) {
    std::vector<std::uint8_t> bytes = bytes_of(request);
    const std::size_t size = bytes.size();
    bytes.resize(size + 2);
    modbus::seal_rtu_frame(bytes, size);
    const std::string answer = ask(bytes);
    if (answer.empty()) return answer;
    EXPECT_TRUE(modbus::is_rtu_frame(bytes_of(answer))) << answer;
    return answer.substr(0, answer.size() - 6);
  }
  // The same for a frame of the 10-byte protocol.
  serial10::Frame ask_serial10(const serial10::Frame& request) {
    const std::vector<std::uint8_t> answer =
        bytes_of(ask(std::vector<std::uint8_t>(request.bytes.begin(), request.bytes.end())));
    serial10::Frame frame;
    EXPECT_TRUE(answer.empty() || answer.size() == serial10::frame_bytes);
    if (answer.size() == serial10::frame_bytes) std::copy(answer.begin(), answer.end(), frame.bytes.begin());
    return frame;
  }

 private:
  RigType& rig_;
  modbus::Time time_{};
};

}  // namespace servodrome::test
