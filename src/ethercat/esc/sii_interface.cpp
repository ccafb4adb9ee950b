#include "ethercat/esc/sii_interface.hpp"

#include <algorithm>

#include "ethercat/bytes.hpp"

namespace servodrome::ethercat {

namespace {
constexpr std::size_t configuration_area = 16;  // bytes
constexpr std::size_t read_size = 8;            // bytes per read command, as bit 6 of the status shows
}  // namespace

std::uint8_t sii_checksum(std::span<const std::uint8_t> first_14_bytes) {
  unsigned crc = 0xFF;
  for (const std::uint8_t byte : first_14_bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80) != 0 ? (crc << 1 ^ 0x07) & 0xFF : crc << 1;
  }
  return static_cast<std::uint8_t>(crc);
}

void SiiInterface::power_on() {
  const bool written = written_;
  *this = SiiInterface(memory_, timing_);
  written_ = written;
  load();
}

bool SiiInterface::load() {
  const bool there = memory_.size() >= configuration_area;
  acknowledge_error_ = memory_.empty();
  checksum_error_ = !there || sii_checksum(memory_.first(14)) != memory_[14];
  loaded_ = !checksum_error_;
  return loaded_;
}

bool SiiInterface::busy(Time now) {
  if (running_ == Command::none) return false;
  if (now < done_at_) return true;
  finish();
  return false;
}

void SiiInterface::finish() {
  const Command command = running_;
  running_ = Command::none;
  command_ = 0;
  const std::uint64_t at = std::uint64_t{address_} * 2;
  switch (command) {
    case Command::read:
      for (std::size_t i = 0; i < read_size; ++i) data_[i] = at + i < memory_.size() ? memory_[at + i] : 0xFF;
      acknowledge_error_ = memory_.empty();
      break;
    case Command::write:
      acknowledge_error_ = at + 2 > memory_.size();
      if (acknowledge_error_) break;
      store_u16(&memory_[at], write_data_);
      written_ = true;
      break;
    case Command::reload: load(), reloaded_ = true; break;
    case Command::none: break;
  }
}

std::uint8_t SiiInterface::byte(std::uint8_t offset, Time now) {
  const bool is_busy = busy(now);
  switch (offset) {
    case 0: return configuration_;
    case 1: return pdi_access_;
    case 2:
      return static_cast<std::uint8_t>((write_enabled_ || application_has_it() ? 0x01U : 0U) | 0x40U |
                                       (memory_.size() > 2048 ? 0x80U : 0U));
    case 3:
      return static_cast<std::uint8_t>(command_ | (checksum_error_ ? 0x08U : 0U) | (loaded_ ? 0U : 0x10U) |
                                       (acknowledge_error_ ? 0x20U : 0U) | (write_enable_error_ ? 0x40U : 0U) |
                                       (is_busy ? 0x80U : 0U));
    default: return offset < 8 ? static_cast<std::uint8_t>(address_ >> 8 * (offset - 4)) : data_[offset - 8];
  }
}

bool SiiInterface::byte_written(std::uint8_t offset, std::uint8_t value, Side side, Time now) {
  if (offset == 0) {
    if (side != Side::master) return false;
    configuration_ = value & 0x03;
    if ((value & 0x02) != 0) pdi_access_ = 0;  // force: the application loses its access
    return true;
  }
  if (offset == 1) {
    // The application gets access only while the interface is offered to it.
    if (side != Side::application || !application_has_it() || (configuration_ & 0x02) != 0) return false;
    pdi_access_ = value & 0x01;
    return true;
  }
  if (!granted(side) || busy(now)) return false;
  if (offset == 2) {
    write_enabled_ = (value & 0x01) != 0;
  } else if (offset == 3) {
    command_ = value & 0x07;
    command_written_ = true;
  } else if (offset < 8) {
    const unsigned shift = 8U * (offset - 4U);
    address_ = (address_ & ~(0xFFU << shift)) | static_cast<std::uint32_t>(value) << shift;
  } else {
    data_[offset - 8] = value;
  }
  return true;
}

void SiiInterface::run(Side side, Time now) {
  if (!granted(side) || !command_written_) return;
  command_written_ = false;
  // Every command clears the error bits of the one before.
  acknowledge_error_ = write_enable_error_ = false;
  switch (command_) {
    case 0: return;
    case 1: running_ = Command::read, done_at_ = now + timing_.read; break;
    case 2:
      if (side == Side::master && !write_enabled_) {
        write_enable_error_ = true;
        command_ = 0;
        return;
      }
      write_data_ = load_u16(data_);
      running_ = Command::write, done_at_ = now + timing_.write;
      break;
    case 4: running_ = Command::reload, done_at_ = now + timing_.read; break;
    default:
      acknowledge_error_ = true;  // unknown command
      command_ = 0;
      return;
  }
  busy(now);  // a memory without access time finishes at once
}

}  // namespace servodrome::ethercat
