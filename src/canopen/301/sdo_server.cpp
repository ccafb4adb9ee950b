#include "canopen/301/sdo_server.hpp"

#include "canopen/301/sdo_wire.hpp"
#include "canopen/object_access.hpp"

namespace servodrome::canopen {

using dictionary::AbortCode;
using namespace sdo;

namespace {
constexpr std::uint16_t verify_configuration = 0x1020;
}

void SdoServer::configure(std::uint32_t request_can_id, std::uint32_t response_can_id) {
  verified_ = {storage_of(dictionary_, verify_configuration, 1), storage_of(dictionary_, verify_configuration, 2)};
  request_can_id_ = request_can_id;
  response_can_id_ = response_can_id;
  index_ = 0;
  sub_ = 0;
  reset();
}

void SdoServer::receive(const Frame& request) {
  if (request.length != 8) return;
  const std::uint8_t command = request.data[0];
  // Within a sub-block byte 0 is always a sequence number, except for an abort.
  if (state_ == State::block_download_segments && command != abort_transfer) {
    block_download_segment(request);
    return;
  }
  switch (specifier(command)) {
    case client::abort: reset(); break;
    case client::initiate_upload: initiate_upload(request); break;
    case client::initiate_download: initiate_download(request); break;
    case client::upload_segment: upload_segment(request); break;
    case client::download_segment: download_segment(request); break;
    case client::block_upload: block_upload(request); break;
    case client::block_download: block_download(request); break;
    default:
      index_ = multiplexer_index(request);
      sub_ = request.data[3];
      abort(AbortCode::command_specifier_unknown);
  }
}

// ---- Shared by the services ----

Frame SdoServer::response(std::uint8_t command) const {
  Frame frame;
  frame.id = response_can_id_;
  frame.length = 8;
  frame.data[0] = command;
  return frame;
}

Frame SdoServer::response_with_multiplexer(std::uint8_t command) const {
  Frame frame = response(command);
  frame.data[1] = static_cast<std::uint8_t>(index_);
  frame.data[2] = static_cast<std::uint8_t>(index_ >> 8);
  frame.data[3] = sub_;
  return frame;
}

void SdoServer::abort(AbortCode code) {
  reset();
  Frame frame = response_with_multiplexer(abort_transfer);
  put_u32(frame, static_cast<std::uint32_t>(code));
  link_.transmit(frame);
}

void SdoServer::expect_more() {
  if (profile_.sdo_timeout == Time{0}) return;
  deadline_ = link_.now() + profile_.sdo_timeout;
  link_.wake_at(deadline_);
}

AbortCode SdoServer::find(const Frame& request) {
  index_ = multiplexer_index(request);
  sub_ = request.data[3];
  state_ = State::idle;
  deadline_ = never;
  AbortCode abort_code{};
  entry_ = dictionary_.find(index_, sub_, abort_code);
  return abort_code;
}

AbortCode SdoServer::check_announced_size(std::uint32_t size) const {
  const std::uint32_t own = dictionary::size_of(entry_->type);
  const std::uint32_t limit = own != 0 ? own : entry_->capacity;
  if (size > limit) return dictionary_.length_aborts().too_long;
  if (size < own) return dictionary_.length_aborts().too_short;
  return size > buffer_.size() ? AbortCode::out_of_memory : AbortCode::none;
}

AbortCode SdoServer::check_received_size(std::uint32_t size) const {
  if (size_announced_ && size > announced_) return dictionary_.length_aborts().too_long;
  if (size_announced_ && size < announced_) return dictionary_.length_aborts().too_short;
  const std::uint32_t own = dictionary::size_of(entry_->type);
  if (size > (own != 0 ? own : entry_->capacity)) return dictionary_.length_aborts().too_long;
  return size > buffer_.size() ? AbortCode::out_of_memory : AbortCode::none;
}

AbortCode SdoServer::commit(std::span<const std::byte> value) {
  const AbortCode code = dictionary_.write(*entry_, value);
  // A changed configuration no longer matches 1020h, which is therefore cleared (CiA 301 7.5.2.23).
  if (code == AbortCode::none && entry_->saved && entry_->index != verify_configuration) {
    for (std::byte* place : verified_) {
      if (place != nullptr) std::memset(place, 0, sizeof(std::uint32_t));
    }
  }
  return code;
}

void SdoServer::poll() {
  if (deadline_ <= link_.now()) {
    abort(AbortCode::protocol_timed_out);
    return;
  }
  link_.wake_at(deadline_);
  if (state_ != State::block_download_segments) return;
  // The last segment of the sub-block may be lost; then only a timeout detects it.
  if (repeat_at_ <= link_.now()) {
    acknowledge_sub_block();
  } else {
    link_.wake_at(repeat_at_);
  }
}

// ---- SDO download (CiA 301 7.2.4.3.3, 7.2.4.3.4) ----

void SdoServer::initiate_download(const Frame& request) {
  AbortCode code = find(request);
  if (code != AbortCode::none) return abort(code);
  if (!entry_->writable()) return abort(AbortCode::read_only);
  const std::uint8_t command = request.data[0];
  if ((command & expedited) != 0) {
    // If no size is indicated, the size of the object decides how many of the four bytes are used.
    std::uint32_t size = 4U - (command >> 2 & 3U);
    if ((command & size_indicated) == 0) {
      const std::uint32_t own = dictionary::size_of(entry_->type);
      size = own != 0 && own < 4 ? own : 4;
    }
    code = commit(std::as_bytes(std::span(request.data)).subspan(4, size));
    if (code != AbortCode::none) return abort(code);
    Frame frame = response_with_multiplexer(server::download_initiated);
    if (profile_.sdo_download_response_echoes_data) std::memcpy(&frame.data[4], &request.data[4], 4);
    link_.transmit(frame);
    return;
  }
  if (!profile_.sdo_segmented) return abort(AbortCode::command_specifier_unknown);
  size_announced_ = (command & size_indicated) != 0;
  announced_ = get_u32(request);
  if (size_announced_) {
    code = check_announced_size(announced_);
    if (code != AbortCode::none) return abort(code);
  }
  state_ = State::download_segments;
  toggle_ = false;
  received_ = 0;
  link_.transmit(response_with_multiplexer(server::download_initiated));
  expect_more();
}

void SdoServer::download_segment(const Frame& request) {
  if (state_ != State::download_segments) return abort(AbortCode::command_specifier_unknown);
  const std::uint8_t command = request.data[0];
  if (((command & toggle_bit) != 0) != toggle_) return abort(AbortCode::toggle_bit_not_alternated);
  const std::uint32_t size = 7U - (command >> 1 & 7U);
  const std::uint32_t total = received_ + size;
  const bool last = (command & last_segment) != 0;
  // Too much data is refused at once, too little at the end.
  if (total > buffer_.size() || last || (size_announced_ && total > announced_)) {
    const AbortCode code = check_received_size(total);
    if (code != AbortCode::none) return abort(code);
  }
  std::memcpy(buffer_.data() + received_, &request.data[1], size);
  received_ = total;
  if (last) {
    const AbortCode code = commit(std::span<const std::byte>(buffer_).first(total));
    if (code != AbortCode::none) return abort(code);
  }
  const auto scs = static_cast<std::uint8_t>(server::segment_downloaded | (toggle_ ? toggle_bit : 0U));
  toggle_ = !toggle_;
  if (last) {
    reset();
  } else {
    expect_more();
  }
  link_.transmit(response(scs));
}

// ---- SDO upload (CiA 301 7.2.4.3.6, 7.2.4.3.7) ----

void SdoServer::initiate_upload(const Frame& request) {
  AbortCode code = find(request);
  if (code == AbortCode::none) code = dictionary_.read(*entry_, value_);
  if (code != AbortCode::none) return abort(code);
  respond_to_upload();
}

void SdoServer::respond_to_upload() {
  const std::size_t size = value_.bytes.size();
  if (size >= 1 && size <= 4) {
    Frame frame = response_with_multiplexer(static_cast<std::uint8_t>(server::upload_expedited | (4 - size) << 2));
    std::uint32_t word = 0;
    std::memcpy(&word, value_.bytes.data(), size);
    const bool negative = std::to_integer<unsigned>(value_.bytes[size - 1]) >= 0x80;
    if (profile_.sdo_expedited_upload_sign_extends && negative && size < 4) word |= ~std::uint32_t{0} << 8 * size;
    put_u32(frame, word);
    link_.transmit(frame);
    return;
  }
  if (!profile_.sdo_segmented) return abort(AbortCode::command_specifier_unknown);
  Frame frame = response_with_multiplexer(server::upload_segmented);
  put_u32(frame, static_cast<std::uint32_t>(size));
  state_ = State::upload_segments;
  toggle_ = false;
  position_ = 0;
  link_.transmit(frame);
  expect_more();
}

void SdoServer::upload_segment(const Frame& request) {
  if (state_ != State::upload_segments) return abort(AbortCode::command_specifier_unknown);
  if (((request.data[0] & toggle_bit) != 0) != toggle_) return abort(AbortCode::toggle_bit_not_alternated);
  const auto left = static_cast<std::uint32_t>(value_.bytes.size()) - position_;
  const std::uint32_t size = left < 7 ? left : 7;
  const bool last = size == left;
  Frame frame =
      response(static_cast<std::uint8_t>((toggle_ ? toggle_bit : 0U) | (7 - size) << 1 | (last ? last_segment : 0U)));
  if (size != 0) std::memcpy(&frame.data[1], value_.bytes.data() + position_, size);
  position_ += size;
  toggle_ = !toggle_;
  if (last) {
    reset();
  } else {
    expect_more();
  }
  link_.transmit(frame);
}

}  // namespace servodrome::canopen
