#pragma once

#include <cstring>

#include "catalogue/product.hpp"
#include "tools/conform/conform_rig.hpp"

namespace servodrome::master::conform::test {

// Modifies frames between master and drive.
class FalseCanClient final : public links::CanClient {
 public:
  using Change = std::function<bool(Frame&)>;  // false: the frame is lost

  FalseCanClient(links::CanBus& bus, links::VirtualClock& clock, const Change& to_drive, const Change& from_drive)
      : client_(bus, clock), to_drive_(to_drive), from_drive_(from_drive) {}

  void send(const Frame& frame) override {
    Frame changed = frame;
    if (!to_drive_ || to_drive_(changed)) client_.send(changed);
  }
  std::optional<Frame> receive(links::Time timeout) override {
    auto frame = client_.receive(timeout);
    if (frame && from_drive_ && !from_drive_(*frame)) return std::nullopt;
    return frame;
  }

 private:
  links::MemoryCanClient client_;
  const Change& to_drive_;
  const Change& from_drive_;
};

struct CanRig {
  explicit CanRig(std::string_view its_product, const std::string& axis_keys = {}, int start_counts = 0,
                  const std::string& more_of_line = {})
      : product(its_product),
        line(settings_of(line_of(its_product, "can", "node = 5\n" + axis_keys, start_counts) + more_of_line)) {
    bus.run_for(200ms);
  }

  Report run(RunOptions options = {}) {
    options.departures = catalogue::product_of(product).departures;
    // The ISMC drive does not report the units of a revolution.
    Subject subject(CanAccess{bus, sdo},
                    {.product = &catalogue::product_of(product),
                     .units_per_revolution = product == "ismc" ? std::optional(131072.0) : std::nullopt,
                     .cancelled = cancelled});
    return run_checks(subject, options);
  }

  std::string_view product;
  std::function<bool()> cancelled{};
  // The master's last writes.
  std::int8_t mode = 0;
  std::uint16_t control = 0;
  bool writes = false;
  std::uint16_t before = 0;  // the previous controlword
  FalseCanClient::Change to_drive;
  FalseCanClient::Change from_drive;
  line::Line line;
  Bus bus{std::make_unique<FalseCanClient>(line.buses()[0]->bus, line, to_drive, from_drive), "mem:", &line};
  SdoClient sdo{bus, 5};
};

// ---- Frames ----

inline bool is_answer(const Frame& frame, std::uint16_t index) {
  return frame.id == 0x585 && (frame.data[0] & 0xE0) == 0x40 && (frame.data[1] | frame.data[2] << 8) == index;
}
inline bool is_write(const Frame& frame, std::uint16_t index) {
  return frame.id == 0x605 && (frame.data[0] & 0xE0) == 0x20 && (frame.data[1] | frame.data[2] << 8) == index;
}
inline std::uint16_t word_in(const Frame& frame) {
  return static_cast<std::uint16_t>(frame.data[4] | frame.data[5] << 8);
}
inline std::uint32_t number_in(const Frame& frame) {
  std::uint32_t number = 0;
  std::memcpy(&number, &frame.data[4], sizeof number);
  return number;
}
inline void put_word(Frame& frame, unsigned value) {
  frame.data[4] = static_cast<std::uint8_t>(value);
  frame.data[5] = static_cast<std::uint8_t>(value >> 8);
}

}  // namespace servodrome::master::conform::test
