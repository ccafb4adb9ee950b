#pragma once

#include <array>

#include "tools/conform/trial.hpp"

// Raw frames, including those that a correct client never sends, and the answers to them.
namespace servodrome::master::conform {

using SdoFrame = std::array<std::uint8_t, 8>;

// Sends to the node's default SDO server; nullopt: no answer in time.
std::optional<SdoFrame> ask_sdo(Trial& trial, const SdoFrame& request, Time timeout = std::chrono::seconds(1));
unsigned count_sdo_answers(Trial& trial, const SdoFrame& request, Time span);
// For example "SDO 40 00 10 00 00 00 00 00".
std::string text_of_sdo(const SdoFrame& frame);

// A received frame with its time of arrival.
struct Arrival {
  Time at;
  Frame frame;
};
class Watch {
 public:
  Watch(Bus& bus, std::uint32_t can_id);
  const std::vector<Arrival>& arrivals() const { return arrivals_; }
  void forget() { arrivals_.clear(); }

 private:
  std::vector<Arrival> arrivals_;
  Bus::Subscription listening_;
};

}  // namespace servodrome::master::conform
