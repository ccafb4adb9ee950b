// Modbus, request by request: functions, exceptions, limits, and requests that must not be answered.
#include <algorithm>

#include "modbus/rtu_server.hpp"
#include "modbus/tcp_connection.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::modbus_group {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

constexpr Time silence = 300ms;

bool is_rtu(Trial& trial) { return trial.subject().modbus().client.framing() == ModbusClient::Framing::rtu; }

Bytes framed(Trial& trial, std::uint8_t unit, const Bytes& pdu) {
  Bytes frame;
  if (is_rtu(trial)) {
    frame = pdu;
    frame.insert(frame.begin(), unit);
    frame.resize(frame.size() + 2);
    modbus::seal_rtu_frame(frame, frame.size() - 2);
    return frame;
  }
  frame.resize(modbus::Mbap::size);
  modbus::Mbap{0x5A5A, 0, static_cast<std::uint16_t>(pdu.size() + 1), unit}.write(frame.data());
  frame.insert(frame.end(), pdu.begin(), pdu.end());
  return frame;
}

std::string text_of_bytes(const Bytes& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) text += fmt::format("{}{:02X}", text.empty() ? "" : " ", byte);
  return text.empty() ? "no answer" : text;
}

// Sends a request and returns the PDU of the answer; empty: no answer.
Bytes ask(Trial& trial, const Bytes& pdu) {
  auto& [client, unit, list] = trial.subject().modbus();
  Bytes answer = client.exchange_bytes(framed(trial, unit, pdu), 1s, silence);
  const std::size_t head = is_rtu(trial) ? 1 : modbus::Mbap::size;
  const std::size_t tail = is_rtu(trial) ? 2 : 0;
  if (answer.size() <= head + tail) return {};
  return {answer.begin() + static_cast<std::ptrdiff_t>(head), answer.end() - static_cast<std::ptrdiff_t>(tail)};
}

void expect_exception(Trial& trial, const Bytes& pdu, const char* what, std::initializer_list<std::uint8_t> codes) {
  const Bytes answer = ask(trial, pdu);
  const auto function = static_cast<std::uint8_t>(pdu[0] | modbus::error_bit);
  const bool right =
      answer.size() == 2 && answer[0] == function && std::find(codes.begin(), codes.end(), answer[1]) != codes.end();
  std::string wanted = fmt::format("{:02X}", function);
  const char* before = " ";
  for (const std::uint8_t code : codes) {
    wanted += fmt::format("{}{:02X}", before, code);
    before = " or ";
  }
  trial.expect(right, fmt::format("{} ({})", text_of_bytes(pdu), what), "exception " + wanted, text_of_bytes(answer));
}

Bytes pdu_of(std::uint8_t function, std::uint16_t address, std::uint16_t value) {
  return {function, static_cast<std::uint8_t>(address >> 8), static_cast<std::uint8_t>(address),
          static_cast<std::uint8_t>(value >> 8), static_cast<std::uint8_t>(value)};
}

// The register of object `index`; skips the check if the drive has none.
std::uint16_t known_register(Trial& trial, std::uint16_t index) {
  for (const modbus::Register& row : trial.subject().modbus().list.registers) {
    if (row.index == index && row.sub == 0) return row.address;
  }
  Trial::skip(fmt::format("{:04X}h has no register", index));
}

// A register that does not exist and has no neighbours.
std::uint16_t absent_register(Trial& trial) {
  for (unsigned address = 0xFFF0; address > 0x100; address -= 0x101) {
    const bool taken = std::any_of(trial.subject().modbus().list.registers.begin(),
                                   trial.subject().modbus().list.registers.end(), [&](const modbus::Register& row) {
                                     return row.address <= address + 8 && row.address + row.words + 8U > address;
                                   });
    if (!taken) return static_cast<std::uint16_t>(address);
  }
  Trial::skip("all registers are taken");
}

