// Sends random and mutated EtherCAT frames to a segment of complete drives on their plants, in each state of the
// EtherCAT state machine. Not guided by coverage: a fixed pseudo-random sequence, so that the same seed repeats a
// failure. Run it in a build with sanitizers:
//
//   ethercat_frames COUNT [SEED]
//
// COUNT frames are divided between the four states. Most frames are nearly valid: all commands at registers that exist,
// process data, mailbox messages, then with overwritten bytes, changed lengths or cut ends. Some are of other
// protocols, tagged, or the content of UDP packets. After every 10,000 frames a second master starts, which does not
// know the state that the first one left: it must find all slaves, bring them to the state again and get an answer from
// the mailbox of each. Exit status 1 if it cannot.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>

#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/slave/slave.hpp"
#include "line/line.hpp"
#include "line/line_file.hpp"

namespace {

using namespace servodrome;
using namespace std::chrono_literals;
using ethercat::address_of;
using ethercat::AlState;
using ethercat::Command;
namespace reg = ethercat::reg;

constexpr std::size_t slaves = 3;
constexpr std::uint16_t mailbox_size = 128;

constexpr const char* line_text = R"(
clock = "virtual"
[[bus]]
name = "ecat"
type = "ethercat"
[[axis]]
name = "a"
product = "generic402-ec"
[[axis]]
name = "b"
product = "generic402-ec"
oscillator_ppm = -40
[[axis]]
name = "c"
product = "generic402-ec"
cable_ns = 900
)";

class Target {
 public:
  Target() {
    for (const auto& axis : line_.axes()) {
      const auto memory = axis->device().ethercat_controller()->sii().memory();
      images_.emplace_back(memory.begin(), memory.end());
    }
  }

  // Passes the frame through the segment, which changes it in place. False: the frame is lost.
  bool pass(std::span<std::uint8_t> frame, links::EthercatBus::Encapsulation encapsulation) {
    now_ += 25us;
    line_.run_until(now_);
    return bus_.exchange(frame, now_, links::EthercatBus::Port::primary, encapsulation).exit !=
           links::EthercatBus::Exit::lost;
  }
  void wait(links::Time span) { line_.run_until(now_ += span); }

  // Sends one datagram of a correct master; returns its working counter.
  unsigned send(Command command, std::uint32_t address, std::span<const std::uint8_t> data) {
    auto writer = ethercat::FrameWriter::ethernet(memory_);
    const auto place = writer.add(command, 0, address, data.size());
    std::copy(data.begin(), data.end(), place.begin());
    if (!pass(writer.bytes(), links::EthercatBus::Encapsulation::ethernet)) return 0;
    answer_.assign(place.begin(), place.end());
    return ethercat::load_u16(place.data() + place.size());
  }
  unsigned broadcast(std::uint16_t offset, std::initializer_list<std::uint8_t> data) {
    return send(Command::bwr, address_of(0, offset), std::vector<std::uint8_t>(data));
  }
  // Sets a sync manager to a process image of the slave's present length, at its place in the memory.
  void channel(std::uint16_t slave, unsigned number, std::uint16_t start, std::uint16_t length, std::uint8_t control) {
    const std::uint8_t low = static_cast<std::uint8_t>(length);
    const std::uint8_t high = static_cast<std::uint8_t>(length >> 8);
    const std::array<std::uint8_t, 8> settings{
        static_cast<std::uint8_t>(start), static_cast<std::uint8_t>(start >> 8), low, high, control, 0, 1, 0};
    send(Command::apwr, address_of(slave, static_cast<std::uint16_t>(reg::sync_manager + 8 * number)), settings);
  }

