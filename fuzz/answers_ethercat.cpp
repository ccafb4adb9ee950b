// Answers of an EtherCAT segment: frames, registers, the information memory, and the mails of a slave.
#include <algorithm>
#include <deque>

#include "answers.hpp"
#include "ethercat/esc/sii_interface.hpp"
#include "links/ethercat/client.hpp"
#include "links/link_error.hpp"
#include "master/ethercat/process_data.hpp"
#include "master/ethercat/sii_client.hpp"
#include "tools/clone/clone.hpp"
#include "tools/parameters/list.hpp"

namespace servodrome::fuzz {
namespace {

using ethercat::load_u16;
using ethercat::MailboxType;
using ethercat::store_u16;
using links::Time;
namespace reg = ethercat::reg;
using Octets = std::vector<std::uint8_t>;

constexpr std::uint32_t right_value = 0x12345678;
constexpr std::uint16_t station = 0x1001;
constexpr std::uint16_t sync_manager_1 = reg::sync_manager + reg::sync_manager_bytes;

// What happens to the frames and registers. Each comes from three bytes of the input: after this number of further
// frames, kind, argument.
enum class Trick : std::uint8_t { lose, not_counted, counted_twice, foreign, cut_off, invert, set_register, full };

// A segment whose slaves have the same registers. Mails and the information memory are the rest of the input.
class AnswersOnSegment final : public links::EthercatClient {
 public:
  AnswersOnSegment(Bytes& input, MasterClock& clock) : clock_(clock) {
    for (unsigned left = take_byte(input) % 8U; left > 0; --left) {
      const unsigned after = take_byte(input);
      const auto trick = static_cast<Trick>(take_byte(input) % 8U);
      tricks_.push_back({after, trick, take_byte(input)});
    }
  }

  std::array<std::uint8_t, 0x1000> registers{};
  unsigned slaves = 1;
  Bytes content{};  // records of mails, or the information memory

  // From now on there are no tricks, and the slave answers each upload with `right_value`.
  void become_right() {
    tricks_.clear();
    count_ = 0;
    content = {};
    is_right_ = true;
    sent_ = 0;
  }
  bool is_over() const { return content.empty(); }

  void send(std::span<const std::uint8_t> bytes) override {
    // Without this limit a few bytes of the information memory could demand that the master reads all of it.
    constexpr unsigned most_sent = 1200;
    require(bytes.size() <= links::most_ethercat_content && ++sent_ < 2 * most_sent);
    if (sent_ > most_sent) throw links::LinkError(std::make_error_code(std::errc::io_error), "lost");
    std::optional<std::pair<Trick, std::uint8_t>> trick;
    if (!tricks_.empty() && tricks_.front().after-- == 0) {
      trick = {tricks_.front().trick, tricks_.front().argument};
      tricks_.pop_front();
    }
    ++frames;
    Returned& frame = returned_[(first_ + count_) % returned_.size()];
    frame.size = bytes.size();
    std::copy(bytes.begin(), bytes.end(), frame.bytes.begin());
    ethercat::Frame parsed;
    require(ethercat::parse_payload(frame.content(), parsed) == ethercat::FrameKind::ethercat);
    for (ethercat::Datagram& datagram : parsed.datagrams()) pass(datagram);
    if (trick) play(trick->first, trick->second, frame, parsed);
    if (frame.size > 0 && count_ < returned_.size() - 1) ++count_;
  }
  std::size_t receive(std::span<std::uint8_t> into, Time timeout) override {
    if (count_ == 0) {
      clock_.advance(timeout);
      return 0;
    }
    clock_.advance(std::chrono::microseconds(10));
    const Bytes frame = returned_[first_].content();
    first_ = (first_ + 1) % returned_.size();
    --count_;
    const std::size_t size = std::min(into.size(), frame.size());
    std::copy_n(frame.begin(), size, into.begin());
    return size;
  }
  Time now() const override { return clock_.now(); }
  // The computer is slow: polls of a mailbox for seconds are few.
  void wait(Time span) override { clock_.advance(span + std::chrono::milliseconds(200)); }
  std::string name() const override { return "fuzz"; }

