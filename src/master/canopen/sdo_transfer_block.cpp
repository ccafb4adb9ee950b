// Block transfers (CiA 301 7.2.4.3.9 to 7.2.4.3.15).
#include <algorithm>

#include "canopen/301/sdo_wire.hpp"
#include "canopen/crc16.hpp"
#include "master/canopen/sdo_transfer.hpp"

namespace servodrome::master {

using canopen::Frame;
namespace sdo = canopen::sdo;

namespace {

// Server command specifiers, and the subcommands of their answers.
constexpr std::uint8_t from_server_initiate_upload = 2;
constexpr std::uint8_t from_server_block_download = 5;
constexpr std::uint8_t from_server_block_upload = 6;
constexpr std::uint8_t sub_block_confirmed = 2;

constexpr std::uint8_t client_upload(std::uint8_t subcommand) {
  return static_cast<std::uint8_t>(sdo::client::block_upload << 5 | subcommand);
}
std::uint16_t crc_in(const Frame& frame) { return static_cast<std::uint16_t>(frame.data[1] | frame.data[2] << 8); }

}  // namespace

// ---- upload ----

bool SdoTransfer::receive_block_upload_initiated(const Frame& answer) {
  if (!is_for_this(answer)) return false;
  const std::uint8_t command = answer.data[0];
  if (sdo::specifier(command) == from_server_initiate_upload) {
    // Some servers without block upload answer with an ordinary upload, even if the threshold (7.2.4.3.12) forbids it.
    phase_ = Phase::initiate;
    return receive_initiated_upload(answer);
  }
  if (sdo::specifier(command) != from_server_block_upload || (command & sdo::last_segment) != 0) return false;
  crc_used_ = (command & sdo::client_crc) != 0;
  if ((command & sdo::block_size_indicated) != 0) announced_ = sdo::get_u32(answer);
  phase_ = Phase::block_upload_segments;
  block_size_ = sdo::largest_block;
  sequence_ = 0;
  request(client_upload(sdo::block_upload_subcommand::start));
  return true;
}

bool SdoTransfer::receive_block_segment(const Frame& answer) {
  const std::uint8_t sequence = answer.data[0] & sdo::sequence_mask;
  const bool last = (answer.data[0] & sdo::last_block_segment) != 0;
  if (sequence == 0 || sequence > block_size_) {
    abort(AbortCode::invalid_sequence_number);
    return true;
  }
  // After a gap the rest of the sub-block is ignored; the acknowledgement makes the server repeat it.
  if (sequence == sequence_ + 1) {
    if (!append(std::span(answer.data).subspan(1, sdo::segment_bytes))) return true;
    sequence_ = sequence;
    last_taken_ = last;
  }
  if (last || sequence == block_size_) acknowledge_sub_block();
  return true;
}

void SdoTransfer::acknowledge_sub_block() {
  Frame& frame = request(client_upload(sdo::block_upload_subcommand::response));
  frame.data[1] = sequence_;
  frame.data[2] = sdo::largest_block;
  block_size_ = sdo::largest_block;
  // After the last segment the number is kept, so that a lost acknowledgement can be repeated unchanged.
  if (!last_taken_) sequence_ = 0;
}

bool SdoTransfer::receive_block_upload_end(const Frame& answer) {
  const std::uint8_t command = answer.data[0];
  if (sdo::specifier(command) != from_server_block_upload ||
      (command & sdo::subcommand_mask) != sdo::block_upload_subcommand::end) {
    return false;  // a repeated segment
  }
  const std::size_t unused = command >> 2 & 7U;
  if (unused > data_.size()) return unexpected();
  data_.resize(data_.size() - unused);
  if (announced_ && *announced_ != data_.size()) {
    abort(AbortCode::length_mismatch);
  } else if (crc_used_ && canopen::crc16(data_) != crc_in(answer)) {
    abort(AbortCode::crc_error);
  } else {
    request(client_upload(sdo::block_upload_subcommand::end));
    finish();
  }
  return true;
}

// ---- download ----

bool SdoTransfer::receive_block_download_initiated(const Frame& answer) {
  if (!is_for_this(answer)) return false;
  const std::uint8_t command = answer.data[0];
  if (sdo::specifier(command) != from_server_block_download || (command & sdo::subcommand_mask) != 0) return false;
  crc_used_ = (command & sdo::client_crc) != 0;
  block_size_ = answer.data[4];
  if (block_size_ == 0 || block_size_ > sdo::largest_block) {
    abort(AbortCode::invalid_block_size);
    return true;
  }
  sequence_ = 0;
  phase_ = Phase::block_download_segments;
  return true;
}

void SdoTransfer::produce_block_segment(Frame& frame) {
  const std::size_t first = position_ + sequence_ * sdo::segment_bytes;
  const std::size_t size = std::min<std::size_t>(sdo::segment_bytes, data_.size() - first);
  const bool last = first + size == data_.size();
  ++sequence_;
  frame = Frame{};
  frame.length = 8;
  frame.data[0] = static_cast<std::uint8_t>(sequence_ | (last ? sdo::last_block_segment : 0U));
  if (size != 0) std::memcpy(&frame.data[1], &data_[first], size);
  if (last || sequence_ == block_size_) phase_ = Phase::block_download_acknowledged;
}

bool SdoTransfer::receive_sub_block_confirmation(const Frame& answer) {
  const std::uint8_t command = answer.data[0];
  if (sdo::specifier(command) != from_server_block_download ||
      (command & sdo::subcommand_mask) != sub_block_confirmed) {
    return false;
  }
  const std::uint8_t confirmed = answer.data[1];
  const std::uint8_t next_size = answer.data[2];
  if (confirmed > sequence_) {
    abort(AbortCode::invalid_sequence_number);
    return true;
  }
  if (next_size == 0 || next_size > sdo::largest_block) {
    abort(AbortCode::invalid_block_size);
    return true;
  }
  block_size_ = next_size;
  // Segments after the confirmed ones are sent again.
  const std::size_t after = position_ + confirmed * sdo::segment_bytes;
  if (confirmed != 0 && after >= data_.size()) {
    end_block_download();
    return true;
  }
  position_ = after;
  sequence_ = 0;
  phase_ = Phase::block_download_segments;
  return true;
}

void SdoTransfer::end_block_download() {
  const std::size_t in_last = data_.empty() ? 0 : (data_.size() - 1) % sdo::segment_bytes + 1;
  Frame& frame = request(static_cast<std::uint8_t>(
      sdo::client::block_download << 5 | (sdo::segment_bytes - in_last) << 2 | sdo::block_download_subcommand::end));
  const std::uint16_t crc = crc_used_ ? canopen::crc16(data_) : std::uint16_t{0};
  frame.data[1] = static_cast<std::uint8_t>(crc);
  frame.data[2] = static_cast<std::uint8_t>(crc >> 8);
  phase_ = Phase::block_download_end;
}

}  // namespace servodrome::master
