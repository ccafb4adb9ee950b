#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "api/scope/recording.hpp"

namespace servodrome::api {

// The recordings of a line. Each is kept until it is deleted or must make room for a newer one.
class Recordings {
 public:
  static constexpr std::size_t most_bytes = 64 * 1024 * 1024;     // of all recordings
  static constexpr std::size_t largest_bytes = 16 * 1024 * 1024;  // of one recording
  static constexpr std::size_t most = 512;
  static constexpr std::size_t fault_moments_per_axis = 4;

  using Changed = std::function<void(const Recording&)>;

  // `changed` is called for each recording whose state has changed.
  explicit Recordings(Changed changed) : changed_(std::move(changed)) {}

  // Starts a recording from the body of POST /api/v1/recordings. On an error throws ApiError and changes nothing.
  const Recording& add(Source& source, const std::string& body);
  // Records the time around a fault. Beyond `fault_moments_per_axis` it replaces the axis' oldest one.
  void add_moment(Recording::Plan plan, std::vector<std::shared_ptr<Samples>> taps, std::int64_t first,
                  std::int64_t trigger, Recording::Fault fault);

  // Takes all samples before tick `end`.
  void take(std::int64_t end);

  const std::vector<std::shared_ptr<Recording>>& all() const { return recordings_; }
  std::shared_ptr<Recording> find(std::uint32_t id) const;  // nullptr: there is none
  // Changes name and note as the body of PUT /api/v1/recordings/{id} says. On an error throws and changes nothing.
  void describe(Recording& recording, const std::string& body);
  // Removes a recording at the request of a client, and calls the callback of on_removed. A recording that makes room
  // for another is removed without this call.
  void remove(std::uint32_t id);
  void on_removed(std::function<void(std::uint32_t id)> removed) { removed_ = std::move(removed); }

  // Adds a recording of an earlier run if there is room.
  void restore(std::shared_ptr<Recording> recording);
  // The numbers of new recordings are above `id` from now on.
  void begin_after(std::uint32_t id) { last_id_ = std::max(last_id_, id); }
  std::size_t bytes() const;

 private:
  void erase(std::uint32_t id);
  bool make_room(std::size_t bytes);

  Changed changed_;
  std::function<void(std::uint32_t id)> removed_{};
  std::vector<std::shared_ptr<Recording>> recordings_;  // oldest first
  std::uint32_t last_id_ = 0;
};

}  // namespace servodrome::api
