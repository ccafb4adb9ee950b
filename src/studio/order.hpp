#pragma once

#include <functional>
#include <optional>
#include <string>

#include "api/body_reader.hpp"
#include "axis/axis402.hpp"
#include "catalogue/product.hpp"
#include "studio/drives.hpp"

// The order of a job: the body of a request, read and checked before anything moves.
namespace servodrome::studio {

// The scale between the numbers of a request and the drive's units.
class Scale {
 public:
  // Factor 1 everywhere: the drive's units.
  Scale() = default;
  explicit Scale(const catalogue::AxisUnits& units) : units_(units) {}
  const catalogue::AxisUnits& units() const { return units_; }

 private:
  catalogue::AxisUnits units_{1.0, 1.0, 1.0};
};

// Callbacks and results of the execution of an order.
struct Conduct {
  std::function<bool()> released{};  // returns true if the order must end: no sign of life, or cancelled
  std::function<void(const char* doing, double share)> progress{};
  std::string product{};  // as `servodrome products` lists it; "": unknown
  // Calls Drives::in_cycles for the axis.
  std::function<api::Json(const master::CanDrive& exchanged, const Drives::Work& work)> in_cycles{};
  api::Json found{};  // result of an order that measures something
};

struct Order {
  // The order begins only if this job was the axis' last command, and is done.
  struct After {
    std::uint64_t job;
    std::optional<double> within_s{};    // longest time between the end of the job and the begin of this one
    std::optional<std::string> start{};  // api::run_name of the server that carried the job out
  };

  // The end of a move, in the units of 607Ah.
  struct Target {
    std::int32_t number;
    bool relative;
  };

  std::string what;             // "move"
  bool moves = false;           // if it fails, the axis is halted
  bool takes_over = false;      // ends a running job of the axis, instead of being refused
  bool lives_on_signs = false;  // needs signs of life to go on (dead man's switch)
  bool in_revolutions = false;
  std::optional<After> after{};
  std::optional<Target> target{};  // must be within the travel of the axis
  Scale scale{};
  std::function<void(master::Axis402& axis, Conduct& conduct)> carry_out{};
};

// The size of a revolution in the drive's units; nothing if the drive does not report it.
using ReadUnits = std::function<std::optional<catalogue::AxisUnits>()>;

// Calls `units` if the request's numbers are in revolutions, or if the job needs the size of a revolution. Throws
// ApiError for an invalid request, MasterError if the size is needed and not reported, and what `units` throws.
Order read_order(const std::string& body, const ReadUnits& units);

}  // namespace servodrome::studio
