#pragma once

#include <string>

#include "canopen/frame.hpp"

// Text for the CANopen services whose frames can be decoded without context.
namespace servodrome::master {

std::string nmt_text(const canopen::Frame& frame);   // "NMT start: node 5" (CiA 301 7.2.8.3.1)
std::string time_text(const canopen::Frame& frame);  // "TIME 2024-05-17 08:30:00.250" (CiA 301 7.1.6.6)
std::string lss_text(const canopen::Frame& frame);   // "LSS configure node-ID 5" (CiA 305 clause 3)

}  // namespace servodrome::master
