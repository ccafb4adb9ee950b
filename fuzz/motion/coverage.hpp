#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "catalogue.hpp"
#include "drive/power/power_state.hpp"

namespace servodrome::motion {

inline constexpr std::size_t power_states = 8;
inline constexpr std::array<drive::Mode, 12> all_modes{drive::Mode::pulse,
                                                       drive::Mode::immediate_velocity,
                                                       drive::Mode::none,
                                                       drive::Mode::profile_position,
                                                       drive::Mode::velocity,
                                                       drive::Mode::profile_velocity,
                                                       drive::Mode::profile_torque,
                                                       drive::Mode::homing,
                                                       drive::Mode::interpolated_position,
                                                       drive::Mode::cyclic_sync_position,
                                                       drive::Mode::cyclic_sync_velocity,
                                                       drive::Mode::cyclic_sync_torque};

// Counts how often each kind of event occurred in each power state and mode.
struct Coverage {
  std::array<std::array<std::array<std::uint32_t, all_modes.size()>, kinds>, power_states> counts{};

  void count(drive::PowerState state, Kind kind, drive::Mode mode);
  void add(const Coverage& other);
};

// The coverage of each product, in memory that is shared with the processes that are forked later.
class CoverageBook {
 public:
  explicit CoverageBook(const std::vector<Variant>& variants);
  ~CoverageBook();
  CoverageBook(const CoverageBook&) = delete;
  CoverageBook& operator=(const CoverageBook&) = delete;

  Coverage& of(const std::string& product) { return pages_[index_.at(product)]; }
  std::map<std::string, Coverage> copy() const;

 private:
  std::map<std::string, std::size_t> index_;
  Coverage* pages_ = nullptr;
};

// A table for each product, and a list of the combinations that are possible in its modes but were never reached.
std::string report(const std::map<std::string, Coverage>& by_product, const std::vector<Variant>& variants);

}  // namespace servodrome::motion
