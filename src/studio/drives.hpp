#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/axis402.hpp"

namespace servodrome::studio {

// What went wrong, as the API tells it.
struct JobError {
  std::string what;
  std::string where;
  std::string hint;
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
  // The drive's objects for one who waits by `wait`. Does not outlive this.
  virtual std::unique_ptr<host::ObjectClient> open(const std::string& axis, Wait wait) = 0;
  // How a host drives this axis.
  virtual host::AxisOptions options(const std::string& axis) const = 0;
  // As `servodrome products` lists it; "": none of ours.
  virtual std::string product(const std::string& axis) const = 0;
  // An access takes less than a tenth of a millisecond, and always as long.
  virtual bool has_cycles() const = 0;
  // What a revolution is in the drive's units. Throws HostError if it cannot be asked.
  virtual host::AxisUnits units(const std::string& axis) = 0;
  // Quick stop of every axis that is enabled, at once: what is wrong, in the order of names(); nothing: it stands or is
  // being stopped.
  virtual std::vector<std::optional<JobError>> stop_all() = 0;
};

}  // namespace servodrome::studio
