#pragma once

#include <string>

#include "canopen/frame.hpp"
#include "host/object_catalogue.hpp"

namespace servodrome::host {

// What a frame is, by the predefined connection set (CiA 301 table 39): "node 5  SDO  read 6041:00 Statusword",
// "node 5  EMCY 3210h DC link over-voltage ...", "NMT  start node 5". Frames of other identifiers: "".
std::string describe(const canopen::Frame& frame, const ObjectCatalogue& catalogue = ObjectCatalogue::standard());

// "585 [8] 4B 41 60 00 37 02 00 00", "701 [1] remote"
std::string raw_text(const canopen::Frame& frame);

}  // namespace servodrome::host
