// Sends random and mutated CAN frames to complete drives on their plants. Not guided by coverage: a fixed pseudo-random
// sequence, so that the same seed repeats a failure. Run it in a build with sanitizers:
//
//   drive_frames COUNT [SEED]
//
// Most frames are nearly valid: NMT, SYNC, SDO requests for objects that exist, PDOs, LSS, with some bits flipped. The
// drives run a few ticks between the frames. After every 10,000 frames all drives must still answer an SDO request
// after a reset. Exit status 1 if a drive does not answer.
#include <cstdio>
#include <cstdlib>
#include <random>

#include "../tests/products/rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "products/pronet/pronet.hpp"

namespace {

using namespace servodrome;

constexpr std::array<std::uint8_t, 6> nmt_commands{1, 2, 0x80, 0x81, 0x82, 0x77};

constexpr std::array<std::uint8_t, 10> controlwords{0x06, 0x06, 0x07, 0x0F, 0x0F, 0x1F, 0x5F, 0x3F, 0x0B, 0x80};

canopen::Frame random_frame(std::mt19937_64& random, std::uint8_t node, std::span<const dictionary::Entry> table) {
  const auto pick = [&random](std::uint64_t n) { return random() % n; };
  canopen::Frame frame;
  frame.length = 8;
  const std::uint64_t bytes = random();
  for (unsigned i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(bytes >> (8 * i));
  switch (pick(16)) {
    case 0:  // NMT
      frame.id = 0;
      frame.length = 2;
      frame.data[0] = nmt_commands[pick(nmt_commands.size())];
      frame.data[1] = pick(2) != 0 ? node : 0;
      break;
    case 1: frame.id = 0x80, frame.length = static_cast<std::uint8_t>(pick(3)); break;
    case 2: frame.id = 0x100, frame.length = 6; break;
    case 3:
      frame.id = 0x7E5;
      frame.data[0] = static_cast<std::uint8_t>(pick(0x60));
      break;
    case 4:
      frame.id = static_cast<std::uint32_t>(0x200 + 0x100 * pick(4)) + node,
      frame.length = static_cast<std::uint8_t>(pick(9));
      break;
    case 5: frame.id = 0x700U + node, frame.remote = true, frame.length = 1; break;
    case 6: frame.id = static_cast<std::uint32_t>(0x180 + 0x100 * pick(4)) + node, frame.remote = true; break;
    case 7:
      frame.id = static_cast<std::uint32_t>(pick(0x800)), frame.length = static_cast<std::uint8_t>(pick(9));
      break;
    case 8: frame.id = static_cast<std::uint32_t>(pick(0x20000000)), frame.extended = true; break;
    case 9: {  // the sequence to Operation enabled, and modes, so that the frames also reach moving drives
      frame.id = 0x600U + node;
      const std::uint8_t control = controlwords[pick(controlwords.size())];
      const auto mode = static_cast<std::uint8_t>(pick(12));
      frame.data = pick(3) != 0 ? std::array<std::uint8_t, 8>{0x2B, 0x40, 0x60, 0, control, 0, 0, 0}
                                : std::array<std::uint8_t, 8>{0x2F, 0x60, 0x60, 0, mode, 0, 0, 0};
      return frame;
    }
    default: {  // SDO
      frame.id = 0x600U + node;
      const dictionary::Entry& entry = table[pick(table.size())];
      static constexpr std::array<std::uint8_t, 20> specifiers{0x40, 0x40, 0x23, 0x27, 0x2B, 0x2F, 0x21,
                                                               0x20, 0x60, 0x70, 0x00, 0x10, 0x01, 0x11,
                                                               0xA0, 0xA3, 0xC6, 0xC2, 0x80, 0xA1};
      frame.data[0] = specifiers[pick(specifiers.size())];
      if (pick(4) != 0) {
        frame.data[1] = static_cast<std::uint8_t>(entry.index);
        frame.data[2] = static_cast<std::uint8_t>(entry.index >> 8);
        frame.data[3] = entry.sub;
      }
      if (pick(2) != 0) frame.data[5] = frame.data[6] = frame.data[7] = 0;
    }
  }
  if (pick(8) == 0) frame.data[pick(8)] ^= static_cast<std::uint8_t>(1U << pick(8));
  if (pick(32) == 0) frame.length = static_cast<std::uint8_t>(pick(9));
  return frame;
}

template <typename Device>
bool answers(test::Rig<Device>& rig) {
  rig.feedback.encoder_faults = 0;
  rig.device.power_on(rig.feedback, rig.now());
  rig.sent.clear();
  const std::uint8_t node = rig.device.node_id();
  if (node > 127) return true;  // LSS has removed its node-ID: it must not answer
  rig.send(0x600U + node, {0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0});
  for (const canopen::Frame& frame : rig.sent) {
    if (frame.id == 0x580U + node && frame.data[0] == 0x43 && frame.data[4] == 0x92) return true;
  }
  return false;
}

template <typename Device>
bool fuzz(const char* name, std::uint64_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  test::Rig<Device> rig;
  for (std::uint64_t i = 0; i < count; ++i) {
    const canopen::Frame frame = random_frame(random, rig.device.node_id(), Device::table);
    rig.device.receive(frame, rig.now());
    for (std::uint64_t ticks = random() % 4; ticks > 0; --ticks) rig.tick();
    if (rig.sent.size() > 10000) rig.sent.clear();
    if (i % 10000 == 9999 && !answers(rig)) {
      std::fprintf(stderr, "%s does not answer after frame %llu of seed %llu\n", name,
                   static_cast<unsigned long long>(i), static_cast<unsigned long long>(seed));
      return false;
    }
  }
  std::printf("%s: %llu frames, still answering\n", name, static_cast<unsigned long long>(count));
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: drive_frames COUNT [SEED]\n");
    return 2;
  }
  const std::uint64_t count = std::strtoull(argv[1], nullptr, 10);
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const bool ok = fuzz<products::Ismc>("ismc", count / 3, seed) &&
                  fuzz<products::Generic402>("generic402", count / 3, seed + 1) &&
                  fuzz<products::Pronet>("pronet", count / 3, seed + 2);
  return ok ? 0 : 1;
}