void reads(Trial& trial, int) {
  const Bytes sent = pdu_of(0x03, known_register(trial, 0x6041), 1);
  const Bytes answer = ask(trial, sent);
  trial.expect(answer.size() == 4 && answer[0] == 0x03 && answer[1] == 2, text_of_bytes(sent), "03 02 and the register",
               text_of_bytes(answer));
}

void writes(Trial& trial, int) {
  const std::uint16_t address = known_register(trial, 0x6081);
  trial.objects().keep({0x6081, 0});
  // Writes both registers back with their present values.
  const auto values = trial.subject().modbus().client.read_holding_registers(trial.subject().modbus().unit, address, 2);
  Bytes sent = pdu_of(0x10, address, 2);
  sent.push_back(4);
  for (const std::uint16_t value : values) {
    sent.push_back(static_cast<std::uint8_t>(value >> 8));
    sent.push_back(static_cast<std::uint8_t>(value));
  }
  const Bytes answer = ask(trial, sent);
  trial.expect(answer == Bytes(sent.begin(), sent.begin() + 5), text_of_bytes(sent),
               text_of_bytes(Bytes(sent.begin(), sent.begin() + 5)), text_of_bytes(answer));
  const std::uint16_t word = known_register(trial, 0x6060);
  const auto mode =
      trial.subject().modbus().client.read_holding_registers(trial.subject().modbus().unit, word, 1).front();
  const Bytes single = pdu_of(0x06, word, mode);
  const Bytes echo = ask(trial, single);
  trial.expect(echo == single, text_of_bytes(single), "the same again", text_of_bytes(echo));
}

void unknown_function(Trial& trial, int) {
  expect_exception(trial, {0x5A, 0, 0, 0, 1}, "a function that does not exist", {0x01});
  expect_exception(trial, {0x41, 0}, "a function that does not exist", {0x01});
}

// Functions 04 and 2Bh are optional, like 17h: the drive must answer, or refuse with exception 01.
void optional_functions(Trial& trial, int) {
  const std::uint16_t address = known_register(trial, 0x6041);
  const auto look = [&](const Bytes& sent, const char* what) {
    const Bytes answer = ask(trial, sent);
    const bool answered = answer.size() >= 2 && answer[0] == sent[0];
    const bool refused = answer.size() == 2 && answer[0] == (sent[0] | modbus::error_bit) && answer[1] == 0x01;
    trial.expect(answered || refused, fmt::format("{} ({})", text_of_bytes(sent), what),
                 fmt::format("an answer, or exception {:02X} 01", sent[0] | modbus::error_bit), text_of_bytes(answer));
  };
  look(pdu_of(0x04, address, 1), "read input registers");
  look({0x2B, 0x0E, 0x01, 0x00}, "read device identification");
}

void no_address(Trial& trial, int) {
  const std::uint16_t address = absent_register(trial);
  expect_exception(trial, pdu_of(0x03, address, 1), "a register that does not exist", {0x02});
  expect_exception(trial, pdu_of(0x06, address, 0), "a register that does not exist", {0x02});
}

void wrong_count(Trial& trial, int) {
  const std::uint16_t address = known_register(trial, 0x6041);
  expect_exception(trial, pdu_of(0x03, address, 0), "no registers", {0x03});
  expect_exception(trial, pdu_of(0x03, address, 126), "126 registers", {0x03});
  Bytes none = pdu_of(0x10, known_register(trial, 0x6081), 0);
  none.push_back(0);
  expect_exception(trial, none, "no registers to write", {0x03});
  Bytes wrong = pdu_of(0x10, known_register(trial, 0x6081), 2);
  wrong.insert(wrong.end(), {3, 0, 0, 0});
  expect_exception(trial, wrong, "a byte count of 3 for 2 registers", {0x03});
}

