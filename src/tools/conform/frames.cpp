#include "tools/conform/frames.hpp"

#include <algorithm>

namespace servodrome::master::conform {

namespace {

Frame frame_of(std::uint32_t can_id, const SdoFrame& data) {
  Frame frame;
  frame.id = can_id;
  frame.length = 8;
  frame.data = data;
  return frame;
}

}  // namespace

Watch::Watch(Bus& bus, std::uint32_t can_id)
    : listening_(bus.listen([this, &bus, can_id](const Frame& frame) {
        if (frame.id == can_id && !frame.extended && !frame.remote) arrivals_.push_back({bus.now(), frame});
      })) {}

std::optional<SdoFrame> ask_sdo(Trial& trial, const SdoFrame& request, Time timeout) {
  auto& [bus, sdo] = trial.subject().can();
  bus.drain();
  const Watch answers(bus, 0x580U + sdo.node_id());
  bus.send(frame_of(0x600U + sdo.node_id(), request));
  bus.run_until(bus.now() + timeout, [&] { return !answers.arrivals().empty(); });
  if (answers.arrivals().empty()) return std::nullopt;
  return answers.arrivals().front().frame.data;
}

unsigned count_sdo_answers(Trial& trial, const SdoFrame& request, Time span) {
  auto& [bus, sdo] = trial.subject().can();
  bus.drain();
  const Watch answers(bus, 0x580U + sdo.node_id());
  bus.send(frame_of(0x600U + sdo.node_id(), request));
  bus.run_for(span);
  return static_cast<unsigned>(answers.arrivals().size());
}

std::string text_of_sdo(const SdoFrame& frame) {
  std::string text = "SDO";
  for (const std::uint8_t byte : frame) text += fmt::format(" {:02X}", byte);
  return text;
}

}  // namespace servodrome::master::conform