 private:
  // A frame that comes back. It takes no memory of its own: an input has hundreds of them.
  struct Returned {
    std::span<std::uint8_t> content() { return std::span(bytes).first(size); }

    std::array<std::uint8_t, links::most_ethercat_content> bytes;
    std::size_t size = 0;
  };

  struct Planned {
    unsigned after;
    Trick trick;
    std::uint8_t argument;
  };

  void play(Trick trick, std::uint8_t argument, Returned& frame, ethercat::Frame& parsed) {
    ethercat::Datagram& first = parsed.datagrams()[0];
    switch (trick) {
      case Trick::lose: frame.size = 0; break;
      case Trick::not_counted: first.set_working_counter(0); break;
      case Trick::counted_twice: first.set_working_counter(first.working_counter() + argument % 8U); break;
      case Trick::foreign: first.header[1] ^= argument; break;  // the index of another frame
      case Trick::cut_off: frame.size = argument % frame.size; break;
      case Trick::invert:
        for (std::uint8_t& byte : frame.content()) byte ^= argument;
        break;
      case Trick::set_register:
        registers[reg::al_status + argument % 8U] = static_cast<std::uint8_t>(argument >> 3);
        break;
      case Trick::full: registers[reg::sync_manager + 5U] = argument; break;
    }
  }

  // ---- Registers ----

  void pass(ethercat::Datagram& datagram) {
    using ethercat::Command;
    const bool is_broadcast = datagram.command == Command::brd || datagram.command == Command::bwr;
    const bool reads =
        datagram.command == Command::brd || datagram.command == Command::aprd || datagram.command == Command::fprd;
    const unsigned counter = is_broadcast ? slaves : 1U;
    const std::uint16_t offset = datagram.offset();
    const bool is_mail =
        reads && registers[sync_manager_1 + 6U] % 2 != 0 && offset == load_u16(&registers[sync_manager_1]);
    if (is_mail) {
      datagram.set_working_counter(give_mail(datagram.content()) ? 1 : 0);
      return;
    }
    if (reads) {
      prepare_registers();
      for (std::size_t i = 0; i < datagram.length; ++i) {
        datagram.data()[i] = offset + i < registers.size() ? registers[offset + i] : std::uint8_t{0};
      }
    } else {
      for (std::size_t i = 0; i < datagram.length && offset + i < registers.size(); ++i) {
        registers[offset + i] = datagram.data()[i];
      }
      written(offset, datagram.content());
    }
    datagram.set_working_counter(counter);
  }

  void prepare_registers() {
    constexpr std::uint8_t mailbox_full = 0x08;
    constexpr std::uint8_t repeated = 0x02;
    registers[sync_manager_1 + 5U] = mail_waits() ? mailbox_full : 0;
    registers[sync_manager_1 + 7U] = registers[sync_manager_1 + 6U] & repeated;
    if (mailbox_was_written_) return;  // the information memory is not in use
    registers[reg::sii_control] = 0x40;
    registers[reg::sii_control + 1U] = 0;
    const std::size_t at = 2U * load_u16(&registers[reg::sii_address]);
    for (std::size_t i = 0; i < 8; ++i) {
      registers[reg::sii_data + i] = at + i < content.size() ? content[at + i] : std::uint8_t{0xFF};
    }
  }

  void written(std::uint16_t offset, Bytes data) {
    if (offset == reg::al_control) {
      registers[reg::al_status] = data[0] & 0x0F;
      registers[reg::al_status_code] = 0;
    }
    const bool is_mail =
        registers[reg::sync_manager + 6U] % 2 != 0 && offset == load_u16(&registers[reg::sync_manager]);
    if (!is_mail || data.size() < ethercat::mailbox_header_size) return;
    mailbox_was_written_ = true;
    request_.assign(data.begin() + ethercat::mailbox_header_size, data.end());
    request_.resize(std::min<std::size_t>(request_.size(), load_u16(data.data())));
    request_.resize(std::max<std::size_t>(request_.size(), 16));
    answers_left_ = 1;
  }

