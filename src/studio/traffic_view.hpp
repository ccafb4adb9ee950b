#pragma once

#include <deque>
#include <memory>
#include <string>

#include "studio/traffic_source.hpp"

namespace servodrome::studio {

// A decoded frame; on EtherCAT a decoded datagram.
struct TrafficRow {
  std::uint64_t number = 0;  // number of the frame
  std::string from{};        // axis name, "master" or "slaves"
  master::Decoded decoded{};
};

// The recorded traffic of one bus. It is decoded lazily, when clients request it, and in small pieces (decode_some),
// because this happens in the thread that runs the line.
class TrafficView {
 public:
  static constexpr std::size_t ring_bytes = std::size_t{4} * 1024 * 1024;
  static constexpr std::size_t most_rows = 10'000;

  explicit TrafficView(std::unique_ptr<TrafficSource> source, std::size_t bytes = ring_bytes)
      : source_(std::move(source)), ring_(bytes) {}

  // Starts or stops recording. Starting presets the decoders with the present data of the drives. Earlier records are
  // kept.
  void record(bool on);
  bool recording() const { return tap_ != nullptr; }
  // Deletes all records.
  void clear();

  const line::TrafficRing& ring() const { return ring_; }
  // Makes all frames up to now available in the ring.
  void flush() {
    if (tap_) tap_->flush();
  }
  // Decodes at most this many frames; returns false if there are no more.
  bool decode_some(unsigned frames);
  // The time of the frame that decode_some decodes next; none: all are decoded.
  std::optional<line::Time> next_time() const;
  // A frame that did not pass on this CAN bus, decoded as if it passed now.
  master::Decoded decoded_aside(const canopen::Frame& frame, line::Time at) const;
  // True if the ring has a frame of a master, or is full.
  bool has_heard_master() const;
  // Number of decoded frames; the next frame has the number decoded() + 1.
  std::uint64_t decoded() const { return cursor_.number - 1; }
  const std::deque<TrafficRow>& rows() const { return rows_; }
  // Number of dropped rows, which came before rows().front().
  std::uint64_t forgotten_rows() const { return forgotten_rows_; }
  // Number of the first frame whose rows are still kept.
  std::uint64_t first_kept() const { return first_kept_; }
  // Frames that were overwritten before they were decoded.
  std::uint64_t missed() const { return missed_; }
  const TrafficSource& source() const { return *source_; }

 private:
  void decode(const line::TrafficFrame& frame);
  void add(const line::TrafficFrame& frame, master::Decoded decoded);
  std::string sender_of(const line::TrafficFrame& frame) const;

  std::unique_ptr<TrafficSource> source_;
  line::TrafficRing ring_;
  std::unique_ptr<line::TrafficTap> tap_;
  line::TrafficRing::Cursor cursor_{1, 0};
  TrafficDecoders decoders_;
  std::deque<TrafficRow> rows_;
  std::uint64_t first_kept_ = 1;
  std::uint64_t forgotten_rows_ = 0;
  std::uint64_t missed_ = 0;
};

}  // namespace servodrome::studio
