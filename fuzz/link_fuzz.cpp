// Takes any bytes as what a client sends over a link: the first byte selects commands to an slcan adapter on a bus, the
// stream of an slcan adapter, elements of socketcand in both directions, frames of SocketCAN, or messages on which the
// rules of a scenario act. The sanitizers detect misuse of memory; the invariants detect a command without an answer,
// an invalid frame, a frame that its own text does not give again, and a link that no longer answers.
#include <array>
#include <linux/can.h>
#include <vector>

#include "frame_count.hpp"
#include "links/can/bus.hpp"
#include "links/can/slcan_protocol.hpp"
#include "links/can/socketcan.hpp"
#include "links/can/socketcand_protocol.hpp"
#include "modbus/crc16.hpp"
#include "modbus/tcp_connection.hpp"
#include "parsers.hpp"
#include "scenario/coe_messages.hpp"
#include "scenario/parse.hpp"
#include "scenario/serial_framing.hpp"

namespace {

using namespace servodrome;
using fuzz::Bytes;
using fuzz::require;
using fuzz::text_of;
namespace slcan = links::slcan;
namespace socketcand = links::socketcand;

fuzz::FrameCount frames("executed_frames");  // commands, elements, frames and messages

void check_frame(const canopen::Frame& frame) {
  require(frame.length <= frame.data.size() && frame.id <= (frame.extended ? 0x1FFFFFFFU : 0x7FFU));
}

// ---- slcan ----

// An adapter on a bus with one other node, as SlcanLink without its port.
class AdapterOnBus final : public links::Receiver, private slcan::Controller {
 public:
  AdapterOnBus() : port_(bus_.attach(*this)), other_(bus_.attach(partner_)) {
    bus_.set_participation(port_, links::Participation::off);
  }

  void receive(char byte) {
    answer_.clear();
    adapter_.receive(byte, answer_);
    if (byte != slcan::end_of_line) {
      require(answer_.empty());
      return;
    }
    ++frames;
    require(answer_.ends_with(slcan::end_of_line) || answer_.ends_with(slcan::bell));
    require(answer_.find_first_of("\r\a") == answer_.size() - 1);
  }
  void run(links::Time span) { bus_.advance(now_ += span); }
  void send_from_bus(const canopen::Frame& frame) { bus_.transmit(other_, frame, now_); }
  const std::string& answer() const { return answer_; }
  void reset() { adapter_.reset(); }

  void on_frame(const canopen::Frame& frame, links::Time at) override {
    std::string text = adapter_.frame_text(frame, at);
    if (text.empty()) return;
    require(text.back() == slcan::end_of_line);
    text.pop_back();
    const auto again = slcan::parse_frame(text);
    require(again.has_value() && again->id == frame.id && again->length == frame.length);
  }

 private:
  struct Partner final : links::Receiver {
    void on_frame(const canopen::Frame& frame, links::Time) override { check_frame(frame); }
  };

  void open(bool listen_only) override {
    using links::Participation;
    bus_.set_participation(port_, listen_only ? Participation::listen_only : Participation::normal);
  }
  void close() override { bus_.set_participation(port_, links::Participation::off); }
  void set_bit_rate(std::uint32_t bit_rate) override { bus_.set_port_bit_rate(port_, bit_rate); }
  bool transmit(const canopen::Frame& frame) override {
    check_frame(frame);
    return bus_.transmit(port_, frame, now_);
  }
  std::uint8_t status_flags() override { return bus_.queue_space(port_) == 0 ? 2 : 0; }

