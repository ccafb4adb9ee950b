// Takes any bytes as a dialogue with a segment of EtherCAT slaves. The first byte brings the segment to one of its
// states. Each following record is a datagram with its data (a mailbox message is one kind), or a complete frame of raw
// bytes, or an event at the cables. The sanitizers detect misuse of memory; the invariants at the end detect a segment
// that a master can no longer scan and start, whatever another master did to it before.
#include <algorithm>
#include <cstdlib>
#include <memory>
#include <vector>

#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/segment.hpp"
#include "ethercat/slave/communication_section.hpp"
#include "ethercat/slave/slave.hpp"
#include "frame_count.hpp"

namespace {

using namespace servodrome;
using namespace servodrome::ethercat;

struct Objects {
  CommunicationObjects<2, 2, 8, 2> communication;
  std::uint16_t controlword = 0;
  std::int32_t position = 0;
  std::int16_t ranged = 0;
  bool flag = false;
  std::uint64_t wide = 0;
  dictionary::Blob<300> text;
  std::array<bool, 12> bits{};
};

constexpr auto table = dictionary::make_table<[] {
  using namespace dictionary;
  TableBuilder<200> t;
  t.append(communication_section<decltype(Objects::communication)>, offsetof(Objects, communication));
  t.add(text_constant(0x1008, "Device name", "fuzzed"));
  t.add(var(0x2000, "Text", SERVODROME_FIELD(Objects, text), Access::rw));
  t.add(var(0x2001, "Wide", SERVODROME_FIELD(Objects, wide), Access::rw, Pdo::both));
  t.add(var(0x2002, "Flag", SERVODROME_FIELD(Objects, flag), Access::rw, Pdo::both));
  t.add(var(0x2003, "Ranged", SERVODROME_FIELD(Objects, ranged), Access::rw, Pdo::both, {.minimum = -9, .maximum = 9}));
  t.add(highest_sub(0x2010, ObjectCode::record, "Bits", 12));
  for (std::uint8_t i = 0; i < 12; ++i) {
    t.add(element(0x2010, static_cast<std::uint8_t>(i + 1), ObjectCode::record, "Bit",
                  field_at<bool>(offsetof(Objects, bits) + i), Access::rw));
  }
  t.add(var(0x6040, "Controlword", SERVODROME_FIELD(Objects, controlword), Access::rw, Pdo::rpdo));
  t.add(var(0x6064, "Position", SERVODROME_FIELD(Objects, position), Access::ro, Pdo::tpdo));
  t.set_default(0x1600, 0, 1)
      .set_default(0x1600, 1, 0x60400010)
      .set_default(0x1C12, 0, 1)
      .set_default(0x1C12, 1, 0x1600);
  t.set_default(0x1A00, 0, 1)
      .set_default(0x1A00, 1, 0x60640020)
      .set_default(0x1C13, 0, 1)
      .set_default(0x1C13, 1, 0x1A00);
  return t;
}>();

struct Events final : SlaveEvents {};

// A file of 700 bytes with the name "F".
struct Files final : FoeFiles {
  FoeError open(std::string_view name, std::uint32_t, bool) override {
    return name == "F" ? FoeError::none : FoeError::not_found;
  }
  FoeError read(std::uint32_t position, std::span<std::uint8_t> into, std::size_t& count) override {
    if (position > content.size()) std::abort();
    count = std::min(into.size(), content.size() - position);
    std::copy_n(content.begin() + position, count, into.begin());
    return FoeError::none;
  }
  FoeError write(std::uint32_t position, std::span<const std::uint8_t> data, bool) override {
    if (position + data.size() > content.size()) return FoeError::disk_full;
    std::copy(data.begin(), data.end(), content.begin() + position);
    return FoeError::none;
  }
  std::array<std::uint8_t, 700> content{};
};

std::array<std::uint8_t, 128> sii_image() {
  std::array<std::uint8_t, 128> image{};
  image[0] = 0x08;
  image[14] = sii_checksum(std::span(image).first(14));
  return image;
}

struct Device {
  Device() {
    dictionary.load_defaults(dictionary::Area::all, 0);
    slave.set_files(&files);
  }

