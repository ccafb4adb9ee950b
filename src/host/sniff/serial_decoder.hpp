#pragma once

#include <map>
#include <memory>
#include <optional>

#include "host/sniff/modbus_words.hpp"
#include "links/serial/sender.hpp"
#include "serial10/frame.hpp"

namespace servodrome::host {

using links::SerialSender;

// A serial line in words: Modbus RTU and the 10-byte protocol of the iSMK, from the bytes as they came. Sans-IO. Frames
// are found by their length and checksum, wherever the pieces end; requests and answers are told apart by their length
// and by what was asked before, or by their sender where that is known. What is no frame is said to be garbage.
class SerialDecoder {
 public:
  // Silence that ends a frame for sure. Longer than an operating system and an adapter hold bytes back.
  static constexpr Time longest_gap = std::chrono::milliseconds(50);

  SerialDecoder();
  // What a station is (1..247), or every station (0) that is not told apart.
  void set_model(unsigned station, SerialModel model);

  std::vector<Decoded> decode(std::span<const std::uint8_t> bytes, Time time,
                              SerialSender sender = SerialSender::unknown);
  // Nothing more comes of what was begun.
  std::vector<Decoded> finish();

 private:
  struct Found {
    std::size_t size = 0;  // 0: no frame begins here, or more bytes are needed
    bool is_serial10 = false;
    bool is_answer = false;
    bool is_open = false;  // it might, with more bytes
  };

  const SerialModel& model_of(unsigned station) const;
  Found find(std::span<const std::uint8_t> bytes, bool all_there) const;
  void take(std::vector<Decoded>& all, bool all_there);
  void give_up(std::size_t bytes, std::vector<Decoded>& all);
  Decoded decode_rtu(std::span<const std::uint8_t> frame, bool is_answer);
  Decoded decode_serial10(const serial10::Frame& frame);

  std::shared_ptr<const SerialModel> standard_;
  std::map<unsigned, std::shared_ptr<const SerialModel>> models_;
  std::vector<std::uint8_t> bytes_;  // not yet understood
  std::vector<std::uint8_t> garbage_;
  Time time_{};
  SerialSender sender_ = SerialSender::unknown;
  std::optional<ModbusRequest> request_;
};

}  // namespace servodrome::host
