// Answers to the Modbus client, over RTU and TCP, and to the client of the 10-byte protocol.
#include <algorithm>

#include "answers.hpp"
#include "links/link_error.hpp"
#include "master/modbus/objects.hpp"
#include "master/modbus/scan.hpp"
#include "master/serial10/objects.hpp"
#include "modbus/rtu_server.hpp"
#include "modbus/tcp_connection.hpp"
#include "modbus/test_device.hpp"

namespace servodrome::fuzz {
namespace {

using links::Time;
using Octets = std::vector<std::uint8_t>;

enum class Protocol { rtu, tcp, serial10 };

constexpr std::uint8_t unit = 1;

// A line whose device answers with what the input has. Record: kind and a small number, then data.
class AnswersOnLine final : public links::ByteClient {
 public:
  AnswersOnLine(Protocol protocol, Bytes input, MasterClock& clock)
      : protocol_(protocol), input_(input), clock_(clock) {}

  // From now on the device answers each request as it should; all its registers are 1234h.
  void become_right() {
    is_right_ = true;
    coming_.clear();
  }
  bool is_over() const { return input_.empty(); }

  void send(std::span<const std::uint8_t> bytes) override {
    require(!bytes.empty() && bytes.size() <= 7 + modbus::longest_pdu);
    request_.assign(bytes.begin(), bytes.end());
    if (is_right_) coming_ = framed(right_answer());
  }

  bool receive(Octets& bytes, Time timeout) override {
    constexpr std::uint8_t late = 0xFF;  // bytes that have come before the master asks
    if (coming_.empty() && !input_.empty() && (timeout > Time{0} || input_.front() == late)) answer();
    if (coming_.empty()) {
      clock_.advance(timeout);
      return false;
    }
    clock_.advance(std::chrono::microseconds(100));
    const std::size_t count = pieces_ != 0 ? std::min<std::size_t>(pieces_, coming_.size()) : coming_.size();
    bytes.insert(bytes.end(), coming_.begin(), coming_.begin() + static_cast<std::ptrdiff_t>(count));
    coming_.erase(coming_.begin(), coming_.begin() + static_cast<std::ptrdiff_t>(count));
    return true;
  }
  Time now() const override { return clock_.now(); }
  void wait(Time span) override { clock_.advance(span); }

 private:
  void answer() {
    const std::uint8_t head = take_byte(input_);
    const std::size_t small = head & 0x1F;
    ++frames;
    pieces_ = 0;
    switch (head >> 5) {
      case 0: return;  // nothing comes for a while
      case 1:          // any bytes
      case 7: {
        if (head == 0xFE) throw links::LinkError(std::make_error_code(std::errc::io_error), "lost");
        const Bytes raw = take_bytes(input_, small);
        coming_.assign(raw.begin(), raw.end());
        return;
      }
      case 2: pieces_ = small; [[fallthrough]];
      case 3: coming_ = framed(filled(right_answer(), 0)); return;  // the right answer with other data
      case 4: {                                                     // a frame of any content
        const Bytes content = take_bytes(input_, small);
        coming_ = framed({content.begin(), content.end()});
        return;
      }
      case 5: {  // the right answer, longer or shorter
        Octets content = filled(right_answer(), small);
        content.resize(small < 16 ? std::min(content.size(), small) : content.size() + small - 16);
        coming_ = framed(content);
        return;
      }
      default: {  // an exception
        const Octets content = right_answer();
        coming_ =
            framed({static_cast<std::uint8_t>(content.front() | modbus::error_bit), static_cast<std::uint8_t>(small)});
      }
    }
  }

  // The bytes from `from` on are replaced by those of the input, as far as it says so.
  Octets filled(Octets content, std::size_t from) {
    const std::size_t first = from + take_byte(input_) % 8U;
    for (std::size_t i = first; i < content.size(); ++i) {
      if (!input_.empty()) content[i] = take_byte(input_);
    }
    return content;
  }

  Octets framed(const Octets& content) const {
    if (protocol_ == Protocol::rtu) {
      Octets frame{request_.empty() ? unit : request_[0]};
      frame.insert(frame.end(), content.begin(), content.end());
      frame.resize(frame.size() + 2);
      modbus::seal_rtu_frame(frame, frame.size() - 2);
      return frame;
    }
    if (protocol_ == Protocol::tcp) {
      Octets frame(modbus::Mbap::size);
      modbus::Mbap header{0, 0, static_cast<std::uint16_t>(content.size() + 1), unit};
      if (request_.size() >= modbus::Mbap::size) header.transaction = modbus::Mbap::read(request_.data()).transaction;
      header.write(frame.data());
      frame.insert(frame.end(), content.begin(), content.end());
      return frame;
    }
    Octets frame = content;
    frame.resize(serial10::frame_bytes - 1);
    unsigned sum = 0;
    for (const std::uint8_t byte : frame) sum += byte;
    frame.push_back(static_cast<std::uint8_t>(0x100U - sum % 0x100U));
    return frame;
  }

