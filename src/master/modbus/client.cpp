#include "master/modbus/client.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "links/link_error.hpp"
#include "modbus/crc16.hpp"
#include "modbus/rtu_server.hpp"
#include "modbus/tcp_connection.hpp"

namespace servodrome::master {
namespace {

using modbus::Function;
using Bytes = std::vector<std::uint8_t>;

// Calls `action` and converts a link error to MasterError.
template <typename Action>
auto over_link(const std::string& name, const Action& action) {
  try {
    return action();
  } catch (const links::LinkError& error) {
    throw MasterError(error.what(), name, "check that the device or the line is running");
  }
}

void append(Bytes& bytes, std::uint16_t value) {
  bytes.push_back(static_cast<std::uint8_t>(value >> 8));
  bytes.push_back(static_cast<std::uint8_t>(value));
}

// Appends quantity, byte count and data.
void append(Bytes& bytes, std::span<const std::uint16_t> values) {
  append(bytes, static_cast<std::uint16_t>(values.size()));
  bytes.push_back(static_cast<std::uint8_t>(2 * values.size()));
  for (const std::uint16_t value : values) append(bytes, value);
}

// Length of a response frame including CRC, from its first bytes; 0: more bytes are needed.
std::size_t rtu_frame_size(std::span<const std::uint8_t> frame, std::uint8_t request_function) {
  if (frame.size() < 3) return 0;
  if (frame[1] != request_function) return 5;  // an exception, or not an answer to this request
  switch (static_cast<Function>(frame[1])) {
    case Function::write_single_register:
    case Function::write_multiple_registers: return 8;
    case Function::encapsulated_interface_transport: {
      std::size_t size = 8;
      if (frame.size() < size) return 0;
      for (unsigned i = 0; i < frame[7]; ++i) {
        if (frame.size() < size + 2) return 0;
        size += 2U + frame[size + 1];
      }
      return size + 2;
    }
    default: return 5U + frame[2];
  }
}

constexpr Time receive_step = std::chrono::milliseconds(10);

}  // namespace

ModbusClient::ModbusClient(std::unique_ptr<links::ByteClient> client, Framing framing, std::string name,
                           const ModbusOptions& options)
    : client_(std::move(client)), framing_(framing), name_(std::move(name)), options_(options) {}

ModbusClient ModbusClient::open(const std::string& link, const ModbusOptions& options) {
  return over_link(link, [&] {
    const links::SerialLinkName name = links::parse_serial_link(link);
    const Framing framing = std::holds_alternative<links::ModbusTcpName>(name) ? Framing::tcp : Framing::rtu;
    return ModbusClient(links::heard(links::open_byte_client(name, options.format), options.heard), framing, link,
                        options);
  });
}

std::string ModbusClient::where(std::uint8_t unit) const { return fmt::format("{}, unit {}", name_, unit); }

void ModbusClient::malformed(std::uint8_t unit, std::string_view what) const {
  throw ModbusError(ModbusError::Kind::malformed, modbus::Exception::none, std::string(what), where(unit),
                    "check whether another device has the same address");
}

void ModbusClient::discard_received() {
  Bytes late;
  while (client_->receive(late, Time{0})) {
  }
}

Bytes ModbusClient::request(std::uint8_t unit, const Bytes& pdu, unsigned retries) {
  for (unsigned attempt = 0; attempt <= retries; ++attempt) {
    const std::optional<Bytes> response =
        over_link(name_, [&] { return framing_ == Framing::rtu ? exchange_rtu(unit, pdu) : exchange_tcp(unit, pdu); });
    if (!response) continue;
    if (response->empty()) return {};
    if ((*response)[0] == pdu[0]) return *response;
    // The iSMK answers to function 03 with 81h instead of 83h, so any function with the error bit counts as an
    // exception.
    if (((*response)[0] & modbus::error_bit) == 0 || response->size() != 2) {
      malformed(unit, fmt::format("function {:02X}h was answered with {:02X}h", pdu[0], (*response)[0]));
    }
    const auto exception = static_cast<modbus::Exception>((*response)[1]);
    const bool is_of_gateway = exception == modbus::Exception::gateway_path_unavailable ||
                               exception == modbus::Exception::gateway_target_failed_to_respond;
    throw ModbusError(ModbusError::Kind::refused, exception,
                      fmt::format("function {:02X}h was refused: exception {:02X}h, {}", pdu[0], (*response)[1],
                                  modbus::text(exception)),
                      where(unit),
                      is_of_gateway ? "choose a station behind the gateway with --node; `servodrome scan` lists them"
                                    : "check register address, value and the state of the drive");
  }
  throw ModbusError(ModbusError::Kind::no_answer, modbus::Exception::none,
                    fmt::format("no answer to function {:02X}h", pdu[0]), where(unit),
                    "check address, bit rate and parity, and that the drive speaks Modbus on this port");
}

std::optional<Bytes> ModbusClient::exchange_rtu(std::uint8_t unit, const Bytes& pdu) {
  Bytes frame = pdu;
  frame.insert(frame.begin(), unit);
  frame.resize(frame.size() + 2);
  modbus::seal_rtu_frame(frame, frame.size() - 2);
  client_->wait(modbus::standard_timing(options_.format).silence);
  discard_received();
  client_->send(frame);
  const Time sending = options_.format.character_time() * static_cast<std::int64_t>(frame.size());
  if (unit == modbus::broadcast_station) {
    client_->wait(sending + options_.turnaround);
    return Bytes{};
  }
  // Without limit_: on this line an answer names no request, so a late one would be taken for the next one.
  const Time deadline = client_->now() + sending + options_.timeout;
  Bytes answer;
  std::size_t wanted = 0;
  while (wanted == 0 || answer.size() < wanted) {
    const Time left = deadline - client_->now();
    if (left <= Time{0}) return std::nullopt;
    client_->receive(answer, std::min(left, receive_step));
    if (wanted == 0) wanted = rtu_frame_size(answer, pdu[0]);
  }
  answer.resize(wanted);
  if (!modbus::is_rtu_frame(answer)) return std::nullopt;  // a damaged frame counts as a missing answer
  if (answer[0] != unit) malformed(unit, fmt::format("unit {} answered", answer[0]));
  return Bytes(answer.begin() + 1, answer.end() - 2);
}

std::optional<Bytes> ModbusClient::exchange_tcp(std::uint8_t unit, const Bytes& pdu) {
  using modbus::Mbap;
  ++transaction_;
  Bytes frame(Mbap::size);
  Mbap{transaction_, 0, static_cast<std::uint16_t>(pdu.size() + 1), unit}.write(frame.data());
  frame.insert(frame.end(), pdu.begin(), pdu.end());
  discard_received();
  client_->send(frame);
  const Time deadline = client_->now() + limit_.timeout(options_.timeout);
  Bytes answer;
  for (;;) {
    if (answer.size() >= Mbap::size) {
      const Mbap header = Mbap::read(answer.data());
      if (!header.is_valid()) malformed(unit, "the answer is not Modbus TCP");
      const std::size_t size = Mbap::size - 1 + header.length;
      if (answer.size() >= size) {
        if (header.transaction == transaction_) {
          if (header.unit != unit) malformed(unit, fmt::format("unit {} answered", header.unit));
          return Bytes(answer.begin() + Mbap::size, answer.begin() + static_cast<std::ptrdiff_t>(size));
        }
        answer.erase(answer.begin(), answer.begin() + static_cast<std::ptrdiff_t>(size));  // of an earlier request
        continue;
      }
    }
    const Time left = deadline - client_->now();
    if (left <= Time{0}) return std::nullopt;
    client_->receive(answer, std::min(left, receive_step));
  }
}

Bytes ModbusClient::exchange_bytes(std::span<const std::uint8_t> bytes, Time timeout, Time silence) {
  return over_link(name_, [&] {
    client_->wait(modbus::standard_timing(options_.format).silence);
    discard_received();
    client_->send(bytes);
    const Time sending = options_.format.character_time() * static_cast<std::int64_t>(bytes.size());
    const Time deadline = client_->now() + timeout + (framing_ == Framing::rtu ? sending : Time{0});
    Bytes answer;
    Time last = deadline;
    while (client_->now() < last) {
      const std::size_t before = answer.size();
      client_->receive(answer, std::min(last - client_->now(), receive_step));
      if (answer.size() != before)
        last = std::min(deadline + silence, client_->now() + std::min(silence, Time{50'000'000}));
    }
    return answer;
  });
}

std::vector<std::uint16_t> ModbusClient::registers_of(std::uint8_t unit, const Bytes& response,
                                                      std::uint16_t count) const {
  if (response.size() != 2U + 2U * count || response[1] != 2U * count) {
    malformed(unit, fmt::format("the answer has {} bytes instead of {} registers", response.size(), count));
  }
  std::vector<std::uint16_t> registers(count);
  for (std::size_t i = 0; i < count; ++i) registers[i] = modbus::read_u16(&response[2 + 2 * i]);
  return registers;
}

std::vector<std::uint16_t> ModbusClient::read_with(Function function, std::uint8_t unit, std::uint16_t address,
                                                   std::uint16_t count) {
  check_count(unit, count, modbus::most_registers_read);
  Bytes pdu{static_cast<std::uint8_t>(function)};
  append(pdu, address);
  append(pdu, count);
  return registers_of(unit, request(unit, pdu, limit_.retries(options_.retries)), count);
}

std::vector<std::uint16_t> ModbusClient::read_holding_registers(std::uint8_t unit, std::uint16_t address,
                                                                std::uint16_t count) {
  return read_with(Function::read_holding_registers, unit, address, count);
}

std::vector<std::uint16_t> ModbusClient::read_input_registers(std::uint8_t unit, std::uint16_t address,
                                                              std::uint16_t count) {
  return read_with(Function::read_input_registers, unit, address, count);
}

// The answer to a write repeats the first five bytes of the request.
void ModbusClient::check_echo(std::uint8_t unit, const Bytes& pdu, const Bytes& response) const {
  if (response.empty()) return;  // broadcast
  if (response.size() != 5 || !std::equal(response.begin(), response.end(), pdu.begin())) {
    malformed(unit, "the write was confirmed with other registers");
  }
}

void ModbusClient::write_single_register(std::uint8_t unit, std::uint16_t address, std::uint16_t value) {
  Bytes pdu{static_cast<std::uint8_t>(Function::write_single_register)};
  append(pdu, address);
  append(pdu, value);
  check_echo(unit, pdu, request(unit, pdu, 0));
}

void ModbusClient::check_count(std::uint8_t unit, std::size_t count, std::size_t most) const {
  if (count >= 1 && count <= most) return;
  throw MasterError(fmt::format("{} registers in one request", count), where(unit), fmt::format("1 to {} fit", most));
}

void ModbusClient::write_multiple_registers(std::uint8_t unit, std::uint16_t address,
                                            std::span<const std::uint16_t> values) {
  check_count(unit, values.size(), modbus::most_registers_written);
  Bytes pdu{static_cast<std::uint8_t>(Function::write_multiple_registers)};
  append(pdu, address);
  append(pdu, values);
  check_echo(unit, pdu, request(unit, pdu, 0));
}

std::vector<std::uint16_t> ModbusClient::read_write_multiple_registers(std::uint8_t unit, std::uint16_t read_address,
                                                                       std::uint16_t count, std::uint16_t write_address,
                                                                       std::span<const std::uint16_t> values) {
  check_count(unit, count, modbus::most_registers_read);
  check_count(unit, values.size(), modbus::most_registers_written_and_read);
  Bytes pdu{static_cast<std::uint8_t>(Function::read_write_multiple_registers)};
  append(pdu, read_address);
  append(pdu, count);
  append(pdu, write_address);
  append(pdu, values);
  return registers_of(unit, request(unit, pdu, 0), count);
}

std::map<std::uint8_t, std::string> ModbusClient::read_device_identification(std::uint8_t unit) {
  constexpr std::uint8_t extended = 3;
  std::map<std::uint8_t, std::string> objects;
  for (std::uint8_t next = 0;;) {
    const Bytes pdu{static_cast<std::uint8_t>(Function::encapsulated_interface_transport),
                    modbus::read_device_identification, extended, next};
    const Bytes response = request(unit, pdu, limit_.retries(options_.retries));
    if (response.size() < 7) malformed(unit, "the identification is cut off");
    std::size_t at = 7;
    for (unsigned i = 0; i < response[6]; ++i) {
      if (at + 2 > response.size() || at + 2 + response[at + 1] > response.size()) {
        malformed(unit, "the identification is cut off");
      }
      const auto text = response.begin() + static_cast<std::ptrdiff_t>(at) + 2;
      objects[response[at]] = std::string(text, text + response[at + 1]);
      at += 2U + response[at + 1];
    }
    const bool more_follows = response[4] != 0;
    if (!more_follows) return objects;
    if (response[5] <= next) malformed(unit, "the identification does not end");
    next = response[5];
  }
}

std::uint64_t ModbusClient::number_of(const std::vector<std::uint16_t>& registers) const {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < registers.size(); ++i) {
    const bool high_first = options_.word_order == modbus::WordOrder::high_word_first;
    value = value << 16 | registers[high_first ? i : registers.size() - 1 - i];
  }
  return value;
}

void ModbusClient::write_number(std::uint8_t unit, std::uint16_t address, std::uint64_t value, std::uint16_t count) {
  std::vector<std::uint16_t> registers(count);
  for (std::size_t i = 0; i < count; ++i) {
    const bool low_first = options_.word_order == modbus::WordOrder::low_word_first;
    registers[low_first ? i : count - 1U - i] = static_cast<std::uint16_t>(value >> 16 * i);
  }
  if (count == 1) {
    write_single_register(unit, address, registers[0]);
  } else {
    write_multiple_registers(unit, address, registers);
  }
}

}  // namespace servodrome::master
