#pragma once

#include <cstdio>
#include <sstream>
#include <string>
#include <vector>

#include "canopen/frame.hpp"

// Frames in the notation of the manuals: "602 # 23 FF 60 00 E8 03 00 00", or "701 # RTR" for a remote frame.
namespace servodrome::test {

inline canopen::Frame frame_of(const std::string& text) {
  canopen::Frame frame{};
  std::istringstream words(text);
  std::string word;
  words >> word;
  frame.id = static_cast<std::uint32_t>(std::stoul(word, nullptr, 16));
  words >> word;  // '#'
  while (words >> word) {
    if (word == "RTR") {
      frame.remote = true;
      break;
    }
    frame.data[frame.length++] = static_cast<std::uint8_t>(std::stoul(word, nullptr, 16));
  }
  return frame;
}

inline std::string text_of(const canopen::Frame& frame) {
  char buffer[8];
  std::snprintf(buffer, sizeof buffer, "%03X #", static_cast<unsigned>(frame.id));
  std::string text = buffer;
  for (std::uint8_t i = 0; i < frame.length; ++i) {
    std::snprintf(buffer, sizeof buffer, " %02X", static_cast<unsigned>(frame.data[i]));
    text += buffer;
  }
  return frame.remote ? text + " RTR" : text;
}

}  // namespace servodrome::test
