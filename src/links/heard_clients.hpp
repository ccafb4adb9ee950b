#pragma once

#include <functional>
#include <memory>
#include <span>

#include "links/can/client.hpp"
#include "links/ethercat/client.hpp"
#include "links/serial/client.hpp"

// Clients that report what they send and receive, when it passes.
namespace servodrome::links {

// `bytes`: of CAN a canopen::Frame, of EtherCAT a frame's content, of a serial line or TCP whatever came at once.
using Heard = std::function<void(bool sent, std::span<const std::uint8_t> bytes)>;

// The client itself if `hear` is empty.
std::unique_ptr<CanClient> heard(std::unique_ptr<CanClient> client, Heard hear);
std::unique_ptr<EthercatClient> heard(std::unique_ptr<EthercatClient> client, Heard hear);
std::unique_ptr<ByteClient> heard(std::unique_ptr<ByteClient> client, Heard hear);

}  // namespace servodrome::links
