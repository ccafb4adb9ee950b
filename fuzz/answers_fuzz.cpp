// Takes any bytes as the answers of a device to our master: the first byte selects the service. Time is virtual, and
// the master's link is in memory. The sanitizers detect misuse of memory. An access fails only with the error that
// callers expect. The invariants detect a master that does not end, and one that does not understand a right answer at
// the end.
#include <algorithm>
#include <array>

#include "answers.hpp"
#include "axis/fault_report.hpp"
#include "canopen/301/sdo_wire.hpp"
#include "canopen/305/lss_slave.hpp"
#include "canopen/connection_set.hpp"
#include "links/link_error.hpp"
#include "master/canopen/bus.hpp"
#include "master/canopen/lss_master.hpp"
#include "master/canopen/master.hpp"
#include "master/canopen/pdo_set_up.hpp"
#include "master/canopen/scan.hpp"
#include "master/canopen/sdo_client.hpp"
#include "tools/parameters/values.hpp"

namespace {

using namespace servodrome;
using canopen::Frame;
using fuzz::Bytes;
using fuzz::require;
using fuzz::take_byte;
using links::Time;
namespace connection_set = canopen::connection_set;
namespace sdo = canopen::sdo;

constexpr std::uint8_t node = 5;
constexpr std::uint32_t right_value = 0x12345678;

// A bus whose nodes answer with what the input has. Record: kind and a small number, then data.
class AnswersOnCan final : public links::CanClient {
 public:
  AnswersOnCan(Bytes input, fuzz::MasterClock& clock) : input_(input), clock_(clock) {}

  // From now on node 5 answers each upload with `right_value`, and each node without node-ID answers.
  void become_right() {
    is_right_ = true;
    pending_.reset();
  }
  bool is_over() const { return input_.empty(); }

  void send(const Frame& frame) override {
    require(frame.length <= 8 && frame.id <= 0x7FF && !frame.extended);
    require(++sent_ < most_sent);
    last_ = frame;
    const bool begins = frame.id > connection_set::sdo_request && sdo::specifier(frame.data[0]) != 3;
    if (begins && sdo::specifier(frame.data[0]) != 0) object_ = frame;
    if (is_right_) pending_ = right_answer();
  }

  std::optional<Frame> receive(Time timeout) override {
    constexpr std::uint8_t late = 0xFF;  // a frame that has come before the master asks
    if (is_right_) return take_right(timeout);
    if (input_.empty() || (timeout <= Time{0} && input_.front() != late)) {
      clock_.advance(timeout);
      return std::nullopt;
    }
    const std::uint8_t head = take_byte(input_);
    if (head >> 5 == 0) {  // nothing comes
      clock_.advance(timeout);
      return std::nullopt;
    }
    clock_.advance(std::chrono::microseconds(100));
    ++fuzz::frames;
    return made_frame(head);
  }

 private:
  static constexpr unsigned most_sent = 200'000;

  Frame sdo_answer(std::uint8_t command) const {
    Frame frame{.id = connection_set::sdo_response + (last_.id & 0x7F), .length = 8};
    frame.data[0] = command;
    return frame;
  }
  void fill(Frame& frame, std::size_t from) {
    for (std::size_t i = from; i < frame.data.size(); ++i) frame.data[i] = take_byte(input_);
  }
  static void name_object(Frame& frame, const Frame& as) { std::copy_n(&as.data[1], 3, &frame.data[1]); }

  Frame made_frame(std::uint8_t head) {
    const std::uint8_t small = head & 0x1F;
    Frame frame;
    switch (head >> 5) {
      case 1:  // names the object of the transfer
        frame = sdo_answer(take_byte(input_));
        name_object(frame, object_);
        fill(frame, 4);
        return frame;
      case 2:  // any answer
        frame = sdo_answer(take_byte(input_));
        fill(frame, 1);
        return frame;
      case 3: return fitting_answer(small);
      case 4:  // a segment of a block; the bits 0 and 1 of the number: the last one, one is lost
        block_sequence_ = static_cast<std::uint8_t>(block_sequence_ % 127 + 1 + (small >> 1 & 1));
        frame = sdo_answer(static_cast<std::uint8_t>(block_sequence_ | (small & 1) << 7));
        fill(frame, 1);
        return frame;
      case 5:  // LSS
        frame = {.id = canopen::LssSlave::response_can_id, .length = 8};
        frame.data[0] = small < 16 ? last_.data[0] : small < 24 ? std::uint8_t{0x4F} : take_byte(input_);
        if (small % 2 != 0) fill(frame, 1);
        return frame;
      case 6: {  // what nodes send by themselves
        constexpr std::array<std::uint32_t, 8> ids = {0x705, 0x706, 0x085, 0x080, 0x185, 0x605, 0x581, 0x7E5};
        frame = {.id = ids[small & 7], .length = static_cast<std::uint8_t>(take_byte(input_) % 9)};
        fill(frame, 0);
        return frame;
      }
      default: {
        if (head == 0xFE) throw links::LinkError(std::make_error_code(std::errc::io_error), "lost");
        frame.id = take_byte(input_);
        frame.id = frame.id << 8 | take_byte(input_);
        frame.extended = (small & 1) != 0;
        frame.remote = (small & 2) != 0;
        frame.id &= frame.extended ? 0xFFFFU : 0x7FFU;
        frame.length = static_cast<std::uint8_t>(small >> 2) % 9;
        fill(frame, 0);
        return frame;
      }
    }
  }

