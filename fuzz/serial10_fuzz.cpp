// Takes any bytes as a dialogue with a drive that speaks the 10-byte protocol. The sanitizers detect misuse of memory;
// the invariants detect malformed answers and a drive that no longer answers.
#include <algorithm>
#include <cstdlib>

#include "dictionary/table.hpp"
#include "frame_count.hpp"
#include "serial10/server.hpp"

namespace {

using namespace servodrome;

struct Objects {
  std::uint16_t controlword = 0;
  std::int8_t mode = 0;
  std::int32_t position = 0;
  std::uint64_t wide = 0;
  std::uint16_t secret = 0;
};

constexpr auto table = dictionary::make_table<[] {
  using namespace dictionary;
  TableBuilder<10> t;
  t.add(text_constant(0x1008, "", "fuzz"));
  t.add(var(0x2001, "", SERVODROME_FIELD(Objects, wide), Access::rw));
  t.add(var(0x2002, "", SERVODROME_FIELD(Objects, secret), Access::wo));
  t.add(var(0x6040, "", SERVODROME_FIELD(Objects, controlword), Access::rw, Pdo::none, {.minimum = 0, .maximum = 999}));
  t.add(var(0x6060, "", SERVODROME_FIELD(Objects, mode), Access::rw));
  t.add(var(0x6064, "", SERVODROME_FIELD(Objects, position), Access::rw));
  return t;
}>();

fuzz::FrameCount frames("executed_frames");  // complete frames or parts of frames

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  Objects objects;
  dictionary::Dictionary dictionary(table, std::as_writable_bytes(std::span(&objects, 1)));
  serial10::Server server(dictionary, 1);
  serial10::Time now{0};
  const auto check = [&server] {
    const auto bytes_to_send = server.take();
    if (bytes_to_send.empty()) return;
    serial10::Frame answer;
    if (bytes_to_send.size() != serial10::frame_bytes) std::abort();
    std::copy(bytes_to_send.begin(), bytes_to_send.end(), answer.bytes.begin());
    if (!answer.is_intact() || answer.id() != 1) std::abort();
  };
  const auto send = [&server, &now](const serial10::Frame& frame) {
    for (const std::uint8_t byte : frame.bytes) server.receive(byte, now += std::chrono::microseconds(87));
  };
  for (std::size_t at = 0; at < size;) {
    // Record: kind and number of bytes, then these bytes.
    const std::uint8_t head = bytes[at++];
    const auto rest = std::span(bytes + at, size - at).first(std::min<std::size_t>(head & 0x0F, size - at));
    at += rest.size();
    if ((head >> 6) == 0 || (head >> 6) == 3) ++frames;
    switch (head >> 6) {
      case 0:
        for (const std::uint8_t byte : rest) server.receive(byte, now += std::chrono::microseconds(87));
        break;
      case 1: now += std::chrono::milliseconds(10) * (head & 0x0F); break;
      case 2: server.receive_garbled(now += std::chrono::microseconds(87)); break;
      default: {  // a frame with a correct checksum
        std::array<std::uint8_t, 8> body{};
        std::copy_n(rest.begin(), std::min<std::size_t>(rest.size(), 8), body.begin());
        std::uint32_t data = 0;
        std::memcpy(&data, &body[4], 4);
        send(serial10::Frame::make((head & 0x10) != 0 ? 127 : 1, static_cast<serial10::Command>(body[0]),
                                   static_cast<std::uint16_t>(body[1] | body[2] << 8), body[3], data));
      }
    }
    check();
  }
  if (objects.controlword > 999) std::abort();
  now += std::chrono::milliseconds(60);
  send(serial10::Frame::make(1, serial10::Command::read, 0x6040, 0, 0));
  const auto answer = server.take();
  if (answer.size() != 10 || answer[1] != 0x4B || (answer[5] | answer[6] << 8) != objects.controlword) std::abort();
  return 0;
}
