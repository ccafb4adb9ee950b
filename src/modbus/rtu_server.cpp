#include "modbus/rtu_server.hpp"

namespace servodrome::modbus {

void RtuServer::reset(const RtuTiming& timing) {
  timing_ = timing;
  is_receiving_ = false;
  to_send_ = 0;
}

// Reception as in figure 14 of the standard: timers run from the end of each character. A character after the silence
// belongs to the next frame even if poll() was not called in between. A pause of more than 1.5 characters after a
// complete frame also ends that frame. So the server still receives a request that the master sends too soon after the
// answer of another station.
void RtuServer::start_character(Time at) {
  poll(at);
  const Time pause = at - last_ - timing_.character;
  if (is_receiving_ && 2 * pause > 3 * timing_.character && !is_spoilt_ &&
      is_rtu_frame(std::span(frame_).first(received_))) {
    is_receiving_ = false;
  }
  if (!is_receiving_) {
    is_receiving_ = true;
    is_spoilt_ = false;
    received_ = 0;
    to_send_ = 0;
  } else if (timing_.inter_character > Time{0} && pause > timing_.inter_character) {
    is_spoilt_ = true;
  }
  last_ = at;
}

void RtuServer::receive(std::uint8_t character, Time at) {
  start_character(at);
  if (received_ < frame_.size()) {
    frame_[received_++] = character;
  } else {
    is_spoilt_ = true;
  }
}

void RtuServer::receive_garbled(Time at) {
  start_character(at);
  is_spoilt_ = true;
}

void RtuServer::end_frame() {
  is_receiving_ = false;
  const auto frame = std::span<const std::uint8_t>(frame_).first(received_);
  if (is_spoilt_ || !is_rtu_frame(frame)) return;
  const auto request = frame.subspan(1, frame.size() - 3);
  if (frame[0] == broadcast_station) {
    server_.broadcast(request);
  } else if (frame[0] == station_) {
    std::array<std::uint8_t, longest_pdu> response;
    const std::size_t length = server_.answer(request, response);
    std::copy_n(response.begin(), length, frame_.begin() + 1);
    to_send_ = seal_rtu_frame(frame_, 1 + length);
  }
}

}  // namespace servodrome::modbus