  // The answer that the protocol provides for the last request; the data comes from the input.
  Frame fitting_answer(std::uint8_t small) {
    const std::uint8_t request = last_.data[0];
    Frame frame = sdo_answer(0);
    switch (sdo::specifier(request)) {
      case sdo::client::initiate_download: frame.data[0] = sdo::server::download_initiated; break;
      case sdo::client::download_segment:
        frame.data[0] = static_cast<std::uint8_t>(sdo::server::segment_downloaded | (request & sdo::toggle_bit));
        return frame;
      case sdo::client::upload_segment:
        frame.data[0] = static_cast<std::uint8_t>((request & sdo::toggle_bit) | (small & 0x0F));
        fill(frame, 1);
        return frame;
      case sdo::client::initiate_upload:
        frame.data[0] = static_cast<std::uint8_t>(0x40 | (small & 0x0F));
        fill(frame, 4);
        break;
      case sdo::client::block_upload:
        block_sequence_ = 0;
        frame.data[0] = static_cast<std::uint8_t>(
            (request & sdo::subcommand_mask) == 0 ? 0xC0 | (small & 0x06) : sdo::server::block_upload_end | small << 2);
        fill(frame, 4);
        break;
      case sdo::client::block_download:
        frame.data[0] = static_cast<std::uint8_t>((request & 1) == 0 ? sdo::server::block_download_initiated
                                                                     : sdo::server::block_download_ended);
        frame.data[4] = static_cast<std::uint8_t>(small + 1);
        break;
      default:  // a segment of a block download, or its end
        frame.data = {sdo::server::block_downloaded, static_cast<std::uint8_t>(request & 0x7F),
                      static_cast<std::uint8_t>(small + 1)};
        return frame;
    }
    name_object(frame, object_);
    return frame;
  }

  std::optional<Frame> right_answer() const {
    if (last_.id == canopen::LssSlave::request_can_id && last_.data[0] == 0x4C) {
      Frame frame{.id = canopen::LssSlave::response_can_id, .length = 8};
      frame.data[0] = 0x50;
      return frame;
    }
    if (last_.id != connection_set::sdo_request + node) return std::nullopt;
    Frame frame = sdo_answer(sdo::server::upload_expedited);
    name_object(frame, last_);
    sdo::put_u32(frame, right_value);
    return frame;
  }
  std::optional<Frame> take_right(Time timeout) {
    if (!pending_) clock_.advance(timeout);
    return std::exchange(pending_, std::nullopt);
  }

  Bytes input_;
  fuzz::MasterClock& clock_;
  Frame last_{};
  Frame object_{};  // the request that began the SDO transfer
  std::uint8_t block_sequence_ = 0;
  unsigned sent_ = 0;
  bool is_right_ = false;
  std::optional<Frame> pending_;
};

// A master on this bus. `talk` is called until the input is over.
struct CanConversation {
  explicit CanConversation(Bytes input)
      : answers(new AnswersOnCan(input, clock)),
        bus(std::unique_ptr<links::CanClient>(answers), "fuzz", &clock),
        client(bus, node, {.timeout = std::chrono::milliseconds(100)}) {}

  template <typename Talk>
  void talk(unsigned times, const Talk& access) {
    for (unsigned n = 0; n < times && !answers->is_over(); ++n) talk_once(access);
  }
  template <typename Talk>
  void talk_once(const Talk& access) {
    try {
      access();
    } catch (const master::MasterError& error) {
      require(!error.happened().empty() && !error.where().empty() && !error.remedy().empty());
    }
  }
  // After any answers the client must understand the next one. Doubts because of late answers end after 10 s; that two
  // devices have answered before, the client reports once.
  void check() {
    answers->become_right();
    clock.advance(std::chrono::seconds(30));
    talk_once([&] { client.read<std::uint32_t>(0x6064); });
    require(client.read<std::uint32_t>(0x6064) == right_value);
    require(master::LssMaster(bus).any_unconfigured());
  }

