// Expedited and segmented transfers (CiA 301 7.2.4.3.3 to 7.2.4.3.8) and abort.
#include "master/canopen/sdo_transfer.hpp"

#include <algorithm>

#include "canopen/301/sdo_wire.hpp"

namespace servodrome::master {

using canopen::Frame;
namespace sdo = canopen::sdo;

namespace {

constexpr std::uint8_t command_of(std::uint8_t specifier) { return static_cast<std::uint8_t>(specifier << 5); }

// Server command specifiers.
namespace from_server {
constexpr std::uint8_t upload_segment = 0;
constexpr std::uint8_t download_segment = 1;
constexpr std::uint8_t initiate_upload = 2;
constexpr std::uint8_t initiate_download = 3;
}  // namespace from_server

}  // namespace

SdoTransfer SdoTransfer::upload(ObjectAddress object, SdoProtocol protocol) {
  SdoTransfer transfer(object, true);
  if (protocol == SdoProtocol::block) {
    transfer.phase_ = Phase::block_upload_initiate;
    Frame& frame = transfer.initiate(command_of(sdo::client::block_upload) | sdo::client_crc |
                                     sdo::block_upload_subcommand::initiate);
    frame.data[4] = sdo::largest_block;
    frame.data[5] = 0;  // the server must not switch to the ordinary protocol
  } else {
    transfer.initiate(command_of(sdo::client::initiate_upload));
  }
  return transfer;
}

SdoTransfer SdoTransfer::download(ObjectAddress object, std::span<const std::byte> data, SdoProtocol protocol) {
  SdoTransfer transfer(object, false);
  transfer.data_.assign(data.begin(), data.end());
  const auto size = static_cast<std::uint32_t>(data.size());
  if (protocol == SdoProtocol::block) {
    transfer.phase_ = Phase::block_download_initiate;
    sdo::put_u32(transfer.initiate(command_of(sdo::client::block_download) | sdo::client_crc |
                                   sdo::block_size_indicated | sdo::block_download_subcommand::initiate),
                 size);
  } else if (size >= 1 && size <= sdo::expedited_bytes) {
    const auto unused = static_cast<std::uint8_t>((sdo::expedited_bytes - size) << 2);
    Frame& frame = transfer.initiate(static_cast<std::uint8_t>(command_of(sdo::client::initiate_download) | unused |
                                                               sdo::expedited | sdo::size_indicated));
    std::memcpy(&frame.data[4], data.data(), size);
    transfer.in_flight_ = size;
  } else {
    sdo::put_u32(transfer.initiate(command_of(sdo::client::initiate_download) | sdo::size_indicated), size);
  }
  return transfer;
}

Frame& SdoTransfer::request(std::uint8_t command) {
  Frame& frame = to_send_.emplace();
  frame.length = 8;
  frame.data[0] = command;
  return frame;
}

Frame& SdoTransfer::initiate(std::uint8_t command) {
  Frame& frame = request(command);
  frame.data[1] = static_cast<std::uint8_t>(object_.index);
  frame.data[2] = static_cast<std::uint8_t>(object_.index >> 8);
  frame.data[3] = object_.sub;
  return frame;
}

bool SdoTransfer::take(Frame& frame) {
  if (to_send_) {
    frame = *to_send_;
    to_send_.reset();
    return true;
  }
  if (phase_ != Phase::block_download_segments) return false;
  produce_block_segment(frame);
  return true;
}

void SdoTransfer::finish() { phase_ = Phase::done; }

void SdoTransfer::abort(AbortCode code) {
  if (finished()) return;
  sdo::put_u32(initiate(sdo::abort_transfer), static_cast<std::uint32_t>(code));
  result_ = code;
  finish();
}

bool SdoTransfer::unexpected() {
  abort(AbortCode::command_specifier_unknown);
  return true;
}

bool SdoTransfer::is_for_this(const Frame& answer) const {
  return sdo::multiplexer_index(answer) == object_.index && answer.data[3] == object_.sub;
}

bool SdoTransfer::receive(const Frame& answer) {
  if (finished() || answer.length != 8) return false;
  const std::uint8_t command = answer.data[0];
  if (command == sdo::abort_transfer) {  // no segment of a block upload starts with 80h: its number would be 0
    // Some servers set the multiplexer to 0 if they did not understand the request.
    const bool unnamed = sdo::multiplexer_index(answer) == 0 && answer.data[3] == 0;
    if (!is_for_this(answer) && !unnamed) return false;
    result_ = static_cast<AbortCode>(sdo::get_u32(answer));
    aborted_by_server_ = true;
    to_send_.reset();
    finish();
    return true;
  }
  switch (phase_) {
    case Phase::initiate: return is_upload_ ? receive_initiated_upload(answer) : receive_initiated_download(answer);
    case Phase::upload_segments: return receive_upload_segment(answer);
    case Phase::download_segments: return receive_download_confirmation(answer);
    case Phase::block_upload_initiate: return receive_block_upload_initiated(answer);
    case Phase::block_upload_segments:
      return last_taken_ ? receive_block_upload_end(answer) : receive_block_segment(answer);
    case Phase::block_download_initiate: return receive_block_download_initiated(answer);
    // A server that detects a gap may confirm before the whole sub-block has been sent.
    case Phase::block_download_segments:
    case Phase::block_download_acknowledged: return receive_sub_block_confirmation(answer);
    case Phase::block_download_end:
      if (command != sdo::server::block_download_ended) return false;
      finish();
      return true;
    case Phase::done: break;
  }
  return false;
}

bool SdoTransfer::append(std::span<const std::uint8_t> bytes) {
  if (data_.size() + bytes.size() > largest_upload) {
    abort(AbortCode::out_of_memory);
    return false;
  }
  const auto* first = reinterpret_cast<const std::byte*>(bytes.data());
  data_.insert(data_.end(), first, first + bytes.size());
  return true;
}

bool SdoTransfer::receive_initiated_upload(const Frame& answer) {
  if (!is_for_this(answer)) return false;
  const std::uint8_t command = answer.data[0];
  if (sdo::specifier(command) != from_server::initiate_upload) return false;
  const bool sized = (command & sdo::size_indicated) != 0;
  if ((command & sdo::expedited) != 0) {
    const std::size_t size = sized ? sdo::expedited_bytes - (command >> 2 & 3U) : sdo::expedited_bytes;
    size_is_known_ = sized;
    if (append(std::span(answer.data).subspan(4, size))) finish();
    return true;
  }
  if (sized) announced_ = sdo::get_u32(answer);
  phase_ = Phase::upload_segments;
  request_upload_segment();
  return true;
}

void SdoTransfer::request_upload_segment() {
  request(static_cast<std::uint8_t>(command_of(sdo::client::upload_segment) | (toggle_ ? sdo::toggle_bit : 0U)));
}

bool SdoTransfer::receive_upload_segment(const Frame& answer) {
  const std::uint8_t command = answer.data[0];
  if (sdo::specifier(command) != from_server::upload_segment) return unexpected();
  if (((command & sdo::toggle_bit) != 0) != toggle_) {
    abort(AbortCode::toggle_bit_not_alternated);
    return true;
  }
  const std::size_t size = sdo::segment_bytes - (command >> 1 & 7U);
  if (!append(std::span(answer.data).subspan(1, size))) return true;
  toggle_ = !toggle_;
  if ((command & sdo::last_segment) == 0) {
    // A server that sends segments without data would never end the transfer.
    if (size != 0) {
      request_upload_segment();
    } else {
      abort(AbortCode::length_mismatch);
    }
  } else if (announced_ && *announced_ != data_.size()) {
    abort(AbortCode::length_mismatch);
  } else {
    finish();
  }
  return true;
}

bool SdoTransfer::receive_initiated_download(const Frame& answer) {
  if (!is_for_this(answer)) return false;
  if (sdo::specifier(answer.data[0]) != from_server::initiate_download) return false;
  position_ = in_flight_;
  if (in_flight_ != 0) {
    finish();
    return true;
  }
  phase_ = Phase::download_segments;
  send_download_segment();
  return true;
}

std::size_t SdoTransfer::segment_size() const {
  return std::min<std::size_t>(sdo::segment_bytes, data_.size() - position_);
}

void SdoTransfer::send_download_segment() {
  in_flight_ = segment_size();
  const bool last = position_ + in_flight_ == data_.size();
  const auto unused = static_cast<std::uint8_t>((sdo::segment_bytes - in_flight_) << 1);
  Frame& frame = request(static_cast<std::uint8_t>(command_of(sdo::client::download_segment) | unused |
                                                   (toggle_ ? sdo::toggle_bit : 0U) | (last ? sdo::last_segment : 0U)));
  if (in_flight_ != 0) std::memcpy(&frame.data[1], &data_[position_], in_flight_);
}

bool SdoTransfer::receive_download_confirmation(const Frame& answer) {
  const std::uint8_t command = answer.data[0];
  if (sdo::specifier(command) != from_server::download_segment) return unexpected();
  if (((command & sdo::toggle_bit) != 0) != toggle_) {
    abort(AbortCode::toggle_bit_not_alternated);
    return true;
  }
  toggle_ = !toggle_;
  position_ += in_flight_;
  if (position_ == data_.size()) {
    finish();
  } else {
    send_download_segment();
  }
  return true;
}

}  // namespace servodrome::master