  // ---- Mails ----

  bool mail_waits() const { return answers_left_ > 0 && (is_right_ || !content.empty()); }

  bool give_mail(std::span<std::uint8_t> area) {
    if (!mail_waits() || area.size() < ethercat::mailbox_header_size) return false;
    std::fill(area.begin(), area.end(), std::uint8_t{0});
    --answers_left_;
    MailboxType type = MailboxType::coe;
    const std::size_t room = area.size() - ethercat::mailbox_header_size;
    Octets mail = is_right_ ? right_mail() : made_mail(type, room);
    counter_ = static_cast<std::uint8_t>(counter_ % 7 + 1);
    store_u16(area.data(), static_cast<unsigned>(wrong_length_ != 0 ? wrong_length_ : std::min(mail.size(), room)));
    area[5] = static_cast<std::uint8_t>(static_cast<unsigned>(type) | unsigned{counter_} << 4);
    mail.resize(std::min(mail.size(), room));
    std::copy(mail.begin(), mail.end(), area.begin() + ethercat::mailbox_header_size);
    wrong_length_ = 0;
    return true;
  }

  void append(Octets& mail, std::size_t count) {
    const Bytes taken = take_bytes(content, count);
    mail.insert(mail.end(), taken.begin(), taken.end());
  }

  // Record: kind and length, then data.
  Octets made_mail(MailboxType& type, std::size_t room) {
    const std::uint8_t head = take_byte(content);
    const std::size_t small = head & 0x1F;
    Octets mail;
    switch (head >> 5) {
      case 0: {  // a mail of any content
        const std::uint8_t kind = take_byte(content);
        type = static_cast<MailboxType>(kind & 0x0F);
        if ((kind & 0x10) != 0) wrong_length_ = static_cast<std::uint16_t>(kind << 3);
        answers_left_ = kind >> 6;
        append(mail, small);
        return mail;
      }
      case 1: return sdo_answer(small);
      case 2: return information(small);
      case 3: type = MailboxType::foe; return file_answer(small, room);
      case 4:  // an emergency before the answer
        answers_left_ = 1;
        mail = {0, static_cast<unsigned>(ethercat::CoeService::emergency) << 4};
        append(mail, 8);
        return mail;
      case 5: {  // an abort
        mail = sdo_head(0x80);
        append(mail, 4);
        return mail;
      }
      case 6: {  // the right answer to an upload of objects that say how many parts they have
        mail = sdo_head(0x4F);
        mail.insert(mail.end(), {static_cast<std::uint8_t>(small % 8), 0, 0, 0});
        return mail;
      }
      default: return right_mail();
    }
  }

  // CoE and SDO headers with the object of the request.
  Octets sdo_head(std::uint8_t command) const {
    return {0,           static_cast<unsigned>(ethercat::CoeService::sdo_response) << 4,
            command,     request_[3],
            request_[4], request_[5]};
  }
  Octets right_mail() const {
    Octets mail = sdo_head(0x43);
    for (unsigned shift = 0; shift < 32; shift += 8) mail.push_back(static_cast<std::uint8_t>(right_value >> shift));
    return mail;
  }

  // The answer that the protocol provides, with the content of the input.
  Octets sdo_answer(std::size_t small) {
    const std::uint8_t request = request_[2];
    Octets mail = sdo_head(take_byte(content));
    std::uint8_t& command = mail[2];
    switch (request >> 5) {
      case 0:  // download segment
        command = static_cast<std::uint8_t>(0x20 | (request & 0x10));
        return mail;
      case 1: command = 0x60; break;
      case 2: command = static_cast<std::uint8_t>(0x40 | (command & 0x1F)); break;
      case 3:  // upload segment: data follows the command
        command = static_cast<std::uint8_t>((request & 0x10) | (command & 0x0F));
        mail.resize(3);
        append(mail, small);
        return mail;
      default: break;
    }
    append(mail, std::max<std::size_t>(small, 4));
    return mail;
  }