  Objects objects;
  Events events;
  Files files;
  Profile profile;
  std::array<std::uint8_t, 128> sii = sii_image();
  Esc esc{sii};
  dictionary::Dictionary dictionary{table, std::as_writable_bytes(std::span(&objects, 1))};
  SlaveStorage<24, 128, 512> storage;
  Slave slave{esc, dictionary, profile, events, storage.memory()};
};

constexpr std::array<std::uint8_t, 4> states = {1, 2, 4, 8};
constexpr std::array<std::uint8_t, 3> reset_sequence = {'R', 'E', 'S'};

fuzz::FrameCount frames("executed_frames");

struct Machine {
  Machine() {
    for (std::size_t i = 0; i < line.size(); ++i) {
      line[i] = {.esc = &devices[i].esc, .forward = Time{300}, .backward = Time{300}};
      devices[i].esc.power_on(now);
      devices[i].slave.start(now);
    }
    devices[1].profile.bootstrap = true;
    devices[2].profile.mapped_length_may_differ = true;
  }

  void poll() {
    for (Device& device : devices) device.slave.poll(now);
  }
  void pass(std::span<std::uint8_t> bytes, Segment::Port port = Segment::Port::primary,
            Segment::Encapsulation encapsulation = Segment::Encapsulation::ethernet) {
    now += std::chrono::microseconds(20);
    if (counts) ++frames;
    segment.process(bytes, now, port, encapsulation);
    poll();
  }
  // Returns the working counter; the data that were read are in `answer`.
  unsigned send(Command command, std::uint32_t address, std::span<const std::uint8_t> data) {
    FrameWriter writer = FrameWriter::ethernet(memory);
    const auto place = writer.add(command, 0, address, data.size());
    std::copy(data.begin(), data.end(), place.begin());
    pass(writer.bytes());
    answer.assign(place.begin(), place.end());
    return load_u16(place.data() + place.size());
  }
  void wait(Time span) {
    for (const Time end = now + span; now < end;) {
      Time next = end;
      for (Device& device : devices) next = std::min(next, device.slave.next_deadline(now));
      now = std::max(next, now + Time{1});
      poll();
    }
  }

  // Starts every slave from the beginning, as a master does. False: a slave did not reach its state.
  bool start(std::uint8_t state) {
    send(Command::bwr, address_of(0, reg::register_write_protection), {});
    for (const std::uint8_t letter : reset_sequence) send(Command::bwr, address_of(0, reg::reset_ecat), {&letter, 1});
    wait(std::chrono::milliseconds(10));
    const std::uint8_t zero[2]{};
    if (send(Command::brd, address_of(0, reg::type), zero) != devices.size()) return false;
    for (Device& device : devices) device.dictionary.load_defaults(dictionary::Area::all, 0);
    const std::uint8_t mailboxes[]{0, 0x10, 128, 0, 0x26, 0, 1, 0, 0, 0x11, 128, 0, 0x22, 0, 1, 0};
    send(Command::bwr, address_of(0, reg::sync_manager), mailboxes);
    const std::uint8_t process_data[]{0, 0x12, 2, 0, 0x64, 0, 1, 0, 0, 0x15, 4, 0, 0x20, 0, 1, 0};
    for (const std::uint8_t step : states) {
      if (step > state) break;
      if (step == 4) send(Command::bwr, address_of(0, reg::sync_manager + 16), process_data);
      if (step == 8) send(Command::bwr, address_of(0, 0x1200), zero);
      const std::uint8_t control[]{static_cast<std::uint8_t>(step | 0x10), 0};
      send(Command::bwr, address_of(0, reg::al_control), control);
      for (const Device& device : devices) {
        if (device.slave.error() || static_cast<std::uint8_t>(device.slave.state()) != step) return false;
      }
    }
    return true;
  }

