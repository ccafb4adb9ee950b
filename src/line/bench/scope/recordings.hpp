#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "line/bench/scope/recording.hpp"

namespace servodrome::line::bench {

// The recordings of a line: they live until they are deleted, or make room for newer ones.
class Recordings {
 public:
  static constexpr std::size_t most_bytes = 64 * 1024 * 1024;     // of all
  static constexpr std::size_t largest_bytes = 16 * 1024 * 1024;  // of one
  static constexpr std::size_t most = 512;
  static constexpr std::size_t fault_moments_per_axis = 4;

  using Changed = std::function<void(const Recording&)>;

  // `changed` is called for each that has come into another state.
  explicit Recordings(Changed changed) : changed_(std::move(changed)) {}

  // As POST /api/v1/recordings asks. Throws ApiError and has changed nothing.
  const Recording& add(Source& source, const std::string& body);
  // Keeps the moment of a fault; the oldest of that axis makes room.
  void add_moment(Recording::Plan plan, std::vector<std::shared_ptr<Samples>> taps, std::int64_t first,
                  std::int64_t trigger, Recording::Fault fault);

  // All samples before tick `end`.
  void take(std::int64_t end);

  const std::vector<std::shared_ptr<Recording>>& all() const { return recordings_; }
  std::shared_ptr<Recording> find(std::uint32_t id) const;  // nullptr: there is none
  void remove(std::uint32_t id);
  std::size_t bytes() const;

 private:
  bool make_room(std::size_t bytes);

  Changed changed_;
  std::vector<std::shared_ptr<Recording>> recordings_;  // the oldest first
  std::uint32_t last_id_ = 0;
};

}  // namespace servodrome::line::bench