  Octets information(std::size_t small) {
    const auto opcode = static_cast<std::uint8_t>((request_[2] + 1) & 0x7F);
    const std::uint8_t left = small % 4 == 3 ? std::uint8_t{1} : std::uint8_t{0};
    answers_left_ = left;
    Octets mail{0, static_cast<unsigned>(ethercat::CoeService::sdo_information) << 4, opcode, 0, left, 0};
    append(mail, small);
    return mail;
  }

  Octets file_answer(std::size_t small, std::size_t room) {
    const std::uint8_t request = request_[0];
    const bool writes = request == 2 || request == 3;
    packet_ = request == 1 || request == 2 ? 0 : packet_;
    if (request != 2) ++packet_;
    Octets mail{static_cast<std::uint8_t>(writes ? 4 : 3), 0, 0, 0, 0, 0};
    if (small == 31) mail[0] = take_byte(content);
    if (small == 30) packet_ += take_byte(content);
    ethercat::store_u32(&mail[2], packet_);
    if (small % 2 != 0) {
      mail.resize(room);  // a full packet: more follow
    } else {
      append(mail, small);
    }
    return mail;
  }

  MasterClock& clock_;
  std::deque<Planned> tricks_;
  std::array<Returned, 4> returned_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  unsigned sent_ = 0;
  Octets request_ = Octets(16);  // the last mail of the master
  unsigned answers_left_ = 0;
  std::uint8_t counter_ = 0;
  std::uint16_t wrong_length_ = 0;
  std::uint32_t packet_ = 0;
  bool mailbox_was_written_ = false;
  bool is_right_ = false;
};

template <typename Access>
bool succeeds(const Access& access) {
  try {
    access();
    return true;
  } catch (const master::MasterError& error) {
    require(!error.happened().empty() && !error.where().empty() && !error.remedy().empty());
    return false;
  }
}

struct Segment {
  explicit Segment(Bytes& input) : answers(new AnswersOnSegment(input, clock)) {}

