#pragma once

#include <deque>
#include <memory>
#include <string>

#include "studio/traffic_source.hpp"

namespace servodrome::studio {

// A frame, or on EtherCAT a datagram, in words.
struct TrafficRow {
  std::uint64_t number = 0;  // of the frame
  std::string from{};        // axis, or "master", "slaves"
  host::Decoded decoded{};
};

// What passed on one bus: recorded, and in words as far as clients have asked for them. Words are made in small pieces
// (decode_some), because that happens in the thread that drives the line.
class TrafficView {
 public:
  static constexpr std::size_t ring_bytes = std::size_t{4} * 1024 * 1024;
  static constexpr std::size_t most_rows = 10'000;

  explicit TrafficView(std::unique_ptr<TrafficSource> source) : source_(std::move(source)) {}

  // Recording begins with what is known of the drives at that time. What was recorded before stays.
  void record(bool on);
  bool recording() const { return tap_ != nullptr; }
  // Forgets what was recorded.
  void clear();

  const line::TrafficRing& ring() const { return ring_; }
  // What has come up to now is in the ring.
  void flush() {
    if (tap_) tap_->flush();
  }
  // Puts at most so many frames into words; false: there are no more.
  bool decode_some(unsigned frames);
  // Frames that are in words; the next has the number decoded() + 1.
  std::uint64_t decoded() const { return cursor_.number - 1; }
  const std::deque<TrafficRow>& rows() const { return rows_; }
  // Rows that were there before rows().front().
  std::uint64_t forgotten_rows() const { return forgotten_rows_; }
  // Number of the first frame whose rows are still there.
  std::uint64_t first_kept() const { return first_kept_; }
  // Frames that were overwritten before a client asked for their words.
  std::uint64_t missed() const { return missed_; }
  const TrafficSource& source() const { return *source_; }

 private:
  void decode(const line::TrafficFrame& frame);
  void add(const line::TrafficFrame& frame, host::Decoded decoded);
  std::string sender_of(const line::TrafficFrame& frame) const;

  std::unique_ptr<TrafficSource> source_;
  line::TrafficRing ring_{ring_bytes};
  std::unique_ptr<line::TrafficTap> tap_;
  line::TrafficRing::Cursor cursor_{1, 0};
  TrafficDecoders decoders_;
  std::deque<TrafficRow> rows_;
  std::uint64_t first_kept_ = 1;
  std::uint64_t forgotten_rows_ = 0;
  std::uint64_t missed_ = 0;
};

}  // namespace servodrome::studio
