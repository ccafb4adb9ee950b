#include "modbus/tcp_connection.hpp"

namespace servodrome::modbus {

std::size_t TcpConnection::receive(std::span<const std::uint8_t> bytes) {
  std::size_t taken = 0;
  to_send_ = 0;
  while (taken < bytes.size() && !is_broken_) {
    const Mbap header = Mbap::read(frame_.data());
    const std::size_t wanted = received_ < Mbap::size ? Mbap::size : Mbap::size - 1 + header.length;
    const std::size_t piece = std::min(wanted - received_, bytes.size() - taken);
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(taken), piece,
                frame_.begin() + static_cast<std::ptrdiff_t>(received_));
    received_ += piece;
    taken += piece;
    if (received_ < wanted) break;
    if (wanted == Mbap::size) {
      is_broken_ = !Mbap::read(frame_.data()).is_valid();
    } else {
      answer();
      break;
    }
  }
  return is_broken_ ? bytes.size() : taken;
}

void TcpConnection::answer() {
  Mbap header = Mbap::read(frame_.data());
  const auto request = std::span<const std::uint8_t>(frame_).subspan(Mbap::size, received_ - Mbap::size);
  std::array<std::uint8_t, longest_pdu> response;
  std::size_t length = 2;
  if (Server* server = units_.find(header.unit)) {
    length = server->answer(request, response);
  } else {
    response[0] = static_cast<std::uint8_t>(request[0] | error_bit);
    response[1] = static_cast<std::uint8_t>(Exception::gateway_target_failed_to_respond);
  }
  header.length = static_cast<std::uint16_t>(1 + length);
  header.write(frame_.data());
  std::copy_n(response.begin(), length, frame_.begin() + Mbap::size);
  to_send_ = Mbap::size + length;
  received_ = 0;
}

}  // namespace servodrome::modbus
