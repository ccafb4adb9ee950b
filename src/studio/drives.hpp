#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/axis402.hpp"
#include "host/canopen/pdo_set_up.hpp"
#include "host/cyclic/can_cyclic_bus.hpp"
#include "line/bench/routes.hpp"

namespace servodrome::studio {

// What went wrong, as the API tells it.
struct JobError {
  std::string what;
  std::string where;
  std::string hint;
};

// An axis whose process data are exchanged at a fixed rate, for the work that needs that.
struct CyclicAccess {
  host::CyclicBus& bus;
  std::size_t drive;            // of the bus
  host::ObjectClient& objects;  // of the same drive
  std::function<bool()> cancelled;
  std::function<void(const char* doing, double share)> progress;
};

// The axes that jobs drive: those of a line, or drives on buses.
class Drives {
 public:
  // Lets time pass until it is `until`; may throw to leave the caller.
  using Wait = std::function<void(host::Time until)>;

  virtual ~Drives() = default;

  virtual host::Time now() const = 0;
  virtual std::vector<std::string> names() const = 0;
  // Throws ApiError 409 when nothing can be asked of the axis now. `axis` here and below is one of names().
  virtual void require_ready(const std::string& axis) const = 0;
  // The drive's objects for a caller that waits by `wait`. Does not outlive this.
  virtual std::unique_ptr<host::ObjectClient> open(const std::string& axis, Wait wait) = 0;
  // How a host drives this axis.
  virtual host::AxisOptions options(const std::string& axis) const = 0;
  // As `servodrome products` lists it; "": none of ours.
  virtual std::string product(const std::string& axis) const = 0;
  // The process data of the axis, or its objects as if they were, can be exchanged each millisecond or two.
  virtual bool has_cycles(const std::string& axis) const = 0;
  // What is done with an axis while they are; answers what it found. It may be carried out in another thread, and still
  // be when in_cycles was left by an exception: it keeps what it needs.
  using Work = std::function<line::bench::Json(CyclicAccess& access)>;
  // Exchanges `exchanged` on CAN, what the slave maps on EtherCAT, and has `work` done meanwhile. Waits by `objects`,
  // which `open` made for the axis, and asks and tells by the other two. Throws what `work` throws; HostError without
  // has_cycles.
  virtual line::bench::Json in_cycles(const std::string& axis, host::ObjectClient& objects,
                                      const host::CanDrive& exchanged, const std::function<bool()>& cancelled,
                                      const std::function<void(const char* doing, double share)>& progress,
                                      const Work& work) = 0;
  // What a revolution is in the drive's units; nothing: it does not say. Throws HostError if it cannot be asked.
  virtual std::optional<host::AxisUnits> units(const std::string& axis) = 0;
  // Quick stop of every axis that is enabled, at once: what is wrong, in the order of names(); nothing: it stands or is
  // being stopped.
  virtual std::vector<std::optional<JobError>> stop_all() = 0;
};

}  // namespace servodrome::studio
