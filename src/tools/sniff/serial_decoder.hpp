#pragma once

#include <map>
#include <memory>
#include <optional>

#include "links/serial/sender.hpp"
#include "serial10/frame.hpp"
#include "tools/sniff/modbus_words.hpp"

namespace servodrome::master {

using links::SerialSender;

// Decodes a serial line to text: Modbus RTU and the 10-byte protocol of the iSMK. A pure state machine without input or
// output. Finds frames by length and checksum, independent of how the bytes are split into pieces. Distinguishes
// requests from answers by their length and by the preceding request, or by the sender if it is known. Reports
// everything else as garbage.
class SerialDecoder {
 public:
  // Silence after which a frame has ended. Longer than the buffering delays of operating systems and adapters.
  static constexpr Time longest_gap = std::chrono::milliseconds(50);

  SerialDecoder();
  // Sets the model of a station (1..247), or of all stations without a model of their own (0).
  void set_model(unsigned station, SerialModel model);

  std::vector<Decoded> decode(std::span<const std::uint8_t> bytes, Time time,
                              SerialSender sender = SerialSender::unknown);
  // Decodes the remaining bytes after the end of the input.
  std::vector<Decoded> finish();

 private:
  struct Found {
    std::size_t size = 0;  // 0: no frame, or more bytes are needed
    bool is_serial10 = false;
    bool is_answer = false;
    bool is_open = false;  // it may become a frame with more bytes
  };

  const SerialModel& model_of(unsigned station) const;
  Found find(std::span<const std::uint8_t> bytes, bool all_there) const;
  void take(std::vector<Decoded>& all, bool all_there);
  void give_up(std::size_t bytes, std::vector<Decoded>& all);
  Decoded decode_rtu(std::span<const std::uint8_t> frame, bool is_answer);
  Decoded decode_serial10(const serial10::Frame& frame);

  std::shared_ptr<const SerialModel> standard_;
  std::map<unsigned, std::shared_ptr<const SerialModel>> models_;
  std::vector<std::uint8_t> bytes_;  // bytes not decoded yet
  std::vector<std::uint8_t> garbage_;
  Time time_{};
  SerialSender sender_ = SerialSender::unknown;
  std::optional<ModbusRequest> request_;
};

}  // namespace servodrome::master