  Partner partner_;
  links::CanBus bus_;
  links::PortId port_;
  links::PortId other_;
  slcan::Adapter adapter_{*this};
  links::Time now_{};
  std::string answer_;
};

// Bytes from 80h on are no text: they let time pass, or the other node sends.
void talk_to_slcan_adapter(Bytes input) {
  AdapterOnBus link;
  while (!input.empty()) {
    const std::uint8_t byte = fuzz::take_byte(input);
    if (byte < 0x80) {
      link.receive(static_cast<char>(byte));
    } else if (byte < 0xC0) {
      link.run(std::chrono::microseconds(50) * (byte & 0x3F));
    } else {
      canopen::Frame frame{.id = byte * 5U, .extended = (byte & 1) != 0, .length = static_cast<std::uint8_t>(byte % 9)};
      frame.data.fill(byte);
      link.send_from_bus(frame);
    }
  }
  link.run(std::chrono::seconds(1));
  link.reset();
  link.receive('\r');  // ends a command that is not complete
  for (const char byte : std::string_view("V\r")) link.receive(byte);
  require(link.answer() == "V1013\r");
}

void read_slcan_stream(Bytes input) {
  std::string_view rest = text_of(input);
  while (!rest.empty()) {
    const std::string_view line = rest.substr(0, rest.find(slcan::end_of_line));
    rest.remove_prefix(std::min(line.size() + 1, rest.size()));
    ++frames;
    const auto frame = slcan::parse_frame(line);
    if (!frame) continue;
    check_frame(*frame);
    require(slcan::parse_frame(slcan::format_frame(*frame)) == frame);
  }
}

// ---- socketcand ----

// The bytes arrive in pieces; the first byte is their size.
template <typename Take>
void read_elements(Bytes input, const Take& take) {
  const std::size_t piece_size = 1U + fuzz::take_byte(input);
  socketcand::ElementReader reader;
  while (!input.empty()) {
    std::string_view piece = text_of(fuzz::take_bytes(input, piece_size));
    while (!piece.empty()) {
      const std::size_t taken = reader.feed(piece);
      require(taken > 0 && taken <= piece.size());
      piece.remove_prefix(taken);
      if (!reader.ready()) continue;
      ++frames;
      require(reader.element().find_first_of("<>") == std::string_view::npos);
      take(socketcand::Words(reader.element()));
    }
  }
  for (std::string_view last = "<echo>"; !last.empty();) last.remove_prefix(reader.feed(last));
  require(reader.ready() && socketcand::Words(reader.element()).is("echo"));
}

// The words of an element that `text` has.
socketcand::Words words_of(socketcand::ElementReader& reader, const std::string& text) {
  require(reader.feed(text) == text.size() && reader.ready());
  return socketcand::Words(reader.element());
}

// Both directions: a frame that was parsed and printed parses to the same frame.
template <typename Parse, typename Format>
void read_socketcand(Bytes input, const Parse& parse, const Format& format) {
  read_elements(input, [&](const socketcand::Words& words) {
    const auto frame = parse(words);
    if (!frame) return;
    check_frame(*frame);
    socketcand::ElementReader reader;
    require(parse(words_of(reader, format(*frame))) == frame);
  });
}

void talk_to_socketcand(Bytes input) { read_socketcand(input, socketcand::parse_send, socketcand::format_send); }

void read_socketcand_stream(Bytes input) {
  const auto format = [](const canopen::Frame& frame) {
    return socketcand::format_frame(frame, std::chrono::milliseconds(1500));
  };
  read_socketcand(input, socketcand::parse_frame, format);
}

// ---- SocketCAN ----

void read_socketcan(Bytes input) {
  while (!input.empty()) {
    can_frame wire{};
    const Bytes bytes = fuzz::take_bytes(input, sizeof wire);
    std::copy(bytes.begin(), bytes.end(), reinterpret_cast<std::uint8_t*>(&wire));
    ++frames;
    canopen::Frame frame;
    if (!links::from_socketcan(wire, frame)) continue;
    check_frame(frame);
    canopen::Frame again;
    require(links::from_socketcan(links::to_socketcan(frame), again) && again == frame);
  }
}

// ---- Rules of a scenario ----

constexpr std::string_view rules_text = R"(
rule = [
  { do = "withhold",  on = { message = "answer" } },
  { do = "delay",     on = { message = "answer" }, ms = 5, jitter_ms = 2 },
  { do = "repeat",    on = { message = "answer" }, copies = 2, byte = 1, xor = 255 },
  { do = "alter",     on = { message = "answer" }, byte = 3, set = 17 },
  { do = "alter",     on = { message = "answer" }, byte = -1, swap = 1499 },
  { do = "alter",     on = { message = "answer" }, bytes = "01 ?? 03", checksum = true },
  { do = "replace",   on = { message = "answer" }, data = "80 40 60" },
  { do = "truncate",  on = { message = "answer" }, length = 4, checksum = true },
  { do = "extend",    on = { message = "answer" }, data = "55 AA", checksum = true },
  { do = "extend",    on = { message = "answer" }, data = "55 AA", before = true, gap_ms = 1 },
  { do = "abort",     on = { message = "answer" }, code = 0x08000022 },
])";

