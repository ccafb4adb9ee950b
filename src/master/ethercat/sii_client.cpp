#include "master/ethercat/sii_client.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "ethercat/esc/sii_interface.hpp"

namespace servodrome::master {

namespace reg = ethercat::reg;
using ethercat::load_u16;

namespace {

using namespace std::chrono_literals;

// Control and status, 0502h (ETG.1000.4 table 50).
constexpr std::uint16_t write_enable = 0x0001;
constexpr std::uint16_t eight_bytes = 0x0040;
constexpr std::uint16_t read_command = 0x0100;
constexpr std::uint16_t write_command = 0x0200;
constexpr std::uint16_t acknowledge_error_bit = 0x2000;
constexpr std::uint16_t write_enable_error_bit = 0x4000;
constexpr std::uint16_t busy = 0x8000;

constexpr Time busy_timeout = 2s;  // an EEPROM needs at most 10 ms for a word; for a simulated one it depends on the
                                   // load of the computer
constexpr Time sii_poll_interval = 100us;
constexpr unsigned attempts = 3;  // an EEPROM that is still writing does not acknowledge; a busy memory ignores a
                                  // command that is sent again because its frame returned late

constexpr std::size_t categories_word = 0x40;
constexpr std::uint16_t end_of_categories = 0xFFFF;
constexpr std::size_t configuration_bytes = 14;

}  // namespace

void SiiClient::fail(std::uint16_t word, const std::string& happened, const std::string& remedy) {
  throw EthercatError(EthercatError::Kind::refused, happened,
                      fmt::format("{}, SII word {:04X}h", slave_text(master_, station_), word), remedy);
}

void SiiClient::take_interface() {
  if (taken_) return;
  if ((master_.read<std::uint8_t>(station_, reg::sii_pdi_access) & 1) != 0) {
    master_.write<std::uint8_t>(station_, reg::sii_configuration, 0x02);  // forces the application to release it
  }
  master_.write<std::uint8_t>(station_, reg::sii_configuration, 0x00);
  taken_ = true;
}

SiiClient::Status SiiClient::wait_until_idle(std::uint16_t word) {
  const Time deadline = master_.now() + busy_timeout;
  while (true) {
    std::array<std::uint8_t, 14> registers{};
    master_.read(station_, reg::sii_control, registers);
    Status status{.bits = load_u16(registers.data())};
    std::copy_n(&registers[6], status.data.size(), status.data.begin());
    status.width = (status.bits & eight_bytes) != 0 ? 8 : 4;
    if ((status.bits & busy) == 0) return status;
    if (master_.now() >= deadline) {
      fail(word, "the memory stays busy",
           "check that no other master is active and that virtual time is not stopped; then switch the slave off and "
           "on");
    }
    master_.wait(sii_poll_interval);
  }
}

SiiClient::Status SiiClient::command(std::uint16_t control, std::uint16_t word, std::span<const std::uint8_t> data) {
  take_interface();
  for (unsigned attempt = 1;; ++attempt) {
    wait_until_idle(word);
    std::vector<std::uint8_t> registers(6 + data.size());
    ethercat::store_u16(registers.data(), control);
    ethercat::store_u32(&registers[2], word);
    std::copy(data.begin(), data.end(), registers.begin() + 6);
    // Control, address and data go in one datagram, because the write enable is valid only within its frame.
    const bool accepted = master_.write_if_accepted(station_, reg::sii_control, registers) != 0;
    const Status status = wait_until_idle(word);
    if (accepted && (status.bits & (acknowledge_error_bit | write_enable_error_bit)) == 0) return status;
    if (attempt < attempts) continue;
    if (!accepted) {
      fail(word, "the slave ignores commands to the memory (working counter 0)",
           "check that no other master is active; then switch the slave off and on");
    }
    if ((status.bits & write_enable_error_bit) != 0) {
      fail(word, "the slave refuses the write", "check whether its EEPROM is write-protected");
    }
    fail(word, "the memory does not acknowledge", "check that the address is within it; the EEPROM may be missing");
  }
}

std::vector<std::uint8_t> SiiClient::read(std::uint16_t word, std::size_t bytes) {
  std::vector<std::uint8_t> all;
  while (all.size() < bytes) {
    const auto at = static_cast<std::uint16_t>(word + all.size() / 2);
    const Status status = command(read_command, at, {});
    const std::size_t count = std::min(status.width, bytes - all.size());
    all.insert(all.end(), status.data.begin(), status.data.begin() + static_cast<std::ptrdiff_t>(count));
  }
  return all;
}

std::vector<std::uint8_t> SiiClient::read_all() {
  std::vector<std::uint8_t> image = read(0, categories_word * 2);
  const auto extend = [&](std::size_t bytes) {
    if (image.size() >= bytes) return;
    const auto more = read(static_cast<std::uint16_t>(image.size() / 2), bytes - image.size());
    image.insert(image.end(), more.begin(), more.end());
  };
  std::size_t at = image.size();
  constexpr std::size_t address_space = std::size_t{0x10000} * 2;
  while (at + 4 <= address_space) {
    // Also reads the first words of the content, which the same read access returns with the header.
    extend(at + 8);
    if (load_u16(&image[at]) == end_of_categories) break;
    at += 4 + 2U * load_u16(&image[at + 2]);
    if (at <= address_space) extend(at);
  }
  return image;
}

void SiiClient::write(std::uint16_t word, std::span<const std::uint8_t> bytes) {
  if (bytes.size() % 2 != 0) {
    fail(word, fmt::format("{} bytes are not whole words", bytes.size()), "give an even number of bytes");
  }
  for (std::size_t i = 0; i < bytes.size(); i += 2) {
    command(write_command | write_enable, static_cast<std::uint16_t>(word + i / 2), bytes.subspan(i, 2));
  }
}

void SiiClient::write_alias(std::uint16_t alias) {
  constexpr std::uint16_t alias_word = 4;
  constexpr std::uint16_t checksum_word = 7;
  std::vector<std::uint8_t> configuration = read(0, 16);
  ethercat::store_u16(&configuration[2 * alias_word], alias);
  configuration[2 * checksum_word] = ethercat::sii_checksum(std::span(configuration).first(configuration_bytes));
  write(alias_word, std::span(configuration).subspan(2 * alias_word, 2));
  write(checksum_word, std::span(configuration).subspan(2 * checksum_word, 2));
}

}  // namespace servodrome::master