  MasterClock clock;
  AnswersOnSegment* answers;
  master::EthercatMaster master{std::unique_ptr<links::EthercatClient>(answers),
                                {.timeout = std::chrono::milliseconds(1), .retries = 1}};
};

// The first bytes of the input: tricks, mailbox areas, AL state. `access` is called until the input is over.
template <typename Access>
void talk_to_slave(Bytes input, unsigned times, const Access& access) {
  Segment segment(input);
  AnswersOnSegment& answers = *segment.answers;
  const std::uint8_t out = take_byte(input);
  const std::uint8_t in = take_byte(input);
  const std::uint8_t state = take_byte(input);
  const auto length_of = [](std::uint8_t byte) { return static_cast<std::uint16_t>(byte < 64 ? byte : byte * 4); };
  master::FoundSlave found;
  found.station = station;
  found.sii.mailbox = {.out = {0x1000, length_of(out)}, .in = {0x1400, length_of(in)}};
  found.sii.bootstrap = found.sii.mailbox;
  found.sii.protocols = master::mailbox_protocol::coe | master::mailbox_protocol::foe;
  answers.registers[reg::fmmu_count] = 4;
  answers.registers[reg::sync_manager_count] = 4;
  answers.registers[reg::al_status] = state & 0x1F;
  answers.content = input;
  master::EthercatSlave slave(segment.master, found, std::chrono::milliseconds(50));
  const bool opened = succeeds([&] {
    if ((state & 0x80) != 0) return slave.to_bootstrap();
    slave.to_pre_operational();
  });
  for (unsigned n = 0; opened && n < times && !answers.is_over(); ++n) succeeds([&] { access(slave, state); });
  // After any answers the master must understand the next slave.
  answers.become_right();
  segment.clock.advance(std::chrono::seconds(30));
  found.sii.mailbox = {.out = {0x1000, 64}, .in = {0x1400, 64}};
  master::EthercatSlave next(segment.master, found);
  next.to_init();
  require(next.coe().read<std::uint32_t>(0x6064) == right_value);
}

constexpr unsigned most_accesses = 4;

}  // namespace

void scan_segment(Bytes input) {
  Segment segment(input);
  AnswersOnSegment& answers = *segment.answers;
  answers.slaves = take_byte(input) % 3U;
  for (const std::uint16_t place : {reg::station_alias, reg::dl_status, reg::features, reg::al_status}) {
    answers.registers[place] = take_byte(input);
  }
  answers.registers[reg::sii_pdi_access] = answers.registers[reg::station_alias] & 1;
  answers.content = input;
  succeeds([&] {
    const std::vector<master::FoundSlave> found = master::scan_slaves(segment.master);
    require(found.size() <= answers.slaves + 8U);
    for (const master::FoundSlave& slave : found) {
      require(slave.station != 0 && !master::text_of_links(slave).empty());
      require(!master::text_of(slave.status).empty());
      master::bytes_of(slave.sii.rx_pdos);
      master::find_mapped(slave.sii.tx_pdos, {0x6064, 0});
    }
  });
}

void read_memory_of_slave(Bytes input) {
  Segment segment(input);
  const std::uint8_t choice = take_byte(input);
  segment.answers->content = input;
  master::SiiClient sii(segment.master, station);
  succeeds([&] {
    if (choice % 4 == 0) {
      sii.write_alias(choice);
    } else if (choice % 4 == 1) {
      require(sii.read(choice, choice).size() == choice);
    } else {
      const std::vector<std::uint8_t> image = sii.read_all();
      require(image.size() >= 128 && image.size() <= std::size_t{2} * 0x10000 + 8);
      master::parse_sii(image);
    }
  });
}

void access_objects_of_slave(Bytes input) {
  talk_to_slave(input, most_accesses, [](master::EthercatSlave& slave, std::uint8_t choice) {
    master::CoeClient& coe = slave.coe();
    switch (choice >> 5 & 3) {
      case 0: coe.upload({0x2000, 1}); break;
      case 1: coe.upload_complete(0x2000); break;
      case 2: coe.download({0x2000, 1}, std::vector<std::byte>(choice % 4 == 0 ? 700 : choice % 32U)); break;
      default: {
        const master::ProcessData data = master::read_process_data(slave);
        require(data.outputs.size() <= 255 && data.inputs.size() <= 255);
        master::map_pdo(coe, {.index = 0x1600, .entries = {{.object = {0x6040, 0}, .bits = 16}}});
      }
    }
    require(coe.mailbox().emergencies().size() <= 64);
  });
}

void describe_objects_of_slave(Bytes input) {
  talk_to_slave(input, 1, [](master::EthercatSlave& slave, std::uint8_t choice) {
    master::CoeClient& coe = slave.coe();
    switch (choice >> 5 & 3) {
      case 0: coe.list_lengths(); break;
      case 1: {
        const std::vector<std::uint16_t> indices = coe.list(master::ObjectList::all);
        for (std::size_t i = 0; i < std::min<std::size_t>(indices.size(), 4); ++i) {
          coe.describe(indices[i]);
          coe.describe(master::ObjectAddress{indices[i], 1});
        }
        break;
      }
      case 2: {
        const auto progress = [](const char*, std::size_t, std::size_t) {};
        const describe::DeviceFile device = master::objects_of_slave(coe, progress);
        for (const describe::FileEntry& entry : device.entries) require(entry.index >= 0x1000);
        break;
      }
      default: master::ParameterList::of_slave(coe, catalogue::cia402::product.rules);
    }
  });
}

void transfer_file_of_slave(Bytes input) {
  talk_to_slave(input, most_accesses, [](master::EthercatSlave& slave, std::uint8_t choice) {
    std::size_t last = 0;
    const auto progress = [&](std::size_t bytes) {
      require(bytes >= last);
      last = bytes;
    };
    if ((choice & 0x20) != 0) {
      const std::size_t size = choice % 32U * 8U;
      slave.foe().write("firmware", Octets(size), 1, progress);
      require(last == size);
    } else {
      require(slave.foe().read("firmware", 1, progress).size() == last);
    }
  });
}

}  // namespace servodrome::fuzz
