#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "ethercat/frame/datagram.hpp"

// Names of what is in EtherCAT datagrams.
namespace servodrome::host {

const char* name(ethercat::Command command);  // "FPRD"; nullptr: there is none of this number

// "AL status", "FMMU 1", "sync manager 2 status", "register 0F00h" (ETG.1000.4 tables 31 to 63).
std::string register_name(std::uint16_t address);

// "AL status OP", "DL status 0531h": what the bytes at `address` say.
std::string register_text(std::uint16_t address, std::span<const std::uint8_t> data);

}  // namespace servodrome::host