// Read/write multiple registers (17h), both for 6081h: by the standard the write comes before the read.
Bytes read_write_pdu(std::uint16_t address, std::uint16_t read, const std::vector<std::uint16_t>& values,
                     std::uint8_t bytes) {
  Bytes sent = pdu_of(0x17, address, read);
  const Bytes written = pdu_of(0, address, static_cast<std::uint16_t>(values.size()));
  sent.insert(sent.end(), written.begin() + 1, written.end());
  sent.push_back(bytes);
  for (const std::uint16_t value : values) {
    sent.push_back(static_cast<std::uint8_t>(value >> 8));
    sent.push_back(static_cast<std::uint8_t>(value));
  }
  return sent;
}

void skip_without_read_write(const Bytes& answer) {
  if (answer == Bytes{0x97, 0x01}) Trial::skip("it has no function 17h, which is optional");
}

void reads_and_writes(Trial& trial, int) {
  auto& [client, unit, list] = trial.subject().modbus();
  const std::uint16_t address = known_register(trial, 0x6081);
  trial.objects().keep({0x6081, 0});
  auto values = client.read_holding_registers(unit, address, 2);
  values[list.word_order == modbus::WordOrder::high_word_first ? 1 : 0] ^= 1U;
  const Bytes sent = read_write_pdu(address, 2, values, 4);
  const Bytes answer = ask(trial, sent);
  skip_without_read_write(answer);
  Bytes wanted{0x17, 4};
  wanted.insert(wanted.end(), sent.end() - 4, sent.end());
  trial.expect(answer == wanted, text_of_bytes(sent), text_of_bytes(wanted) + ", what was written",
               text_of_bytes(answer));
  trial.expect(client.read_holding_registers(unit, address, 2) == values, "function 03 after that", "the same",
               "something else");
}

void read_write_counts(Trial& trial, int) {
  auto& [client, unit, list] = trial.subject().modbus();
  const std::uint16_t address = known_register(trial, 0x6081);
  trial.objects().keep({0x6081, 0});
  const auto values = client.read_holding_registers(unit, address, 2);
  const Bytes none_read = read_write_pdu(address, 0, values, 4);
  skip_without_read_write(ask(trial, none_read));
  expect_exception(trial, none_read, "no registers to read", {0x03});
  expect_exception(trial, read_write_pdu(address, 126, values, 4), "126 registers to read", {0x03});
  expect_exception(trial, read_write_pdu(address, 2, {}, 0), "no registers to write", {0x03});
  expect_exception(trial, read_write_pdu(address, 2, values, 3), "a byte count of 3 for 2 registers", {0x03});
}

void refused_value(Trial& trial, int) {
  const std::uint16_t address = known_register(trial, 0x6060);
  trial.objects().keep({0x6060, 0});
  expect_exception(trial, pdu_of(0x06, address, 100), "a mode that does not exist", {0x03, 0x04});
}

void identification(Trial& trial, int) {
  const Bytes sent{0x2B, 0x0E, 0x01, 0x00};
  const Bytes answer = ask(trial, sent);
  if (answer.size() == 2 && answer[0] == 0xAB) Trial::skip("it has no function 2Bh/0Eh, which is optional");
  trial.require(answer.size() > 7 && answer[0] == 0x2B && answer[1] == 0x0E, text_of_bytes(sent), "an identification",
                text_of_bytes(answer));
  trial.expect(answer[2] == 0x01 && answer[6] >= 3, text_of_bytes(sent),
               "the three basic objects: vendor, product code, revision", text_of_bytes(answer));
  expect_exception(trial, {0x2B, 0x0E, 0x07, 0x00}, "an access type that does not exist", {0x03});
}

void expect_silence(Trial& trial, const Bytes& frame, const char* what) {
  const Bytes answer = trial.subject().modbus().client.exchange_bytes(frame, silence, silence);
  trial.expect(answer.empty(), fmt::format("{} ({})", text_of_bytes(frame), what), "no answer", text_of_bytes(answer));
}

void wrong_crc(Trial& trial, int) {
  if (!is_rtu(trial)) Trial::skip("Modbus TCP has no CRC");
  Bytes frame = framed(trial, trial.subject().modbus().unit, pdu_of(0x03, known_register(trial, 0x6041), 1));
  frame.back() ^= 0x01;
  expect_silence(trial, frame, "its CRC is wrong");
  reads(trial, 0);
}

