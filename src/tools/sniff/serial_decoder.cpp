#include "tools/sniff/serial_decoder.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "dictionary/abort_code.hpp"
#include "modbus/pdu.hpp"
#include "modbus/rtu_server.hpp"

namespace servodrome::master {
namespace {

constexpr std::size_t more_needed = 1;  // incomplete; no frame has this length

// Length of the RTU frame, as a request, that begins here: 0 if it cannot be a request, `more_needed` if more bytes are
// needed (Modbus Application Protocol V1.1b3, 6, with station and CRC).
std::size_t rtu_request_length(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 2) return more_needed;
  const auto behind_count = [&](std::size_t at) { return bytes.size() > at ? at + 3 + bytes[at] : more_needed; };
  switch (bytes[1]) {
    case 0x01:
    case 0x02:
    case 0x03:
    case 0x04:
    case 0x05:
    case 0x06:
    case 0x08: return 8;
    case 0x07:
    case 0x0B:
    case 0x0C:
    case 0x11: return 4;
    case 0x0F:
    case 0x10: return behind_count(6);
    case 0x16: return 10;
    case 0x17: return behind_count(10);
    case 0x18: return 6;
    case 0x2B: return bytes.size() < 3 ? more_needed : bytes[2] == modbus::read_device_identification ? 7 : 0;
    default: return 0;
  }
}

// The same for an answer.
std::size_t rtu_answer_length(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 2) return more_needed;
  if ((bytes[1] & modbus::error_bit) != 0) return 5;
  switch (bytes[1]) {
    case 0x01:
    case 0x02:
    case 0x03:
    case 0x04:
    case 0x0C:
    case 0x11:
    case 0x17: return bytes.size() > 2 ? 5U + bytes[2] : more_needed;
    case 0x05:
    case 0x06:
    case 0x08:
    case 0x0B:
    case 0x0F:
    case 0x10: return 8;
    case 0x07: return 5;
    case 0x16: return 10;
    case 0x2B: {
      if (bytes.size() < 3) return more_needed;
      if (bytes[2] != modbus::read_device_identification) return 0;
      std::size_t at = 8;
      for (unsigned i = 0; bytes.size() > 7 && i < bytes[7] && at < modbus::longest_rtu_frame; ++i) {
        if (bytes.size() < at + 2) return more_needed;
        at += 2U + bytes[at + 1];
      }
      return bytes.size() < 8 ? more_needed : at + 2;
    }
    default: return 0;
  }
}

bool is_serial10_command(std::uint8_t byte) {
  using serial10::Command;
  switch (static_cast<Command>(byte)) {
    case Command::write_4:
    case Command::write_2:
    case Command::write_1:
    case Command::read:
    case Command::read_4:
    case Command::read_2:
    case Command::read_1:
    case Command::written:
    case Command::error: return true;
  }
  return false;
}

}  // namespace

SerialDecoder::SerialDecoder() : standard_(SerialModel::standard()) {}

void SerialDecoder::set_model(unsigned station, SerialModel model) {
  models_[station] = std::make_shared<const SerialModel>(std::move(model));
}

const SerialModel& SerialDecoder::model_of(unsigned station) const {
  for (const unsigned one : {station, 0U}) {
    if (const auto found = models_.find(one); found != models_.end()) return *found->second;
  }
  // A single model applies to all station numbers, such as 127 of the 10-byte protocol.
  return models_.size() == 1 ? *models_.begin()->second : *standard_;
}

std::vector<Decoded> SerialDecoder::decode(std::span<const std::uint8_t> bytes, Time time, SerialSender sender) {
  std::vector<Decoded> all;
  const bool is_another = sender != sender_;
  if (is_another || (!bytes_.empty() && time - time_ > longest_gap)) take(all, true);
  sender_ = sender;
  time_ = time;
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  take(all, false);
  return all;
}

std::vector<Decoded> SerialDecoder::finish() {
  std::vector<Decoded> all;
  take(all, true);
  return all;
}

// Finds a frame at the start of `bytes`. `all_there`: a silence followed the bytes, so the frame has no more bytes.
SerialDecoder::Found SerialDecoder::find(std::span<const std::uint8_t> bytes, bool all_there) const {
  Found found;
  if (bytes[0] > modbus::highest_station) return found;
  const bool awaited = request_ && request_->unit == bytes[0];
  for (const bool answer : {awaited, !awaited}) {
    if (sender_ == SerialSender::master && answer) continue;
    if (sender_ == SerialSender::drive && !answer) continue;
    const std::size_t length = answer ? rtu_answer_length(bytes) : rtu_request_length(bytes);
    if (length == 0 || length > modbus::longest_rtu_frame) continue;
    if (length == more_needed || length > bytes.size()) {
      found.is_open = !all_there;
    } else if (modbus::is_rtu_frame(bytes.first(length))) {
      // The answer to function 06 equals its request. If this request is outstanding, the frame is its answer.
      const bool is_echo = awaited && request_->function == answered_function(bytes[1], model_of(bytes[0]));
      if (sender_ == SerialSender::unknown && answer && rtu_request_length(bytes) == length && !is_echo) {
        return {length, false, false, false};
      }
      return {length, false, answer, false};
    }
  }
  if (bytes.size() >= 2 && is_serial10_command(bytes[1]) && bytes[0] <= serial10::universal_id) {
    if (bytes.size() < serial10::frame_bytes) {
      found.is_open = found.is_open || !all_there;
    } else {
      serial10::Frame frame;
      std::copy_n(bytes.begin(), serial10::frame_bytes, frame.bytes.begin());
      if (frame.is_intact()) return {serial10::frame_bytes, true, false, false};
    }
  }
  if (bytes.size() < 2) found.is_open = !all_there;
  return found;
}

