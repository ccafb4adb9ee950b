#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "catalogue.hpp"
#include "line/line.hpp"
#include "master/error.hpp"
#include "random.hpp"
#include "watch.hpp"

namespace servodrome::chaos {

using links::Time;
using motion::Random;
using motion::Surroundings;
using motion::Variant;

inline constexpr std::int64_t ticks_per_s = 16'000;
inline constexpr std::size_t can_buses = 2;
inline constexpr std::size_t segment = can_buses;  // number of the EtherCAT segment among the buses

struct Options {
  std::uint64_t seed = 1;
  std::size_t axes = 64;
  bool only_segment = false;  // all axes are EtherCAT slaves
  double hours = 0.1;
  double share = 0.01;             // of the frames that are dropped; as many are doubled, corrupted and delayed
  double power_cut_every_s = 180;  // mean time between two power cuts of an axis
  double cable_every_s = 180;      // ... between two pulls of its cable
  double recovery_limit_s = 60;    // of line time, from the end of a disturbance
  bool watches = true;             // the invariants are checked
  std::int64_t rest_stride = 1;    // of an axis at rest, they are checked after each tick that is a multiple of it
};

// The disturbances of an axis, and the progress of its master since then.
struct Record {
  std::optional<Time> waits_since{};  // end of the last disturbance from which its master has not recovered yet
  bool overdue = false;               // the delay has been reported
  std::uint64_t power_cuts = 0;
  std::uint64_t cable_pulls = 0;
  std::uint64_t recoveries = 0;
  std::uint64_t moves = 0;  // accepted by the drive
  Time longest_recovery{};
};

// What could make an axis move, or shows that it moves.
struct Signs {
  std::uint16_t controlword = 0;
  std::uint16_t statusword = 0;
  std::int8_t mode = 0;
  std::int32_t target_position = 0;
  std::int32_t target_velocity = 0;
  std::int16_t target_torque = 0;
  drive::PowerState state{};
  bool energised = false;
  double demand = 0.0;  // counts
  std::int64_t commanded = 0;
  std::int64_t disturbed = 0;
  friend bool operator==(const Signs&, const Signs&) = default;
};

struct Subject {
  line::Axis* axis = nullptr;
  const Variant* variant = nullptr;
  std::size_t bus = 0;
  std::size_t place = 0;  // on its segment, from 0
  Surroundings around;
  Record record;
  std::unique_ptr<motion::Watch> watch;
  Signs signs;
  std::int64_t changed = 0;  // last tick at which the signs changed, or the axis moved
};

// The line with its axes, and the data that all parts of the program share.
class World {
 public:
  explicit World(const Options& options);

  const Options& options() const { return options_; }
  line::Line& line() { return *line_; }
  std::vector<Subject>& subjects() { return subjects_; }
  std::int64_t tick() const { return tick_; }
  // Advances the line by one tick and checks the invariants of all axes.
  void pass_tick();

  void finding(const std::string& text);
  const std::vector<std::string>& findings() const { return findings_; }
  std::uint64_t finding_count() const { return finding_count_; }

  // The master has the axis in operation and its drive accepts commands.
  void works(Subject& subject);
  // A disturbance of the axis has begun: recovery counts from its end.
  static void struck(Subject& subject) { subject.record.waits_since.reset(); }
  // The disturbance has ended.
  void over(Subject& subject) {
    subject.record.waits_since = line_->now();
    subject.record.overdue = false;
  }
  // Reports axes that have waited for their master for too long.
  void look_for_overdue();

  // Counts an error of a master by its kind.
  void count(const master::MasterError& error) { ++errors_[error.happened().substr(0, error.happened().find('['))]; }
  const std::map<std::string, std::uint64_t>& errors() const { return errors_; }
  bool stopping = false;       // the masters finish their present action
  bool quiet = false;          // no more disturbances
  std::uint64_t restarts = 0;  // of the EtherCAT master
  std::uint64_t groups = 0;    // of drives with process data on CAN

 private:
  static line::LineSettings settings(const Options& options, const std::vector<Variant>& variants,
                                     std::vector<std::size_t>& chosen);
  bool rests(Subject& subject) const;

  Options options_;
  std::vector<Variant> variants_ = motion::variants();
  std::vector<std::size_t> chosen_;  // of the variants, for each axis
  std::unique_ptr<line::Line> line_;
  std::vector<Subject> subjects_;
  std::int64_t tick_ = 0;
  std::vector<std::string> findings_;
  std::uint64_t finding_count_ = 0;
  std::map<std::string, std::uint64_t> errors_;
};

}  // namespace servodrome::chaos