void other_unit(Trial& trial, int) {
  if (!is_rtu(trial)) Trial::skip("on Modbus TCP a gateway may answer for others");
  const auto other = static_cast<std::uint8_t>(trial.subject().modbus().unit == 247 ? 246 : 247);
  expect_silence(trial, framed(trial, other, pdu_of(0x03, known_register(trial, 0x6041), 1)), "for another station");
}

// Broadcasts a read: a write would change the other stations of the line.
void broadcast(Trial& trial, int) {
  if (!is_rtu(trial)) Trial::skip("Modbus TCP has no broadcast");
  expect_silence(trial, framed(trial, 0, pdu_of(0x03, known_register(trial, 0x6041), 1)), "a broadcast");
}

void transaction(Trial& trial, int) {
  if (is_rtu(trial)) Trial::skip("only Modbus TCP has transaction identifiers");
  const Bytes frame = framed(trial, trial.subject().modbus().unit, pdu_of(0x03, known_register(trial, 0x6041), 1));
  const Bytes answer = trial.subject().modbus().client.exchange_bytes(frame, 1s, silence);
  const bool right =
      answer.size() > 7 && std::equal(answer.begin(), answer.begin() + 4, frame.begin()) && answer[6] == frame[6];
  trial.expect(right, text_of_bytes(frame), "the same transaction, protocol 0 and unit", text_of_bytes(answer));
}

constexpr unsigned mb = buses::modbus;

constexpr std::array rows{
    Check{"modbus.read", "Modbus V1.1b3 6.3", "Function 03 reads registers", Demand::nothing, mb, reads},
    Check{"modbus.write", "Modbus V1.1b3 6.6, 6.12", "Functions 06 and 10h write registers and answer correctly",
          Demand::nothing, mb, writes},
    Check{"modbus.unknown-function", "Modbus V1.1b3 7, exception 01", "An unknown function gives exception 01",
          Demand::nothing, mb, unknown_function},
    Check{"modbus.optional-functions", "Modbus V1.1b3 6.4, 6.21, 7",
          "Optional functions give an answer or exception 01", Demand::nothing, mb, optional_functions},
    Check{"modbus.no-address", "Modbus V1.1b3 7, exception 02", "A missing register gives exception 02",
          Demand::nothing, mb, no_address},
    Check{"modbus.wrong-count", "Modbus V1.1b3 6.3, 6.12, exception 03", "Counts out of range give exception 03",
          Demand::nothing, mb, wrong_count},
    Check{"modbus.read-write", "Modbus V1.1b3 6.17", "Function 17h writes before it reads", Demand::nothing, mb,
          reads_and_writes},
    Check{"modbus.read-write-count", "Modbus V1.1b3 6.17, exception 03",
          "Counts of function 17h out of range give exception 03", Demand::nothing, mb, read_write_counts},
    Check{"modbus.refused-value", "Modbus V1.1b3 7, exceptions 03 and 04", "A value out of range gives an exception",
          Demand::nothing, mb, refused_value},
    Check{"modbus.identification", "Modbus V1.1b3 6.21", "Device identification is answered", Demand::nothing, mb,
          identification},
    Check{"modbus.wrong-crc", "Modbus over Serial Line V1.02 2.5.1.2", "A frame with a wrong CRC is not answered",
          Demand::nothing, mb, wrong_crc},
    Check{"modbus.other-unit", "Modbus over Serial Line V1.02 2.2", "A frame for another station is not answered",
          Demand::nothing, mb, other_unit},
    Check{"modbus.broadcast", "Modbus over Serial Line V1.02 2.1", "A broadcast is not answered", Demand::nothing, mb,
          broadcast},
    Check{"modbus.transaction", "Modbus Messaging on TCP/IP V1.0b 3.1.3",
          "An answer has the transaction identifier of its request", Demand::nothing, mb, transaction},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::modbus_group