  Time now{std::chrono::seconds(1)};
  bool counts = false;  // frames of the input are counted, those of the start are not
  std::array<Device, 3> devices;
  std::array<Segment::Slave, 3> line;
  Segment segment{std::span(line.data(), 0)};
  std::array<std::uint8_t, max_frame> memory{};
  std::vector<std::uint8_t> answer;
};

constexpr std::array<std::uint16_t, 32> offsets = {0x0000, 0x0010, 0x0020, 0x0030, 0x0040, 0x0100, 0x0110, 0x0120,
                                                   0x0130, 0x0200, 0x0300, 0x0400, 0x0420, 0x0500, 0x0502, 0x0508,
                                                   0x0600, 0x0610, 0x0800, 0x0808, 0x0810, 0x0818, 0x0806, 0x080E,
                                                   0x0900, 0x0910, 0x0920, 0x0980, 0x0990, 0x1000, 0x1100, 0x1200};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  if (size < 2) return 0;
  const auto machine = std::make_unique<Machine>();
  machine->segment = Segment(machine->line);
  if (!machine->start(states[bytes[0] & 3])) std::abort();
  std::size_t at = 1;
  machine->counts = true;
  while (at + 3 <= size) {
    // Record: kind, command and place, length; then data.
    const std::uint8_t kind = bytes[at++];
    const std::uint8_t what = bytes[at++];
    // Most records are short, so that an input of 4096 bytes has about 150 frames: the start of three slaves costs as
    // much as 100 frames.
    const std::uint8_t size_byte = bytes[at++];
    const std::size_t announced = size_byte < 0xF0 ? size_byte % 16 : size_byte;
    const std::size_t length = std::min(announced, size - at);
    const std::span<const std::uint8_t> data(bytes + at, length);
    at += length;
    switch (kind >> 5) {
      case 0: {  // raw bytes as a frame with the EtherType of EtherCAT, or as the content of a UDP packet
        std::vector<std::uint8_t> frame(data.begin(), data.end());
        const bool payload = (what & 1) != 0;
        if (!payload && frame.size() >= 14 && (what & 2) != 0) frame[12] = 0x88, frame[13] = 0xA4;
        machine->pass(frame, (what & 4) != 0 ? Segment::Port::secondary : Segment::Port::primary,
                      payload ? Segment::Encapsulation::payload : Segment::Encapsulation::ethernet);
        break;
      }
      case 1:  // cables and time
        machine->segment.set_cable(what & 3, (what & 4) != 0);
        if ((what & 8) != 0) machine->line[what & 1].corrupts_next = true;
        if ((what & 16) != 0) machine->wait(std::chrono::microseconds(100) * length);
        break;
      case 2:
      case 3: {  // a mailbox message: its content is the data
        std::array<std::uint8_t, 128> mail{};
        store_u16(mail.data(),
                  static_cast<unsigned>(std::min<std::size_t>(length, 122) + ((what & 0x80) != 0 ? 9 : 0)));
        mail[5] = what & 0x7F;
        std::copy_n(data.begin(), std::min<std::size_t>(length, 122), mail.begin() + 6);
        machine->send(Command::apwr, address_of(static_cast<std::uint16_t>(0U - kind % 3U), 0x1000), mail);
        std::array<std::uint8_t, 128> empty{};
        if ((kind & 4) != 0) {
          machine->send(Command::aprd, address_of(static_cast<std::uint16_t>(0U - kind % 3U), 0x1100), empty);
        }
        break;
      }
      case 4:  // a logical command
        machine->send(static_cast<Command>(10 + kind % 3), what, data);
        break;
      default:  // any command at a register, mostly of one slave
        machine->send(static_cast<Command>(what >> 5 | (kind & 8)),
                      address_of(static_cast<std::uint16_t>(0U - kind % 3U),
                                 static_cast<std::uint16_t>(offsets[what & 31] + (kind >> 3 & 1))),
                      data);
    }
  }
  machine->counts = false;
  // Reconnects the cables and power-cycles the slaves: the actions of the last master must not block the next one.
  for (std::size_t i = 0; i < 4; ++i) machine->segment.set_cable(i, i < 3);
  for (std::size_t i = 0; i < 3; ++i) {
    Device& device = machine->devices[i];
    machine->line[i].corrupts_next = false;
    if (device.objects.text.length > 300) std::abort();
    if (device.objects.ranged < -9 || device.objects.ranged > 9) std::abort();
    device.sii = sii_image();
    machine->segment.set_powered(i, true, machine->now);
    device.slave.start(machine->now);
  }
  if (!machine->start(8)) std::abort();
  // The mailbox must answer.
  std::array<std::uint8_t, 128> mail{10, 0, 0, 0, 0, 0x03, 0x00, 0x20, 0x40, 0x18, 0x10};
  if (machine->send(Command::apwr, address_of(0, 0x1000), mail) != 1) std::abort();
  if (machine->send(Command::aprd, address_of(0, 0x1100), std::array<std::uint8_t, 128>{}) != 1) std::abort();
  if (machine->answer[8] != 0x4F || machine->answer[12] != 4) std::abort();
  return 0;
}