  // Starts like a master that does not know the previous state: removes the write protection, opens the ports, resets
  // the controllers and brings all slaves up. Returns nullptr on success. Two states survive such a start, as on real
  // slaves. A slave that was commanded to keep its port 0 closed permanently while its port 1 is open is not reachable
  // until a power cycle. Data that were written into the SII stay there; the bench restores them, as the maker's tool
  // would.
  const char* start(AlState state) {
    for (const auto& axis : line_.axes()) {
      ethercat::Esc& esc = *axis->device().ethercat_controller();
      const std::vector<std::uint8_t>& image = images_[axis->position() - 1];
      if (!std::equal(image.begin(), image.end(), esc.sii().memory().begin())) {
        std::copy(image.begin(), image.end(), esc.sii().memory().begin());
        ++repairs_;
      }
      if ((esc.registers(reg::dl_control)[1] & 3) != 3 || !esc.loop_closed(0)) continue;
      axis->power_off(now_);
      axis->power_on(now_);
      ++power_cycles_;
    }
    for (std::size_t i = 0; i < slaves; ++i) {
      auto writer = ethercat::FrameWriter::ethernet(memory_);
      // First the key of the whole memory: without it, the slave also refuses the key of the registers.
      for (const std::uint16_t lock : std::to_array<std::uint16_t>({0x0030, 0x0020, 0x0021, 0x0031})) {
        writer.add(Command::bwr, 0, address_of(0, lock), 1);
      }
      writer.add(Command::bwr, 0, address_of(0, reg::dl_control), 4)[0] = 0x01;
      pass(writer.bytes(), links::EthercatBus::Encapsulation::ethernet);
    }
    for (const std::uint8_t letter : std::to_array<std::uint8_t>({'R', 'E', 'S'})) broadcast(reg::reset_ecat, {letter});
    wait(1ms);
    if (broadcast(reg::al_control, {0x11, 0}) != slaves) return "not all slaves answer";
    wait(1ms);
    for (const auto& axis : line_.axes()) map_as_from_the_factory(axis->device().dictionary());
    for (std::uint16_t i = 0; i < slaves; ++i) {
      const auto slave = static_cast<std::uint16_t>(0U - i);
      channel(slave, 0, 0x1000, mailbox_size, 0x26);
      channel(slave, 1, 0x1100, mailbox_size, 0x22);
      channel(slave, 2, 0x1200, 14, 0x64);
      channel(slave, 3, 0x1500, 14, 0x20);
    }
    for (const AlState step : {AlState::pre_operational, AlState::safe_operational, AlState::operational}) {
      if (step > state) break;
      if (step == AlState::operational) broadcast(0x1200, {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
      broadcast(reg::al_control, {static_cast<std::uint8_t>(step), 0});
      wait(1ms);
      if (step == AlState::operational) broadcast(0x1200, {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
    }
    for (const auto& axis : line_.axes()) {
      if (axis->device().ethercat_slave()->state() != state) return "a slave does not reach the state";
    }
    return state == AlState::init ? nullptr : ask_mailboxes();
  }

  line::Line& line() { return line_; }
  unsigned power_cycles() const { return power_cycles_; }
  unsigned repairs() const { return repairs_; }

 private:
  // Writes the factory mapping, like a master that does not read the PDO assignment of the previous master.
  static void map_as_from_the_factory(dictionary::Dictionary& objects) {
    for (const dictionary::Entry& entry : objects.table()) {
      std::byte* place = entry.index < 0x1600 || entry.index > 0x1C33 ? nullptr : objects.storage(entry);
      if (place == nullptr || !entry.writable()) continue;
      const auto bytes = dictionary::encode_number(entry.default_value);
      std::memcpy(place, bytes.data(), dictionary::size_of(entry.type));
    }
  }
  const char* ask_mailboxes() {
    for (std::uint16_t i = 0; i < slaves; ++i) {
      const auto slave = static_cast<std::uint16_t>(0U - i);
      std::array<std::uint8_t, mailbox_size> mail{10, 0, 0, 0, 0, 0x03, 0x00, 0x20, 0x40, 0x18, 0x10};
      if (send(Command::apwr, address_of(slave, 0x1000), mail) != 1) return "a mailbox does not take a request";
      if (send(Command::aprd, address_of(slave, 0x1100), std::array<std::uint8_t, mailbox_size>{}) != 1) {
        return "a mailbox has no answer";
      }
      if (answer_[8] != 0x4F || answer_[12] != 4) return "a mailbox has a wrong answer";
    }
    return nullptr;
  }

  line::Line line_{line::parse_line_file(line_text, "fuzz", line::all_products()).settings};
  links::EthercatBus& bus_ = line_.ethercat_buses().front()->bus;
  links::Time now_{};
  unsigned power_cycles_ = 0;
  unsigned repairs_ = 0;
  std::vector<std::vector<std::uint8_t>> images_;  // of the SII, as delivered
  std::array<std::uint8_t, ethercat::max_frame> memory_{};
  std::vector<std::uint8_t> answer_;
};

class FrameMaker {
 public:
  FrameMaker(std::uint64_t seed, std::span<const dictionary::Entry> table) : random_(seed), table_(table) {}

  std::uint64_t pick(std::uint64_t n) { return random_() % n; }

  // Sets `encapsulation` to the form of the frame.
  std::span<std::uint8_t> next(links::EthercatBus::Encapsulation& encapsulation) {
    const bool payload = pick(8) == 0;
    encapsulation = payload ? links::EthercatBus::Encapsulation::payload : links::EthercatBus::Encapsulation::ethernet;
    auto writer = payload ? ethercat::FrameWriter::payload(memory_) : ethercat::FrameWriter::ethernet(memory_);
    for (std::uint64_t n = 1 + pick(4); n > 0; --n) add_datagram(writer);
    std::size_t size = writer.bytes().size();
    const std::span<std::uint8_t> whole(memory_);
    if (pick(3) == 0) {  // overwritten bytes
      for (std::uint64_t n = 1 + pick(3); n > 0; --n) whole[pick(size)] = static_cast<std::uint8_t>(random_());
    }
    if (pick(16) == 0) size = pick(size + 1);
    if (pick(16) == 0 && size + 40 < whole.size()) size += pick(40);  // padding
    if (!payload && size >= 18 && pick(16) == 0) {                    // a VLAN tag
      std::copy_backward(whole.begin() + 12, whole.begin() + static_cast<std::ptrdiff_t>(size),
                         whole.begin() + static_cast<std::ptrdiff_t>(std::min(size + 4, whole.size())));
      whole[12] = 0x81, whole[13] = 0x00;
      size = std::min(size + 4, whole.size());
    }
    return whole.first(size);
  }

 private:
  void add_datagram(ethercat::FrameWriter& writer) {
    static constexpr std::array<std::uint16_t, 28> offsets{
        0x0000, 0x0010, 0x0020, 0x0030, 0x0040, 0x0100, 0x0110, 0x0120, 0x0130, 0x0200, 0x0220, 0x0300, 0x0310, 0x0400,
        0x0420, 0x0500, 0x0502, 0x0600, 0x0610, 0x0800, 0x0810, 0x0818, 0x0900, 0x0910, 0x0920, 0x0930, 0x0980, 0x0990};
    const std::uint64_t kind = pick(16);
    if (kind < 4) {
      add_mail(writer);
    } else if (kind < 7) {  // process data, by position or by logical address
      const std::size_t length = pick(4) == 0 ? pick(40) : 14;
      const bool logical = pick(2) == 0;
      fill(writer.add(static_cast<Command>(logical ? 10 + pick(3) : 1 + pick(12)), 0,
                      logical ? static_cast<std::uint32_t>(pick(64)) : address_of(slave(), pick(2) ? 0x1200 : 0x1500),
                      length));
    } else if (kind == 7) {  // a state request
      const auto place = writer.add(pick(2) ? Command::bwr : Command::apwr, 0, address_of(slave(), reg::al_control), 2);
      static constexpr std::array<std::uint8_t, 8> states{0x01, 0x02, 0x03, 0x04, 0x08, 0x11, 0x12, 0x08};
      if (!place.empty()) place[0] = states[pick(states.size())];
    } else {
      const auto offset = static_cast<std::uint16_t>(offsets[pick(offsets.size())] + (pick(8) == 0 ? pick(16) : 0));
      const std::uint64_t bytes = pick(8) == 0 ? pick(200) : 1 + pick(16);
      fill(writer.add(static_cast<Command>(pick(16)), static_cast<std::uint8_t>(pick(256)), address_of(slave(), offset),
                      bytes));
    }
  }
  // An SDO or a segment of one, SDO information, a file, or an unknown message.
  void add_mail(ethercat::FrameWriter& writer) {
    if (pick(3) == 0) {
      writer.add(Command::aprd, 0, address_of(slave(), 0x1100), mailbox_size);
      return;
    }
    const auto mail = writer.add(Command::apwr, 0, address_of(slave(), 0x1000), mailbox_size);
    if (mail.empty()) return;
    const dictionary::Entry& entry = table_[pick(table_.size())];
    static constexpr std::array<std::uint8_t, 12> specifiers{0x40, 0x23, 0x27, 0x2B, 0x2F, 0x21,
                                                             0x50, 0x31, 0x60, 0x70, 0x00, 0x80};
    fill(mail);
    mail[0] = static_cast<std::uint8_t>(pick(8) == 0 ? pick(256) : 10), mail[1] = 0;
    mail[5] = static_cast<std::uint8_t>((pick(8) == 0 ? pick(16) : 3) | pick(8) << 4);
    mail[6] = 0, mail[7] = static_cast<std::uint8_t>((pick(4) == 0 ? pick(16) : 2) << 4);
    mail[8] = specifiers[pick(specifiers.size())];
    mail[9] = static_cast<std::uint8_t>(entry.index), mail[10] = static_cast<std::uint8_t>(entry.index >> 8);
    mail[11] = entry.sub;
    if (mail[7] == 0x80) mail[8] = static_cast<std::uint8_t>(1 + pick(7)), mail[9] = 0;  // SDO information
  }
  void fill(std::span<std::uint8_t> place) {
    for (std::uint8_t& byte : place) byte = static_cast<std::uint8_t>(pick(3) == 0 ? random_() : 0);
  }
  std::uint16_t slave() { return static_cast<std::uint16_t>(pick(16) == 0 ? random_() : 0U - pick(slaves)); }

  std::mt19937_64 random_;
  std::span<const dictionary::Entry> table_;
  std::array<std::uint8_t, ethercat::max_frame> memory_{};
};

bool fuzz(AlState state, std::uint64_t count, std::uint64_t seed) {
  constexpr std::uint64_t between = 10'000;
  Target target;
  FrameMaker maker(seed, target.line().axes().front()->device().dictionary().table());
  std::uint64_t returned = 0;
  for (std::uint64_t i = 0; i <= count; ++i) {
    if (i % between == 0) {
      if (const char* problem = target.start(state)) {
        std::fprintf(stderr, "%s, before frame %llu of seed %llu: %s\n", text(state),
                     static_cast<unsigned long long>(i), static_cast<unsigned long long>(seed), problem);
        return false;
      }
    }
    links::EthercatBus::Encapsulation encapsulation{};
    const auto frame = maker.next(encapsulation);
    if (target.pass(frame, encapsulation)) ++returned;
    if (maker.pick(64) == 0) target.wait(std::chrono::microseconds(maker.pick(2000)));
  }
  std::printf(
      "%s: %llu frames, %llu of them came back; the next master always finds its slaves (port 0 closed %u times, SII "
      "overwritten %u times)\n",
      text(state), static_cast<unsigned long long>(count), static_cast<unsigned long long>(returned),
      target.power_cycles(), target.repairs());
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: ethercat_frames COUNT [SEED]\n");
    return 2;
  }
  const std::uint64_t count = std::strtoull(argv[1], nullptr, 10);
  std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  for (const AlState state :
       {AlState::init, AlState::pre_operational, AlState::safe_operational, AlState::operational}) {
    if (!fuzz(state, count / 4, seed++)) return 1;
  }
  return 0;
}
