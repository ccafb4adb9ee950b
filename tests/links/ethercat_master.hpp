#pragma once

#include <memory>
#include <utility>

#include "links/ethercat/client.hpp"
#include "links/ethercat_rig.hpp"

namespace servodrome::links::test {

constexpr Time patience = 10s;  // limits the duration of a failed test

// Sends frames that all slaves count.
struct Master {
  explicit Master(std::unique_ptr<EthercatClient> its_client) : client(std::move(its_client)) {}

  void send(std::uint8_t index) {
    OneDatagram frame(Command::brd, 0, Bytes(2), true);
    frame.bytes[3] = index;
    client->send(frame.bytes);
  }
  // Returns index and working counter of the next frame; 0, 0 if none came.
  std::pair<unsigned, unsigned> receive(Time timeout = patience) {
    std::array<std::uint8_t, ethercat::max_payload> memory{};
    const std::size_t size = client->receive(memory, timeout);
    ethercat::Frame frame;
    if (size == 0 || ethercat::parse_payload(std::span(memory).first(size), frame) != ethercat::FrameKind::ethercat) {
      return {};
    }
    return {memory[3], frame.datagrams()[0].working_counter()};
  }

  std::unique_ptr<EthercatClient> client;
};

using Answer = std::pair<unsigned, unsigned>;

}  // namespace servodrome::links::test
