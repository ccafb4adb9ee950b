#include "ethercat/slave/foe_server.hpp"

#include <algorithm>

namespace servodrome::ethercat {

namespace {

// ETG.1000.6 table 86: operation 1, reserved 1, then 4 bytes of password, packet number or error code.
constexpr std::size_t header_size = 6;
constexpr std::uint8_t read_request = 1;
constexpr std::uint8_t write_request = 2;
constexpr std::uint8_t data_request = 3;
constexpr std::uint8_t acknowledge_request = 4;
constexpr std::uint8_t error_request = 5;

void begin(Message& reply, std::uint8_t operation, std::uint32_t value) {
  reply.type = MailboxType::foe;
  reply.length = 0;
  reply.u8(operation);
  reply.u8(0);
  reply.u32(value);
}

}  // namespace

void FoeServer::fail(FoeError error, Message& reply, std::string_view reason) {
  state_ = State::idle;
  begin(reply, error_request, static_cast<std::uint32_t>(error));
  reply.bytes(std::span(reason.data(), std::min(reason.size(), reply.left())));
}

void FoeServer::acknowledge(Message& reply) const { begin(reply, acknowledge_request, packet_); }

void FoeServer::receive(std::span<const std::uint8_t> request, std::size_t packet_size, Message& reply) {
  switch (request[0]) {
    case read_request: open(request, false, reply); break;
    case write_request: open(request, true, reply); break;
    case data_request: take_packet(request, packet_size, reply); break;
    case acknowledge_request:
      if (state_ != State::reading) return fail(FoeError::illegal, reply);
      if (load_u32(&request[2]) != packet_) return fail(FoeError::packet_number_wrong, reply);
      if (last_) {
        state_ = State::idle;
      } else {
        send_packet(reply);
      }
      break;
    case error_request: reset(); break;
    default: fail(FoeError::illegal, reply);
  }
}

void FoeServer::open(std::span<const std::uint8_t> request, bool writes, Message& reply) {
  std::string_view name(reinterpret_cast<const char*>(request.data()) + header_size, request.size() - header_size);
  name = name.substr(0, name.find('\0'));
  const FoeError error = files_->open(name, load_u32(&request[2]), writes);
  if (error != FoeError::none) return fail(error, reply, files_->reason());
  packet_ = position_ = 0;
  state_ = writes ? State::writing : State::reading;
  if (writes) {
    acknowledge(reply);
  } else {
    send_packet(reply);
  }
}

void FoeServer::send_packet(Message& reply) {
  begin(reply, data_request, ++packet_);
  const std::span<std::uint8_t> place = reply.room.subspan(reply.length);
  std::size_t count = 0;
  const FoeError error = files_->read(position_, place, count);
  if (error != FoeError::none) return fail(error, reply, files_->reason());
  reply.add(count);
  position_ += static_cast<std::uint32_t>(count);
  last_ = count < place.size();
}

void FoeServer::take_packet(std::span<const std::uint8_t> request, std::size_t packet_size, Message& reply) {
  if (state_ != State::writing) return fail(FoeError::illegal, reply);
  if (load_u32(&request[2]) != packet_ + 1) return fail(FoeError::packet_number_wrong, reply);
  const std::span<const std::uint8_t> data = request.subspan(header_size);
  const bool last = data.size() < packet_size;
  const FoeError error = files_->write(position_, data, last);
  if (error != FoeError::none) return fail(error, reply, files_->reason());
  ++packet_;
  position_ += static_cast<std::uint32_t>(data.size());
  acknowledge(reply);
  if (last) state_ = State::idle;
}

}  // namespace servodrome::ethercat