void SerialDecoder::take(std::vector<Decoded>& all, bool all_there) {
  while (!bytes_.empty()) {
    Found found = find(bytes_, all_there);
    if (found.size == 0 && found.is_open) {
      // The apparent start of a frame may be the rest of a damaged one, so a complete frame after it is accepted.
      std::size_t ahead = 0;
      for (std::size_t at = 1; at + 4 <= bytes_.size() && ahead == 0; ++at) {
        const Found later = find(std::span(bytes_).subspan(at), false);
        if (later.size != 0 && !later.is_serial10) ahead = at;
      }
      if (ahead == 0) return;
      give_up(ahead, all);
      continue;
    }
    // The tables do not contain the length of an unknown function, so the frame ends at the silence.
    if (found.size == 0 && all_there && garbage_.empty() && modbus::is_rtu_frame(bytes_)) {
      const bool awaited = request_ && request_->unit == bytes_[0];
      found = {bytes_.size(), false, sender_ == SerialSender::unknown ? awaited : sender_ == SerialSender::drive,
               false};
    }
    if (found.size == 0) {
      garbage_.push_back(bytes_.front());
      bytes_.erase(bytes_.begin());
      continue;
    }
    give_up(0, all);
    const std::span<const std::uint8_t> frame = std::span(bytes_).first(found.size);
    if (found.is_serial10) {
      serial10::Frame parsed;
      std::copy(frame.begin(), frame.end(), parsed.bytes.begin());
      all.push_back(decode_serial10(parsed));
    } else {
      all.push_back(decode_rtu(frame, found.is_answer));
    }
    all.back().time = time_;
    all.back().raw = hex_text(frame);
    bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(found.size));
  }
  if (all_there) give_up(0, all);
}

// Reports the collected garbage and the next `bytes` bytes as invalid.
void SerialDecoder::give_up(std::size_t bytes, std::vector<Decoded>& all) {
  garbage_.insert(garbage_.end(), bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(bytes));
  bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(bytes));
  if (garbage_.empty()) return;
  Decoded decoded;
  decoded.time = time_;
  decoded.error = true;
  decoded.raw = hex_text(garbage_);
  decoded.text = garbage_.size() == 1
                     ? "1 byte outside a frame: checksum or length is wrong"
                     : fmt::format("{} bytes outside a frame: checksum or length is wrong", garbage_.size());
  all.push_back(std::move(decoded));
  garbage_.clear();
}

Decoded SerialDecoder::decode_rtu(std::span<const std::uint8_t> frame, bool is_answer) {
  Decoded decoded;
  const std::uint8_t unit = frame[0];
  const SerialModel& model = model_of(unit);
  const std::span<const std::uint8_t> pdu = frame.subspan(1, frame.size() - 3);
  if (unit != modbus::broadcast_station) {
    decoded.node = unit;
    decoded.source = fmt::format("station {}", unit);
  }
  if (is_answer) {
    const bool is_awaited = request_ && request_->unit == unit &&
                            (request_->function == pdu[0] || request_->function == answered_function(pdu[0], model));
    describe_modbus_response(pdu, is_awaited ? &*request_ : nullptr, model, decoded);
    request_.reset();
  } else {
    request_ = describe_modbus_request(unit, pdu, model, decoded);
    if (unit == modbus::broadcast_station) {  // a broadcast has no answer
      request_.reset();
      decoded.source = "all stations";
    }
  }
  return decoded;
}

// 10-byte protocol: iSMK manual, ch. 8.4.
Decoded SerialDecoder::decode_serial10(const serial10::Frame& frame) {
  using serial10::Command;
  Decoded decoded;
  decoded.kind = FrameKind::serial10;
  decoded.node = frame.id();
  decoded.source = frame.id() == serial10::universal_id ? "any id" : fmt::format("id {}", frame.id());
  const SerialModel& model = model_of(frame.id());
  const ObjectAddress object{frame.index(), frame.sub()};
  decoded.objects.push_back(object);
  const std::string title = model.catalogue.title(object);
  const auto value = [&] {
    const std::size_t size = serial10::data_bytes(frame.command());
    const std::uint32_t data = frame.data();
    std::vector<std::byte> bytes;
    for (std::size_t i = 0; i < size; ++i) bytes.push_back(std::byte(data >> (8 * i)));
    decoded.values.push_back(decoded_value(object, bytes, model.catalogue));
    return decoded.values.back().text;
  };
  switch (frame.command()) {
    case Command::write_4:
    case Command::write_2:
    case Command::write_1: decoded.text = fmt::format("write {} = {}", title, value()); break;
    case Command::read: decoded.text = "read " + title; break;
    case Command::read_4:
    case Command::read_2:
    case Command::read_1: decoded.text = fmt::format("{} is {}", title, value()); break;
    case Command::written: decoded.text = "written " + title; break;
    case Command::error:
      decoded.error = true;
      decoded.text = fmt::format("error {}: {:04X} {:04X}h {}", title, frame.data() >> 16, frame.data() & 0xFFFF,
                                 dictionary::text(static_cast<dictionary::AbortCode>(frame.data())));
      break;
  }
  return decoded;
}

}  // namespace servodrome::master
