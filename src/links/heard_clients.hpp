#pragma once

#include <functional>
#include <memory>
#include <span>

#include "links/can/client.hpp"
#include "links/ethercat/client.hpp"
#include "links/serial/client.hpp"

// Clients that report each message that they send or receive.
namespace servodrome::links {

// `bytes`: for CAN a canopen::Frame, for EtherCAT the content of a frame, for a serial line or TCP the bytes of one
// call.
using Heard = std::function<void(bool sent, std::span<const std::uint8_t> bytes)>;

// Returns the client itself if `hear` is empty.
std::unique_ptr<CanClient> heard(std::unique_ptr<CanClient> client, Heard hear);
std::unique_ptr<EthercatClient> heard(std::unique_ptr<EthercatClient> client, Heard hear);
std::unique_ptr<ByteClient> heard(std::unique_ptr<ByteClient> client, Heard hear);

}  // namespace servodrome::links
