#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "api/routes.hpp"
#include "axis/axis402.hpp"
#include "axis/cyclic/can_cyclic_bus.hpp"
#include "catalogue/product.hpp"
#include "master/canopen/pdo_set_up.hpp"
#include "studio/reach.hpp"

namespace servodrome::studio {

// An error in the form of the API.
struct JobError {
  std::string what;
  std::string where;
  std::string hint;
};

// The periodic exchange of an axis' process data at a fixed rate, for work that needs it.
struct CyclicAccess {
  master::CyclicBus& bus;
  std::size_t drive;              // index in the bus
  master::ObjectClient& objects;  // objects of the same drive
  std::function<bool()> cancelled;
  std::function<void(const char* doing, double share)> progress;
};

// The axes on which jobs run: those of a line, or drives on buses.
class Drives {
 public:
  // Waits until the time `until`; may throw to leave the caller.
  using Wait = std::function<void(master::Time until)>;

  virtual ~Drives() = default;

  virtual master::Time now() const = 0;
  virtual std::vector<std::string> names() const = 0;
  // The faults that the test bench injects, by name; they hold until they are removed.
  virtual std::vector<std::string> injected(const std::string&) const { return {}; }
  // Throws ApiError 409 if the axis cannot answer now. `axis` here and below is one of names().
  virtual void require_ready(const std::string& axis) const = 0;
  // The drive's objects for a caller that waits with `wait`. The result must not outlive this object.
  virtual std::unique_ptr<master::ObjectClient> open(const std::string& axis, Wait wait) = 0;
  // Options with which a master operates this axis.
  virtual master::AxisOptions options(const std::string& axis) const = 0;
  // As `servodrome products` lists it; "": unknown product.
  virtual std::string product(const std::string& axis) const = 0;
  // Returns true if the process data of the axis, or its objects instead, can be exchanged every millisecond or two.
  virtual bool has_cycles(const std::string& axis) const = 0;
  // Work that runs during the periodic exchange, and returns its result. It may run in another thread, and may still
  // run after in_cycles was left by an exception, so it must own its data.
  using Work = std::function<api::Json(CyclicAccess& access)>;
  // Runs `work` during the periodic exchange (on CAN of `exchanged`, on EtherCAT of the data that the slave maps).
  // Waits with `objects`, which `open` returned for the axis. Calls `cancelled` and `progress` meanwhile. Throws what
  // `work` throws; MasterError without has_cycles.
  virtual api::Json in_cycles(const std::string& axis, master::ObjectClient& objects, const master::CanDrive& exchanged,
                              const std::function<bool()>& cancelled,
                              const std::function<void(const char* doing, double share)>& progress,
                              const Work& work) = 0;
  // A revolution in the drive's units; empty if the drive has no such information. Throws MasterError if the access
  // fails.
  virtual std::optional<catalogue::AxisUnits> units(const std::string& axis) = 0;
  // The limits that the drive's objects contain now. Throws MasterError if the access fails.
  virtual master::AxisLimits limits(const std::string& axis) = 0;
  // Where the axis can move to, as far as it is known. Throws MasterError if the access fails.
  virtual Travel travel(const std::string& axis) = 0;
  // The number of commands to the axis that came otherwise than by jobs: from clients of the API (by the controlword,
  // the power, or a stop of all axes), and for real drives on CAN also from other masters (by the controlword).
  virtual std::uint64_t commands(const std::string& axis) const = 0;
  // A client operates the axis: it may now be enabled or in motion. For drives on buses only.
  virtual void note_motion(const std::string&) {}
  // A stop of the axis begins. For drives on buses only.
  virtual void note_stop(const std::string&) {}
  // A stop of the axis has failed: gives it a quick stop as soon as it answers. For drives on buses only.
  virtual void stop_when_back(const std::string&) {}
  // Quick stop of every enabled axis, at once. Returns the errors in the order of names(); empty: the axis stands or is
  // stopping.
  virtual std::vector<std::optional<JobError>> stop_all() = 0;
};

}  // namespace servodrome::studio
