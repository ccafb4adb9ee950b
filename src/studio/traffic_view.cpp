#include "studio/traffic_view.hpp"

#include <cstring>

namespace servodrome::studio {
namespace {

// The ring stores CAN frames as raw bytes.
canopen::Frame frame_of(std::span<const std::uint8_t> bytes) {
  static_assert(std::is_trivially_copyable_v<canopen::Frame>);
  canopen::Frame frame;
  std::memcpy(&frame, bytes.data(), std::min(bytes.size(), sizeof frame));
  return frame;
}

}  // namespace

void TrafficView::record(bool on) {
  if (on == recording()) return;
  if (!on) {
    flush();
    tap_.reset();
    return;
  }
  while (decode_some(1000)) {
  }
  source_->introduce(decoders_);
  tap_ = source_->tap(ring_);
}

void TrafficView::clear() {
  const bool was_on = recording();
  tap_.reset();
  // Numbers continue, so that clients do not confuse a new frame with an old one.
  cursor_ = ring_.clear();
  forgotten_rows_ += rows_.size();
  rows_.clear();
  first_kept_ = cursor_.number;
  if (was_on) record(true);
}

bool TrafficView::decode_some(unsigned frames) {
  for (unsigned i = 0; i < frames; ++i) {
    const std::uint64_t expected = cursor_.number;
    const auto frame = ring_.next(cursor_);
    if (!frame) return false;
    missed_ += frame->number - expected;
    decode(*frame);
  }
  return true;
}

std::optional<line::Time> TrafficView::next_time() const {
  line::TrafficRing::Cursor cursor = cursor_;
  const auto frame = ring_.next(cursor);
  return frame ? std::optional(frame->at) : std::nullopt;
}

master::Decoded TrafficView::decoded_aside(const canopen::Frame& frame, line::Time at) const {
  master::CanDecoder copy = decoders_.can;
  return copy.decode(frame, at);
}

std::string TrafficView::sender_of(const line::TrafficFrame& frame) const {
  switch (frame.kind) {
    case line::TrafficKind::ethernet_out: return "master";
    case line::TrafficKind::ethernet_in: return "slaves";
    case line::TrafficKind::modbus_tcp: return frame.from_master ? "master" : "drive";
    default: break;
  }
  std::string sender = source_->sender(frame.sender);
  return sender.empty() ? "master" : sender;
}

bool TrafficView::has_heard_master() const {
  if (ring_.oldest() > 1) return true;
  line::TrafficRing::Cursor cursor = ring_.begin();
  while (const auto frame = ring_.next(cursor)) {
    if (frame->kind != line::TrafficKind::can_error && sender_of(*frame) == "master") return true;
  }
  return false;
}

void TrafficView::add(const line::TrafficFrame& frame, master::Decoded decoded) {
  rows_.push_back({frame.number, sender_of(frame), std::move(decoded)});
  if (rows_.size() <= most_rows) return;
  // Removes all rows of a frame together.
  first_kept_ = rows_.front().number + 1;
  while (!rows_.empty() && rows_.front().number < first_kept_) {
    rows_.pop_front();
    ++forgotten_rows_;
  }
}

void TrafficView::decode(const line::TrafficFrame& frame) {
  switch (frame.kind) {
    case line::TrafficKind::can:
    case line::TrafficKind::can_dropped: {
      master::Decoded decoded = decoders_.can.decode(frame_of(frame.bytes), frame.at);
      if (frame.kind == line::TrafficKind::can_dropped) {
        decoded.error = true;
        decoded.text += " (lost: no node received it)";
      }
      add(frame, std::move(decoded));
      break;
    }
    case line::TrafficKind::can_error: {
      master::Decoded decoded;
      decoded.time = frame.at;
      decoded.kind = master::FrameKind::error;
      decoded.error = true;
      decoded.raw = master::raw_text(frame_of(frame.bytes));
      decoded.text = "error frame: the frame is repeated";
      add(frame, std::move(decoded));
      break;
    }
    case line::TrafficKind::ethernet_out:
    case line::TrafficKind::ethernet_in:
      for (master::Decoded& one : decoders_.ethercat.decode(frame.bytes, frame.at)) add(frame, std::move(one));
      break;
    case line::TrafficKind::serial: {
      const auto side = frame.from_master ? links::SerialSender::master : links::SerialSender::drive;
      for (master::Decoded& one : decoders_.serial.decode(frame.bytes, frame.at, side)) add(frame, std::move(one));
      break;
    }
    case line::TrafficKind::modbus_tcp:
      add(frame, decoders_.modbus_tcp.decode_message(frame.bytes, frame.at, frame.from_master, 0));
      break;
  }
}

}  // namespace servodrome::studio