const std::vector<scenario::RuleRun>& rules() {
  static const scenario::ScenarioFile file = scenario::parse_rules(rules_text, "fuzz");
  static const std::vector<scenario::RuleRun> runs = [] {
    require(file.diagnostics.empty());
    std::vector<scenario::RuleRun> made;
    for (const scenario::Rule& rule : file.scenario.rules) made.emplace_back(rule, nullptr, nullptr, made.size());
    return made;
  }();
  return runs;
}

// `choices` has a bit for each rule.
void apply_rules(const scenario::Message& message, const scenario::Framing* framing, unsigned choices) {
  scenario::Packets packets(message, 1, framing);
  for (const scenario::RuleRun& rule : rules()) {
    if ((choices >> rule.number & 1) != 0) packets.apply(rule);
  }
  require(packets.all().size() <= 6);
  for (const scenario::Packet& packet : packets.all()) require(packet.bytes.size() <= message.bytes.size() + 32);
}

void check_refusals(Bytes message, std::uint8_t code) {
  std::vector<std::uint8_t> refusal = scenario::rtu_framing.refusal(message, code);
  scenario::rtu_framing.seal(refusal);
  require(refusal.size() == 5 && modbus::crc16(refusal) == 0);
  refusal = scenario::serial10_framing.refusal(message, code);
  scenario::serial10_framing.seal(refusal);
  require(scenario::is_request(refusal, false, refusal[0]));
  refusal = scenario::tcp_framing.refusal(message, code);
  scenario::tcp_framing.seal(refusal);
  require(refusal.size() == modbus::Mbap::size + 2 && modbus::Mbap::read(refusal.data()).length == 3);
}

void act_on_messages(Bytes input) {
  scenario::CoeMessages coe;
  while (input.size() >= 3) {
    // Record: kind and length, rules, then the message.
    const std::uint8_t head = fuzz::take_byte(input);
    const unsigned choices = fuzz::take_byte(input) | unsigned{head} >> 6 << 8;
    const Bytes bytes = fuzz::take_bytes(input, head & 0x3F);
    ++frames;
    switch (choices % 5) {
      case 0: apply_rules(scenario::serial_message(bytes, true), &scenario::rtu_framing, choices); break;
      case 1: apply_rules(scenario::serial_message(bytes, false), &scenario::serial10_framing, choices); break;
      case 2:
        apply_rules(scenario::tcp_message(bytes, scenario::MessageKind::answer), &scenario::tcp_framing, choices);
        break;
      case 3: {
        const scenario::Message message = coe.incoming(bytes);
        apply_rules(message, nullptr, choices);
        require(scenario::coe_abort(bytes, message.object.value_or(scenario::ObjectAddress{}), 1).size() == 16);
        break;
      }
      default: apply_rules(coe.outgoing(bytes), nullptr, choices);
    }
    scenario::is_request(bytes, (head & 1) != 0, 1);
    check_refusals(bytes, head);
  }
}

constexpr fuzz::Parser parsers[] = {talk_to_slcan_adapter,  read_slcan_stream, talk_to_socketcand,
                                    read_socketcand_stream, read_socketcan,    act_on_messages};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::parse_with(parsers, {data, size});
  return 0;
}
