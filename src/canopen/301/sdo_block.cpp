// SDO block download and upload (CiA 301 7.2.4.3.9 to 7.2.4.3.15).
#include <algorithm>

#include "canopen/301/sdo_server.hpp"
#include "canopen/301/sdo_wire.hpp"
#include "canopen/crc16.hpp"

namespace servodrome::canopen {

using dictionary::AbortCode;
using namespace sdo;

namespace {
// If the rest of a sub-block does not arrive, it is requested after this time, before usual client timeouts.
constexpr Time block_repeat_time = std::chrono::milliseconds(500);
constexpr bool is_block_size(unsigned size) { return size >= 1 && size <= largest_block; }
}  // namespace

// ---- download ----

void SdoServer::block_download(const Frame& request) {
  const std::uint8_t command = request.data[0];
  if ((command & block_download_subcommand::end) != 0) {
    if (state_ != State::block_download_end) return abort(AbortCode::command_specifier_unknown);
    end_block_download(request);
    return;
  }
  AbortCode code = find(request);
  if (code != AbortCode::none) return abort(code);
  if (!profile_.sdo_block) return abort(AbortCode::command_specifier_unknown);
  if (!entry_->writable()) return abort(AbortCode::read_only);
  crc_wanted_ = (command & client_crc) != 0;
  size_announced_ = (command & block_size_indicated) != 0;
  announced_ = get_u32(request);
  if (size_announced_) {
    code = check_announced_size(announced_);
    if (code != AbortCode::none) return abort(code);
  }
  state_ = State::block_download_segments;
  received_ = 0;
  sequence_ = 0;
  last_segment_seen_ = false;
  // A sub-block is not larger than the buffer.
  const std::size_t useful = (buffer_.size() + segment_bytes - 1) / segment_bytes;
  block_size_ = static_cast<std::uint8_t>(useful < 1 ? 1 : useful < largest_block ? useful : largest_block);
  Frame frame = response_with_multiplexer(server::block_download_initiated);
  frame.data[4] = block_size_;
  link_.transmit(frame);
  repeat_at_ = never;
  expect_more();
}

void SdoServer::block_download_segment(const Frame& request) {
  const std::uint8_t sequence = request.data[0] & sequence_mask;
  const bool last = (request.data[0] & last_block_segment) != 0;
  if (sequence == 0 || sequence > block_size_) return abort(AbortCode::invalid_sequence_number);
  // After a gap the rest of the sub-block is ignored; the acknowledgement makes the client repeat it.
  if (sequence == sequence_ + 1) {
    // Only the end request contains the length of the padding, so up to six bytes too many may arrive.
    if (received_ >= buffer_.size()) {
      const AbortCode code = check_received_size(received_ + 1);
      return abort(code == AbortCode::none ? AbortCode::out_of_memory : code);
    }
    const std::size_t space = buffer_.size() - received_;
    std::memcpy(buffer_.data() + received_, &request.data[1], space < segment_bytes ? space : segment_bytes);
    received_ += segment_bytes;
    sequence_ = sequence;
    last_segment_seen_ = last;
    // Only an expected segment restarts the timeout. So a client that begins another transfer, whose requests look like
    // segments, gets the abort of the timeout.
    expect_more();
  }
  if (last || sequence == block_size_) {
    acknowledge_sub_block();
  } else if (profile_.sdo_timeout != Time{0}) {
    repeat_at_ = link_.now() + std::min<Time>(profile_.sdo_timeout / 2, block_repeat_time);
    link_.wake_at(repeat_at_);
  }
}

void SdoServer::acknowledge_sub_block() {
  Frame frame = response(server::block_downloaded);
  frame.data[1] = sequence_;
  frame.data[2] = block_size_;
  sequence_ = 0;
  repeat_at_ = never;
  if (last_segment_seen_) state_ = State::block_download_end;
  link_.transmit(frame);
}

void SdoServer::end_block_download(const Frame& request) {
  const std::uint32_t unused = request.data[0] >> 2 & 7U;
  if (unused > received_) return abort(AbortCode::command_specifier_unknown);
  const std::uint32_t size = received_ - unused;
  AbortCode code = check_received_size(size);
  if (code == AbortCode::none && crc_wanted_) {
    const auto expected = static_cast<std::uint16_t>(request.data[1] | request.data[2] << 8);
    if (crc16(std::span<const std::byte>(buffer_).first(size)) != expected) code = AbortCode::crc_error;
  }
  if (code == AbortCode::none) code = commit(std::span<const std::byte>(buffer_).first(size));
  if (code != AbortCode::none) return abort(code);
  reset();
  link_.transmit(response(server::block_download_ended));
}

// ---- upload ----

void SdoServer::block_upload(const Frame& request) {
  switch (request.data[0] & subcommand_mask) {
    case block_upload_subcommand::initiate: {
      AbortCode code = find(request);
      if (code != AbortCode::none) return abort(code);
      if (!profile_.sdo_block) return abort(AbortCode::command_specifier_unknown);
      if (!is_block_size(request.data[4])) return abort(AbortCode::invalid_block_size);
      code = dictionary_.read(*entry_, value_);
      if (code != AbortCode::none) return abort(code);
      // Protocol switch threshold: small data use the normal upload.
      if (request.data[5] != 0 && value_.bytes.size() <= request.data[5]) return respond_to_upload();
      crc_wanted_ = (request.data[0] & client_crc) != 0;
      block_size_ = request.data[4];
      position_ = 0;
      state_ = State::block_upload_start;
      Frame frame = response_with_multiplexer(server::block_upload_initiated);
      put_u32(frame, static_cast<std::uint32_t>(value_.bytes.size()));
      link_.transmit(frame);
      expect_more();
      return;
    }
    case block_upload_subcommand::start:
      if (state_ != State::block_upload_start) return abort(AbortCode::command_specifier_unknown);
      sequence_ = 0;
      block_start_ = 0;
      state_ = State::block_upload_sending;
      expect_more();
      return;
    case block_upload_subcommand::response:
      // The client may respond early if it has detected a gap.
      if (state_ != State::block_upload_response && state_ != State::block_upload_sending) {
        return abort(AbortCode::command_specifier_unknown);
      }
      acknowledged(request.data[1], request.data[2]);
      return;
    default:
      if (state_ != State::block_upload_end) return abort(AbortCode::command_specifier_unknown);
      reset();
  }
}

bool SdoServer::produce_segment(Frame& frame) {
  const auto left = static_cast<std::uint32_t>(value_.bytes.size()) - position_;
  const std::uint32_t size = left < segment_bytes ? left : segment_bytes;
  const bool last = size == left;
  ++sequence_;
  frame = response(static_cast<std::uint8_t>(sequence_ | (last ? last_block_segment : 0U)));
  if (size != 0) std::memcpy(&frame.data[1], value_.bytes.data() + position_, size);
  position_ += size;
  if (last || sequence_ == block_size_) {
    state_ = State::block_upload_response;
    expect_more();
  }
  return true;
}

// The client has received `segments` of the last sub-block; the segments after them are sent again.
void SdoServer::acknowledged(std::uint8_t segments, std::uint8_t next_block_size) {
  if (segments > sequence_) return abort(AbortCode::invalid_sequence_number);
  if (!is_block_size(next_block_size)) return abort(AbortCode::invalid_block_size);
  const auto size = static_cast<std::uint32_t>(value_.bytes.size());
  const std::uint32_t confirmed = block_start_ + segments * segment_bytes;
  const bool complete = segments != 0 && confirmed >= size;
  expect_more();
  if (!complete) {
    block_start_ = confirmed;
    position_ = confirmed;
    sequence_ = 0;
    block_size_ = next_block_size;
    state_ = State::block_upload_sending;
    return;
  }
  const std::uint32_t in_last = size == 0 ? 0 : (size - 1) % segment_bytes + 1;
  Frame frame = response(static_cast<std::uint8_t>(server::block_upload_end | (segment_bytes - in_last) << 2));
  const std::uint16_t crc = crc_wanted_ ? crc16(value_.bytes) : std::uint16_t{0};
  frame.data[1] = static_cast<std::uint8_t>(crc);
  frame.data[2] = static_cast<std::uint8_t>(crc >> 8);
  state_ = State::block_upload_end;
  link_.transmit(frame);
}

}  // namespace servodrome::canopen