  // Without frame and checksum.
  Octets right_answer() const {
    if (protocol_ == Protocol::serial10) return right_object();
    const std::size_t begin = protocol_ == Protocol::rtu ? 1 : modbus::Mbap::size;
    if (request_.size() < begin + 5) return {0};
    const std::uint8_t* pdu = request_.data() + begin;
    switch (static_cast<modbus::Function>(pdu[0])) {
      case modbus::Function::write_single_register:
      case modbus::Function::write_multiple_registers: return {pdu, pdu + 5};
      case modbus::Function::encapsulated_interface_transport:
        return {pdu[0], pdu[1], pdu[2], 0x83, 0, 0, 2, 0, 2, 'a', 'b', 1, 1, 'c'};
      default: {
        const auto count = static_cast<std::size_t>(pdu[4]);
        Octets content{pdu[0], static_cast<std::uint8_t>(2 * count)};
        for (std::size_t i = 0; i < count; ++i) content.insert(content.end(), {0x12, 0x34});
        return content;
      }
    }
  }
  Octets right_object() const {
    Octets content(request_.begin(), request_.end());
    content.resize(serial10::frame_bytes - 1);
    const bool reads = content[1] == static_cast<std::uint8_t>(serial10::Command::read);
    content[1] = static_cast<std::uint8_t>(reads ? serial10::Command::read_2 : serial10::Command::written);
    if (reads) std::copy_n(std::array<std::uint8_t, 4>{0x34, 0x12, 0, 0}.begin(), 4, content.begin() + 5);
    return content;
  }

  Protocol protocol_;
  Bytes input_;
  MasterClock& clock_;
  Octets request_;
  Octets coming_;
  std::size_t pieces_ = 0;  // bytes that come at once; 0: all
  bool is_right_ = false;
};

template <typename Access>
void talk(const AnswersOnLine& answers, const Access& access) {
  constexpr unsigned most_accesses = 8;
  for (unsigned n = 0; n < most_accesses && !answers.is_over(); ++n) {
    try {
      access();
    } catch (const master::MasterError& error) {
      require(!error.happened().empty() && !error.where().empty() && !error.remedy().empty());
    }
  }
}

constexpr master::RegisterList registers{modbus::test::test_map, modbus::test::test_table};

void access_registers(master::ModbusClient& client, std::uint8_t choice) {
  const std::uint16_t count = 1U + (choice >> 3);
  const std::array<std::uint16_t, 3> values{1, 2, 3};
  master::ModbusObjects objects(client, unit, registers);
  switch (choice & 7) {
    case 0: require(client.read_holding_registers(unit, 0x100, count).size() == count); break;
    case 1: require(client.read_input_registers(unit, 0x100, count).size() == count); break;
    case 2: client.write_multiple_registers(unit, 0x100, values); break;
    case 3: require(client.read_write_multiple_registers(unit, 0, count, 4, values).size() == count); break;
    case 4: {
      for (const auto& [number, text] : client.read_device_identification(unit)) require(text.size() <= 255);
      break;
    }
    case 5: {
      const std::array<master::ObjectAddress, 2> both{{{0x2002, 0}, {0x2003, 0}}};
      const auto read = objects.upload_together(both);
      require(read.size() == 2 && read[0].size() == 4 && read[1].size() == 8);
      objects.write<std::int32_t>(0x2002, 0, -5);
      break;
    }
    case 6: require(scan_stations(client, 1, 3).size() <= 3); break;
    default: {
      const std::array<std::uint8_t, 4> raw{unit, 3, 0, 0};
      const auto silence = std::chrono::milliseconds(20);
      client.exchange_bytes(raw, std::chrono::milliseconds(100), silence);
    }
  }
}

void ask_modbus(Bytes input, Protocol protocol) {
  using Client = master::ModbusClient;
  const std::uint8_t choice = take_byte(input);
  MasterClock clock;
  auto line = std::make_unique<AnswersOnLine>(protocol, input, clock);
  AnswersOnLine& answers = *line;
  const Client::Framing framing = protocol == Protocol::rtu ? Client::Framing::rtu : Client::Framing::tcp;
  Client client(std::move(line), framing, "fuzz", {.timeout = std::chrono::milliseconds(100)});
  talk(answers, [&] { access_registers(client, choice); });
  answers.become_right();
  clock.advance(std::chrono::seconds(30));
  require(client.read<std::uint32_t>(unit, 0) == 0x12341234);
}

}  // namespace

void ask_modbus_rtu(Bytes input) { ask_modbus(input, Protocol::rtu); }
void ask_modbus_tcp(Bytes input) { ask_modbus(input, Protocol::tcp); }

void ask_serial10(Bytes input) {
  const std::uint8_t choice = take_byte(input);
  MasterClock clock;
  auto line = std::make_unique<AnswersOnLine>(Protocol::serial10, input, clock);
  AnswersOnLine& answers = *line;
  master::Serial10Client client(std::move(line), "fuzz");
  master::Serial10Objects objects(client, (choice & 1) != 0 ? serial10::universal_id : unit);
  talk(answers, [&] {
    if ((choice & 2) != 0) {
      objects.write<std::int16_t>(0x6040, 0, 15);
      return;
    }
    const std::size_t size = objects.upload({0x6064, 0}).size();
    require(size == 1 || size == 2 || size == 4);
  });
  answers.become_right();
  clock.advance(std::chrono::seconds(30));
  require(objects.read<std::uint16_t>(0x6041) == 0x1234);
}

}  // namespace servodrome::fuzz
