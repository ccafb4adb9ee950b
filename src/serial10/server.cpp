#include "serial10/server.hpp"

namespace servodrome::serial10 {

using dictionary::AbortCode;
using dictionary::Entry;

void Server::reset() {
  received_ = 0;
  to_send_ = 0;
  is_spoilt_ = false;
}

void Server::receive(std::uint8_t character, Time at) {
  if (at - last_ > partial_frame_timeout) reset();
  last_ = at;
  to_send_ = 0;
  request_.bytes[received_++] = character;
  if (received_ < frame_bytes) return;
  received_ = 0;
  if (std::exchange(is_spoilt_, false) || !request_.is_intact()) return;
  if (request_.id() != id_ && request_.id() != universal_id) return;
  answer_ = answer(request_);
  to_send_ = frame_bytes;
}

void Server::receive_garbled(Time at) {
  if (at - last_ > partial_frame_timeout) reset();
  is_spoilt_ = true;  // before receive(), because this may be the frame's last character
  receive(0, at);
}

Frame Server::answer(const Frame& request) {
  switch (request.command()) {
    case Command::read: return read(request);
    case Command::write_1:
    case Command::write_2:
    case Command::write_4: return write(request);
    default: return refuse(request, AbortCode::command_specifier_unknown);
  }
}

Frame Server::read(const Frame& request) {
  AbortCode abort = AbortCode::none;
  const Entry* entry = dictionary_.find(request.index(), request.sub(), abort);
  if (entry == nullptr) return refuse(request, abort);
  const std::uint8_t size = dictionary::size_of(entry->type);
  if (size == 0 || size > 4) return refuse(request, AbortCode::unsupported_access);
  dictionary::ReadValue value;
  if (abort = dictionary_.read(*entry, value); abort != AbortCode::none) return refuse(request, abort);
  std::uint32_t data = 0;
  for (std::size_t i = 4; i-- > 0;) {
    const bool negative = (value.bytes.back() & std::byte{0x80}) != std::byte{0};
    data = data << 8 | (i < size ? std::to_integer<std::uint32_t>(value.bytes[i]) : negative ? 0xFFU : 0U);
  }
  const Command command = size == 4 ? Command::read_4 : size == 2 ? Command::read_2 : Command::read_1;
  return Frame::make(id_, command, request.index(), request.sub(), data);
}

Frame Server::write(const Frame& request) {
  AbortCode abort = AbortCode::none;
  const Entry* entry = dictionary_.find(request.index(), request.sub(), abort);
  if (entry == nullptr) return refuse(request, abort);
  const auto value = std::as_bytes(std::span(request.bytes)).subspan(5, data_bytes(request.command()));
  if (abort = dictionary_.write(*entry, value); abort != AbortCode::none) return refuse(request, abort);
  return Frame::make(id_, Command::written, request.index(), request.sub(), request.data());
}

Frame Server::refuse(const Frame& request, AbortCode abort) const {
  return Frame::make(id_, Command::error, request.index(), request.sub(), static_cast<std::uint32_t>(abort));
}

}  // namespace servodrome::serial10
