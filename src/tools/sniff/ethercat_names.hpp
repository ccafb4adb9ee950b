#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "ethercat/frame/datagram.hpp"

// Names for the contents of EtherCAT datagrams.
namespace servodrome::master {

const char* name(ethercat::Command command);  // for example "FPRD"; nullptr: no such command

// For example "AL status", "FMMU 1", "sync manager 2 status", "register 0F00h" (ETG.1000.4 tables 31 to 63).
std::string register_name(std::uint16_t address);

// Text for the bytes at `address`, for example "AL status OP" or "DL status 0531h".
std::string register_text(std::uint16_t address, std::span<const std::uint8_t> data);

}  // namespace servodrome::master
