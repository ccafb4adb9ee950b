#include "links/can/slcan_protocol.hpp"

#include <fmt/format.h>

#include "links/number_text.hpp"

namespace servodrome::links::slcan {
namespace {

// Answers to V and N: hardware 1.0, software 1.3 of the CANUSB; a serial number of four characters.
constexpr std::string_view version = "V1013";
constexpr std::string_view serial_number = "NSD01";
constexpr std::uint32_t timing_clock_hz = 8'000'000;  // SJA1000 at 16 MHz
constexpr std::int64_t timestamp_period_ms = 60'000;

std::optional<std::uint32_t> hex_number(std::string_view digits) { return number_of_text<std::uint32_t>(digits, 16); }

bool equal_where_it_matters(std::uint32_t value, std::uint32_t code, std::uint32_t do_not_care) {
  return ((value ^ code) & ~do_not_care) == 0;
}

}  // namespace

std::optional<canopen::Frame> parse_frame(std::string_view line) {
  if (line.empty()) return std::nullopt;
  canopen::Frame frame;
  const char kind = line[0];
  frame.extended = kind == 'T' || kind == 'R';
  frame.remote = kind == 'r' || kind == 'R';
  if (kind != 't' && kind != 'r' && !frame.extended) return std::nullopt;
  const std::size_t id_digits = frame.extended ? 8 : 3;
  if (line.size() < 1 + id_digits + 1) return std::nullopt;
  const auto id = hex_number(line.substr(1, id_digits));
  const char length = line[1 + id_digits];
  if (!id || *id > (frame.extended ? 0x1FFFFFFFU : 0x7FFU) || length < '0' || length > '8') return std::nullopt;
  frame.id = *id;
  frame.length = static_cast<std::uint8_t>(length - '0');
  const std::string_view data = line.substr(2 + id_digits);
  const std::size_t data_digits = frame.remote ? 0U : 2U * frame.length;
  const bool has_timestamp = data.size() == data_digits + 4;
  if (data.size() != data_digits && !has_timestamp) return std::nullopt;
  if (has_timestamp && !hex_number(data.substr(data_digits))) return std::nullopt;
  for (std::size_t i = 0; i < data_digits / 2; ++i) {
    const auto byte = hex_number(data.substr(2 * i, 2));
    if (!byte) return std::nullopt;
    frame.data[i] = static_cast<std::uint8_t>(*byte);
  }
  return frame;
}

std::string format_frame(const canopen::Frame& frame) {
  std::string text = frame.extended ? fmt::format("{}{:08X}{}", frame.remote ? 'R' : 'T', frame.id, frame.length)
                                    : fmt::format("{}{:03X}{}", frame.remote ? 'r' : 't', frame.id, frame.length);
  for (unsigned i = 0; !frame.remote && i < frame.length; ++i) text += fmt::format("{:02X}", frame.data[i]);
  return text;
}

// SJA1000 data sheet, 6.4.15, dual filter configuration: ACR0 is the highest byte of `code`. Base frames are compared
// by identifier, RTR and (filter 1 only) the first data byte, extended frames by identifier bits 28 to 13.
bool AcceptanceFilter::passes(const canopen::Frame& frame) const {
  const std::uint32_t high_code = code >> 16U;
  const std::uint32_t high_mask = mask >> 16U;
  const std::uint32_t low_code = code & 0xFFFFU;
  const std::uint32_t low_mask = mask & 0xFFFFU;
  if (frame.extended) {
    const std::uint32_t top = frame.id >> 13U;
    return equal_where_it_matters(top, high_code, high_mask) || equal_where_it_matters(top, low_code, low_mask);
  }
  const std::uint32_t identifier = (frame.id << 5U) | (frame.remote ? 0x10U : 0U);
  const bool has_data = !frame.remote && frame.length > 0;
  const std::uint32_t no_data = has_data ? 0U : 0xFU;
  const std::uint32_t first = has_data ? frame.data[0] : 0U;
  const bool filter1 = equal_where_it_matters(identifier | (first >> 4U), high_code, high_mask | no_data) &&
                       equal_where_it_matters(first & 0xFU, low_code & 0xFU, low_mask | no_data | ~0xFU);
  const bool filter2 = equal_where_it_matters(identifier, low_code, low_mask | 0xFU);
  return filter1 || filter2;
}

void Adapter::receive(char byte, std::string& answer) {
  if (byte == '\n') return;  // some terminals end a line with CR LF
  if (byte != end_of_line) {
    if (size_ < longest_line) line_[size_] = byte;
    if (size_ <= longest_line) ++size_;
    return;
  }
  const bool fits = size_ <= longest_line;
  const std::string_view line(line_.data(), fits ? size_ : 0);
  size_ = 0;
  if (fits && execute(line, answer)) {
    answer += end_of_line;
  } else {
    ++refused_;
    answer += bell;
  }
}

// Returns true if the command succeeded, after it has appended the answer without its CR.
bool Adapter::execute(std::string_view line, std::string& answer) {
  if (line.empty()) return true;  // hosts send CRs to synchronise
  const std::string_view parameter = line.substr(1);
  const bool closed = state_ == State::closed;
  switch (line[0]) {
    case 'S':
      if (!closed || parameter.size() != 1 || parameter[0] < '0' || parameter[0] > '8') return false;
      controller_.set_bit_rate(bit_rates[static_cast<std::size_t>(parameter[0] - '0')]);
      return true;
    case 's': return closed && set_timing(parameter);
    case 'O':
    case 'L':
      if (!closed || !parameter.empty()) return false;
      state_ = line[0] == 'O' ? State::open : State::listening;
      controller_.open(state_ == State::listening);
      return true;
    case 'C':
      if (closed || !parameter.empty()) return false;
      state_ = State::closed;
      controller_.close();
      return true;
    case 't':
    case 'T':
    case 'r':
    case 'R': {
      const auto frame = parse_frame(line);
      // Only frames to the host may have a timestamp.
      if (state_ != State::open || !frame || line.size() != format_frame(*frame).size()) return false;
      if (!controller_.transmit(*frame)) return false;
      // As the CANUSB does, and the CAN232 while it sends received frames automatically.
      answer += frame->extended ? 'Z' : 'z';
      return true;
    }
    case 'F':
      if (closed || !parameter.empty()) return false;
      answer += fmt::format("F{:02X}", controller_.status_flags());
      return true;
    case 'V':
    case 'N':
      if (!parameter.empty()) return false;
      answer += line[0] == 'V' ? version : serial_number;
      return true;
    case 'Z':
      if (!closed || (parameter != "0" && parameter != "1")) return false;
      timestamps_ = parameter == "1";
      return true;
    case 'M':
    case 'm': {
      const auto value = hex_number(parameter);
      if (!closed || parameter.size() != 8 || !value) return false;
      (line[0] == 'M' ? filter_.code : filter_.mask) = *value;
      return true;
    }
    default: return false;
  }
}

// `sxxyy`: bus timing registers BTR0 and BTR1 of the SJA1000.
bool Adapter::set_timing(std::string_view digits) {
  const auto value = hex_number(digits);
  if (digits.size() != 4 || !value) return false;
  const std::uint32_t prescaler = ((*value >> 8U) & 0x3FU) + 1;
  const std::uint32_t segment1 = (*value & 0xFU) + 1;
  const std::uint32_t segment2 = ((*value >> 4U) & 0x7U) + 1;
  controller_.set_bit_rate(timing_clock_hz / (prescaler * (1 + segment1 + segment2)));
  return true;
}

std::string Adapter::frame_text(const canopen::Frame& frame, Time at) const {
  if (state_ == State::closed || !filter_.passes(frame)) return {};
  std::string text = format_frame(frame);
  if (timestamps_) {
    const auto milliseconds = std::chrono::duration_cast<std::chrono::milliseconds>(at).count();
    text += fmt::format("{:04X}", milliseconds % timestamp_period_ms);
  }
  return text + end_of_line;
}

void Adapter::reset() {
  if (state_ != State::closed) controller_.close();
  state_ = State::closed;
  timestamps_ = false;
  filter_ = {};
  size_ = 0;
}

}  // namespace servodrome::links::slcan
