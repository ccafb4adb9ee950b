// Takes any bytes as a dialogue with a CANopen node: each record is a few control bits, an identifier and data. The
// sanitizers detect misuse of memory; the invariants at the end detect a node that no longer answers.
#include <cstdlib>
#include <memory>

#include "canopen/301/communication_section.hpp"
#include "canopen/node.hpp"
#include "frame_count.hpp"

namespace {

using namespace servodrome;

struct Objects {
  canopen::CommunicationObjects<4, 4, 64, 2> communication;
  std::uint16_t controlword = 0;
  std::int8_t mode = 0;
  std::int32_t position = 0;
  bool flag = false;
  std::uint64_t wide = 0;
  dictionary::Blob<100> text;
};

constexpr auto table = dictionary::make_table<[] {
  using namespace dictionary;
  using C = decltype(Objects::communication);
  TableBuilder<900> t;
  constexpr std::size_t base = offsetof(Objects, communication);
  t.append(canopen::dummy_section).append(canopen::general_section<C>, base);
  t.append(canopen::sdo_server_section<C>, base);
  t.append(canopen::rpdo_section<C>, base).append(canopen::tpdo_section<C>, base);
  t.add(var(0x2000, "", SERVODROME_FIELD(Objects, text), Access::rw));
  t.add(var(0x2001, "", SERVODROME_FIELD(Objects, wide), Access::rw, Pdo::both));
  t.add(var(0x2002, "", SERVODROME_FIELD(Objects, flag), Access::rw, Pdo::both));
  t.add(var(0x6040, "", SERVODROME_FIELD(Objects, controlword), Access::rw, Pdo::both, {.minimum = 0, .maximum = 999}));
  t.add(var(0x6060, "", SERVODROME_FIELD(Objects, mode), Access::rw, Pdo::both));
  t.add(var(0x6064, "", SERVODROME_FIELD(Objects, position), Access::rw, Pdo::both));
  return t;
}>();

struct Events final : canopen::DeviceEvents {
  dictionary::AbortCode store(dictionary::Area) override { return dictionary::AbortCode::none; }
  bool lss_bit_timing_supported(std::uint8_t index) override { return index < 4; }
};

// The first byte of the input selects a variant.
canopen::Profile profile_of(std::uint8_t choice) {
  canopen::Profile profile;
  profile.valid_pdo_may_be_remapped = (choice & 1) != 0;
  profile.mapped_length_may_exceed_object = (choice & 2) != 0;
  profile.valid_pdo_cob_id_may_change = (choice & 4) != 0;
  profile.valid_pdo_parameters_may_change = (choice & 4) != 0;
  profile.type_254_sends_on_change = (choice & 8) != 0;
  profile.sdo_download_response_echoes_data = (choice & 16) != 0;
  profile.starts_operational = (choice & 32) != 0;
  if ((choice & 64) != 0) profile.node_guarding = canopen::NodeGuarding::simultaneous;
  if ((choice & 128) != 0) profile.sdo_timeout = canopen::Time{0};
  return profile;
}

struct Device {
  explicit Device(std::uint8_t choice) : profile(profile_of(choice)) {
    dictionary.load_defaults(dictionary::Area::all, 1);
  }
  canopen::Profile profile;
  Objects objects;
  Events events;
  dictionary::Dictionary dictionary{table, std::as_writable_bytes(std::span(&objects, 1))};
  canopen::NodeStorage<4, 4, 64, 2, 64> storage;
  canopen::Node node{dictionary, profile, events, storage.memory()};
};

void drain(canopen::Node& node) {
  canopen::Frame frame;
  for (int frames = 0; node.take(frame); ++frames) {
    if (frame.length > 8 || frame.id > 0x7FF || frames > 10000) std::abort();
  }
}

fuzz::FrameCount frames("executed_frames");

constexpr std::array<std::uint16_t, 16> identifiers = {0x000, 0x080, 0x100, 0x201, 0x301, 0x601, 0x601, 0x601,
                                                       0x601, 0x701, 0x77F, 0x7E5, 0x181, 0x281, 0x081, 0x401};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  if (size < 2) return 0;
  const auto device = std::make_unique<Device>(bytes[0]);
  canopen::Node& node = device->node;
  canopen::Time now{0};
  node.start((bytes[1] & 1) != 0 ? canopen::unconfigured_node_id : std::uint8_t{1}, now);
  std::size_t at = 2;
  while (at + 2 <= size) {
    // Record: identifier choice and length, then time and flags, then data.
    const std::uint8_t head = bytes[at++];
    const std::uint8_t flags = bytes[at++];
    canopen::Frame frame;
    frame.id = identifiers[head & 15];
    frame.length = static_cast<std::uint8_t>((head >> 4) > 8 ? 8 : head >> 4);
    frame.remote = (flags & 0x80) != 0;
    frame.extended = (flags & 0xC0) == 0xC0;
    for (std::uint8_t i = 0; i < frame.length && at < size; ++i) frame.data[i] = bytes[at++];
    now += std::chrono::microseconds(50) * (flags & 0x1F) * (flags & 0x1F) * (flags & 0x1F);
    node.receive(frame, now);
    ++frames;
    if ((flags & 0x20) != 0) node.process_image_updated(now);
    node.poll(now);
    if (node.next_deadline() <= now) std::abort();
    if ((flags & 0x03) != 3) drain(node);
  }
  drain(node);
  if (device->objects.text.length > 100) std::abort();
  // Transfers time out, a change of the bit rate ends, and the node must answer.
  now += std::chrono::hours(1);
  node.poll(now);
  drain(node);
  if (node.node_id() != 1) return 0;
  device->profile.sdo_timeout = std::chrono::seconds(1);
  node.receive({.id = 0, .length = 2, .data = {0x82, 1}}, now);
  drain(node);
  if (node.node_id() != 1) return 0;
  node.receive({.id = 0x601, .length = 8, .data = {0x40, 0x18, 0x10, 0}}, now);
  canopen::Frame frame;
  bool answered = false;
  while (node.take(frame)) answered = answered || (frame.id == 0x581 && frame.data[0] == 0x4F);
  if (!answered) std::abort();
  return 0;
}
