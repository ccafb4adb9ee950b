#pragma once

#include "modbus/ismk_objects.hpp"
#include "modbus/rtu_server.hpp"

// The iSMK's Modbus interface (manual, ch. 8.3) on the objects of the examples.
namespace servodrome::modbus::test {

using namespace std::chrono_literals;
using servodrome::test::bytes_of;
using servodrome::test::hex_of;

inline constexpr auto ismk_pages = std::to_array<Page>({{0x2FF0, 0x2900},
                                                        {0x6040, 0x3100},
                                                        {0x6041, 0x3200},
                                                        {0x605A, 0x3400},
                                                        {0x605B, 0x3410},
                                                        {0x6060, 0x3500},
                                                        {0x6063, 0x3700},
                                                        {0x607A, 0x4000},
                                                        {0x6081, 0x4A00},
                                                        {0x6083, 0x4B00},
                                                        {0x6084, 0x4C00},
                                                        {0x6098, 0x4D00},
                                                        {0x6099, 0x5000},
                                                        {0x60FF, 0x6F00},
                                                        {0x6510, 0x8600}});
inline constexpr auto ismk_map = make_register_map<[] {
  RegisterMapBuilder<50> map;
  map.add_pages(servodrome::test::ismk_table, ismk_pages, 0x10);
  map.add({0x2A01, 0x2FF0, 0x11, 1});  // as printed, ch. 3.7
  return map;
}>();
static_assert(is_valid_map(ismk_map, servodrome::test::ismk_table));

inline constexpr auto ismk_error_functions = std::to_array<ErrorFunction>({{0x03, 0x81}});

inline constexpr Profile ismk_profile{
    .functions = {.read_input_registers = false,
                  .read_write_multiple_registers = false,
                  .device_identification = false},
    .word_order = WordOrder::low_word_first,
    .extension = Extension::by_top_bit,
    .registers_per_object_at_least = 2,
    .error_functions = ismk_error_functions,
};

inline constexpr CharacterFormat ismk_format{.bit_rate = 115200, .parity = Parity::none};

// A station and the line's clock.
template <typename Device>
struct Station {
  Station(const Profile& profile, std::span<const Register> map, std::uint8_t number = 1,
          const RtuTiming& rtu_timing = character_timing(ismk_format))
      : timing(rtu_timing), server(device.dictionary, map, profile), rtu(server, number, rtu_timing) {}

  // Sends characters without a pause.
  void send(std::span<const std::uint8_t> bytes) {
    for (const std::uint8_t byte : bytes) rtu.receive(byte, now += timing.character);
  }
  // Returns the response that the station sends when the line has been silent.
  std::string answer() {
    now += timing.silence;
    rtu.poll(now);
    return hex_of(rtu.take());
  }
  std::string ask(const std::string& request) {
    send(bytes_of(request));
    return answer();
  }
  // The same, and appends the CRC.
  std::string ask_sealed(const std::string& request) {
    std::vector<std::uint8_t> bytes = bytes_of(request);
    const std::size_t size = bytes.size();
    bytes.resize(size + 2);
    seal_rtu_frame(bytes, size);
    send(bytes);
    const std::string text = answer();
    if (text.empty()) return text;
    const std::vector<std::uint8_t> reply = bytes_of(text);
    EXPECT_TRUE(is_rtu_frame(reply)) << text;
    return text.substr(0, text.size() - 6);
  }

  Device device;
  RtuTiming timing;
  Server server;
  RtuServer rtu;
  Time now{};
};

}  // namespace servodrome::modbus::test
