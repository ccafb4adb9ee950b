#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "links/heard_clients.hpp"
#include "master/modbus/error.hpp"
#include "master/wait_limit.hpp"
#include "modbus/profile.hpp"

namespace servodrome::master {

using links::Time;

struct ModbusOptions {
  modbus::CharacterFormat format{};                                   // of a serial line
  modbus::WordOrder word_order = modbus::WordOrder::high_word_first;  // for numbers in several registers
  Time timeout = std::chrono::seconds(1);                             // for an answer
  unsigned retries = 1;                                               // of reads only; a write without answer may have
                                                                      // taken effect
  Time turnaround = std::chrono::milliseconds(100);                   // after a broadcast
  links::Heard heard{};                                               // observer of sent and received bytes
};

// A Modbus master, RTU on a serial line or TCP. One request at a time. All calls throw ModbusError, or MasterError if
// the link cannot be opened or is lost.
class ModbusClient {
 public:
  enum class Framing { rtu, tcp };

  // `name` appears in error messages.
  ModbusClient(std::unique_ptr<links::ByteClient> client, Framing framing, std::string name,
               const ModbusOptions& options = {});
  // `pty:PATH` and `serial:DEVICE` use RTU, `tcp:HOST:PORT` uses TCP.
  static ModbusClient open(const std::string& link, const ModbusOptions& options = {});

  // `unit`: station or unit identifier; on a serial line 0 is a broadcast, for writes only. One request reads at most
  // 125 registers and writes at most 123 (121 if it also reads).
  std::vector<std::uint16_t> read_holding_registers(std::uint8_t unit, std::uint16_t address, std::uint16_t count);
  std::vector<std::uint16_t> read_input_registers(std::uint8_t unit, std::uint16_t address, std::uint16_t count);
  void write_single_register(std::uint8_t unit, std::uint16_t address, std::uint16_t value);
  void write_multiple_registers(std::uint8_t unit, std::uint16_t address, std::span<const std::uint16_t> values);
  std::vector<std::uint16_t> read_write_multiple_registers(std::uint8_t unit, std::uint16_t read_address,
                                                           std::uint16_t count, std::uint16_t write_address,
                                                           std::span<const std::uint16_t> values);
  // Reads all identification objects of the device.
  std::map<std::uint8_t, std::string> read_device_identification(std::uint8_t unit);

  // Integers, in the word order of the options. An 8-bit number occupies one register.
  template <typename T>
  requires std::is_integral_v<T> T read(std::uint8_t unit, std::uint16_t address) {
    return static_cast<T>(number_of(read_holding_registers(unit, address, words<T>)));
  }
  template <typename T>
  requires std::is_integral_v<T>
  void write(std::uint8_t unit, std::uint16_t address, std::type_identity_t<T> value) {
    write_number(unit, address, static_cast<std::uint64_t>(static_cast<std::int64_t>(value)), words<T>);
  }

  // Sends raw bytes and returns the received bytes, for tests of a device. Ends after `timeout` without a byte, or when
  // no further byte has arrived for `silence` (at most 50 ms), and at the latest `silence` after `timeout`.
  std::vector<std::uint8_t> exchange_bytes(std::span<const std::uint8_t> bytes, Time timeout, Time silence);
  Framing framing() const { return framing_; }

  const std::string& name() const { return name_; }
  // Time on the link's clock.
  Time now() const { return client_->now(); }
  void wait(Time span) { client_->wait(span); }
  // As ObjectClient::limit_wait(), for all units; with RTU only without retries.
  void limit_wait(std::optional<Time> longest) { limit_.set(longest); }

 private:
  using Bytes = std::vector<std::uint8_t>;
  template <typename T>
  static constexpr std::uint16_t words = (sizeof(T) + 1) / 2;

  // Returns the response PDU; empty for a broadcast.
  Bytes request(std::uint8_t unit, const Bytes& pdu, unsigned retries);
  std::optional<Bytes> exchange_rtu(std::uint8_t unit, const Bytes& pdu);
  std::optional<Bytes> exchange_tcp(std::uint8_t unit, const Bytes& pdu);
  std::vector<std::uint16_t> read_with(modbus::Function function, std::uint8_t unit, std::uint16_t address,
                                       std::uint16_t count);
  std::vector<std::uint16_t> registers_of(std::uint8_t unit, const Bytes& response, std::uint16_t count) const;
  std::uint64_t number_of(const std::vector<std::uint16_t>& registers) const;
  void write_number(std::uint8_t unit, std::uint16_t address, std::uint64_t value, std::uint16_t count);
  void check_count(std::uint8_t unit, std::size_t count, std::size_t most) const;
  void check_echo(std::uint8_t unit, const Bytes& pdu, const Bytes& response) const;
  void discard_received();
  [[noreturn]] void malformed(std::uint8_t unit, std::string_view what) const;
  std::string where(std::uint8_t unit) const;

  std::unique_ptr<links::ByteClient> client_;
  Framing framing_;
  std::string name_;
  ModbusOptions options_;
  WaitLimit limit_{};
  std::uint16_t transaction_ = 0;
};

}  // namespace servodrome::master