  fuzz::MasterClock clock;
  AnswersOnCan* answers;
  master::Bus bus;
  master::SdoClient client;
};

constexpr unsigned most_accesses = 8;

void access_objects(Bytes input) {
  const std::uint8_t choice = take_byte(input);
  const std::size_t size = take_byte(input) * (choice >> 6);
  CanConversation conversation(input);
  using master::SdoProtocol;
  const SdoProtocol protocol = (choice & 1) != 0 ? SdoProtocol::block : SdoProtocol::ordinary;
  const std::vector<std::byte> data(size, std::byte{0x5A});
  conversation.talk(most_accesses, [&] {
    if ((choice & 2) != 0) {
      conversation.client.download({0x2000, 1}, data, protocol);
    } else {
      const std::vector<std::byte> value = conversation.client.upload({0x2000, 1}, protocol);
      require(value.size() <= master::SdoTransfer::largest_upload);
    }
  });
  conversation.check();
}

void address_by_lss(Bytes input) {
  const std::uint8_t choice = take_byte(input);
  CanConversation conversation(input);
  master::LssMaster lss(conversation.bus);
  conversation.talk(most_accesses, [&] {
    switch (choice % 7) {
      case 0: {
        const auto found = lss.fastscan();
        require(!found || conversation.bus.sent() > 128);
        break;
      }
      case 1: lss.identify({1, 2, 3, 4}, 5, 6); break;
      case 2: lss.select({1, 2, 3, 4}); break;
      case 3: lss.set_node_id(7); break;
      case 4: lss.set_bit_timing(2); break;
      case 5: lss.inquire_address(); break;
      default: lss.inquire_node_id(); lss.store();
    }
  });
  conversation.check();
}

void find_nodes(Bytes input) {
  CanConversation conversation(input);
  conversation.talk(1, [&] {
    const auto found = master::scan(conversation.bus, {.first = 1, .last = 8, .listen = std::chrono::milliseconds(10)});
    for (const master::FoundNode& one : found) {
      require(one.node_id >= 1 && one.node_id <= 8);
      master::kind_of(one);
    }
  });
  conversation.check();
}

void watch_nodes(Bytes input) {
  constexpr auto timeout = std::chrono::milliseconds(50);
  CanConversation conversation(input);
  master::Master watch(conversation.bus);
  unsigned events = 0;
  watch.on_boot_up([&](std::uint8_t id) { events += id < 128 ? 1 : 0; });
  watch.on_emergency([&](const master::Emergency& emergency) { events += emergency.node_id < 128 ? 1 : 0; });
  conversation.talk(most_accesses, [&] {
    watch.guard(node, timeout);
    watch.wait_for_pdo(0x185, timeout);
    watch.wait_for_state(node, master::NmtState::operational, timeout);
    watch.command_and_wait(master::NmtCommand::reset_node, node, timeout);
  });
  for (unsigned id = 1; id < 128; ++id) {
    const master::NodeHealth& health = watch.health(static_cast<std::uint8_t>(id));
    if (health.state) master::name(*health.state);
    require(!health.emergency || health.emergency->node_id == id);
  }
  conversation.check();
}

// Faults, PDOs and parameters of a drive, through the SDO client.
void read_drive(Bytes input) {
  static const master::ParameterList list =
      master::ParameterList::of_data_sheet(master::ObjectCatalogue::standard(), catalogue::cia402::product.rules);
  const std::uint8_t choice = take_byte(input);
  CanConversation conversation(input);
  conversation.client.limit_wait(std::chrono::milliseconds(10));
  const auto& products = catalogue::all_products();
  const catalogue::Product& product = *products[choice % products.size()];
  conversation.talk(1, [&] {
    if (choice % 3 == 0) {
      const master::FaultReport report = master::read_faults(conversation.client, product);
      for (const auto* faults : {&report.active, &report.warnings, &report.history, &report.log}) {
        for (const master::ReportedFault& fault : *faults) require(!master::text_of(fault, product.name).empty());
      }
      master::text_of_error_register(report.error_register.value_or(0));
    } else if (choice % 3 == 1) {
      const auto pdo = master::read_pdo(conversation.client, (choice & 0x80) != 0, 1, 4);
      require(!pdo || (pdo->mapping.size() <= 255 && pdo->can_id() <= 0x7FF));
    } else {
      const auto read = master::read_parameters(conversation.client, list, node);
      require(read.values.size() + read.absent.size() == list.all().size());
      for (const master::ParameterValue& value : read.values) require(!master::text_of(value).empty());
    }
  });
  conversation.client.limit_wait(std::nullopt);
  conversation.check();
}

constexpr fuzz::Parser parsers[] = {
    access_objects,
    address_by_lss,
    find_nodes,
    watch_nodes,
    read_drive,
    fuzz::ask_modbus_rtu,
    fuzz::ask_modbus_tcp,
    fuzz::ask_serial10,
    fuzz::scan_segment,
    fuzz::read_memory_of_slave,
    fuzz::access_objects_of_slave,
    fuzz::describe_objects_of_slave,
    fuzz::transfer_file_of_slave,
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::parse_with(parsers, {data, size});
  return 0;
}
