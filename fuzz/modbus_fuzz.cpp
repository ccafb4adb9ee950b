// Takes any bytes as a dialogue with a Modbus device, over RTU and TCP at once. The sanitizers detect misuse of memory;
// the invariants detect malformed answers and a device that no longer answers.
#include <cstdlib>
#include <optional>

#include "frame_count.hpp"
#include "modbus/rtu_server.hpp"
#include "modbus/tcp_connection.hpp"
#include "modbus/test_device.hpp"

namespace {

using namespace servodrome;

constexpr auto identification =
    std::to_array<modbus::Identification>({{0, "Servodrome"}, {1, "fuzz"}, {2, "1"}, {3, "x"}, {0x80, "y"}});
constexpr auto error_functions = std::to_array<modbus::ErrorFunction>({{0x03, 0x81}});

// The first byte of the input selects a variant.
modbus::Profile profile_of(std::uint8_t choice) {
  modbus::Profile profile;
  if ((choice & 1) != 0) profile.word_order = modbus::WordOrder::low_word_first;
  if ((choice & 2) != 0) profile.extension = modbus::Extension::by_top_bit;
  profile.registers_per_object_at_least = static_cast<std::uint8_t>(1 + (choice >> 2 & 3));
  if ((choice & 16) != 0) profile.error_functions = error_functions;
  if ((choice & 32) == 0) profile.identification = identification;
  profile.broadcast = (choice & 64) == 0;
  return profile;
}

struct Device final : modbus::Units {
  explicit Device(std::uint8_t choice) : profile(profile_of(choice)) {}
  modbus::Server* find(std::uint8_t unit) override { return unit < 0xF0 ? &server : nullptr; }

  modbus::test::TestDevice device;
  modbus::Profile profile;
  modbus::Server server{device.dictionary, modbus::test::test_map, profile};
  modbus::RtuServer rtu{server, 1, modbus::character_timing({.bit_rate = 115200})};
  std::optional<modbus::TcpConnection> tcp{*this};
};

fuzz::FrameCount frames("executed_frames");  // complete frames or parts of frames

void check_rtu_answer(std::span<const std::uint8_t> answer) {
  if (answer.empty()) return;
  if (!modbus::is_rtu_frame(answer) || answer[0] != 1 || answer.size() < 5) std::abort();
}

void feed_tcp(Device& device, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const std::size_t taken = device.tcp->receive(bytes);
    if (taken == 0 || taken > bytes.size()) std::abort();
    bytes = bytes.subspan(taken);
    const auto answer = device.tcp->take();
    if (answer.empty()) continue;
    const modbus::Mbap header = modbus::Mbap::read(answer.data());
    if (!header.is_valid() || answer.size() != 6U + header.length) std::abort();
  }
  if (device.tcp->is_broken()) device.tcp.emplace(device);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  if (size < 2) return 0;
  Device device(bytes[0]);
  modbus::Time now{0};
  const modbus::Time character = modbus::CharacterFormat{.bit_rate = 115200}.character_time();
  const auto silence = [&device, &now] {
    now += std::chrono::milliseconds(1);
    device.rtu.poll(now);
    check_rtu_answer(device.rtu.take());
  };
  std::size_t at = 1;
  while (at < size) {
    // Record: kind and number of bytes, then these bytes.
    const std::uint8_t head = bytes[at++];
    const auto rest = std::span(bytes + at, size - at).first(std::min<std::size_t>(head & 0x1F, size - at));
    at += rest.size();
    if ((head >> 5) == 1 || (head >> 5) >= 4) ++frames;
    switch (head >> 5) {
      case 0: silence(); break;
      case 1:  // raw bytes
        for (const std::uint8_t byte : rest) device.rtu.receive(byte, now += character);
        break;
      case 2: device.rtu.receive_garbled(now += character); break;
      case 3: now += character * (head & 0x1F) / 4; break;
      case 4: feed_tcp(device, rest); break;
      case 5: {  // a PDU with the header it needs
        std::array<std::uint8_t, 40> frame{};
        modbus::Mbap{1, 0, static_cast<std::uint16_t>(1 + rest.size()), head}.write(frame.data());
        std::copy(rest.begin(), rest.end(), frame.begin() + modbus::Mbap::size);
        feed_tcp(device, std::span(frame).first(modbus::Mbap::size + rest.size()));
        break;
      }
      default: {  // a PDU as a complete frame, to the station or as a broadcast
        std::array<std::uint8_t, 40> frame{};
        frame[0] = (head >> 5) == 6 ? 1 : 0;
        std::copy(rest.begin(), rest.end(), frame.begin() + 1);
        silence();
        for (const std::uint8_t byte : std::span(frame).first(modbus::seal_rtu_frame(frame, 1 + rest.size()))) {
          device.rtu.receive(byte, now += character);
        }
        silence();
      }
    }
    check_rtu_answer(device.rtu.take());
  }
  const modbus::test::TestObjects& objects = device.device.objects;
  if (objects.name.length > 6 || objects.ranged < -100 || objects.ranged > 100) std::abort();
  // After any input, both links must answer the next request.
  silence();
  std::array<std::uint8_t, 8> request = {1, 3, 0, 0, 0, 1};
  modbus::seal_rtu_frame(request, 6);
  for (const std::uint8_t byte : request) device.rtu.receive(byte, now += character);
  now += std::chrono::milliseconds(1);
  device.rtu.poll(now);
  const auto answer = device.rtu.take();
  if (answer.size() != 7 || modbus::read_u16(&answer[3]) != objects.plain) std::abort();
  device.tcp.emplace(device);
  constexpr std::array<std::uint8_t, 12> tcp_request = {0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1};
  if (device.tcp->receive(tcp_request) != 12 || device.tcp->take().size() != 11) std::abort();
  return 0;
}
