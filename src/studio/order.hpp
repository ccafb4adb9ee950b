#pragma once

#include <functional>
#include <optional>
#include <string>

#include "host/axis402.hpp"
#include "line/bench/body_reader.hpp"
#include "studio/drives.hpp"

// What a job is told to do: the body of a request, read and checked before anything moves.
namespace servodrome::studio {

// The numbers of a request in the drive's units, and back.
class Scale {
 public:
  // 1 for everything: the drive's units.
  Scale() = default;
  explicit Scale(const host::AxisUnits& units) : units_(units) {}
  const host::AxisUnits& units() const { return units_; }

 private:
  host::AxisUnits units_{1.0, 1.0, 1.0};
};

// How an order is carried out: what is asked, told and found meanwhile.
struct Conduct {
  std::function<bool()> released{};  // it is to end: no sign of life came in time, or it is cancelled
  std::function<void(const char* doing, double share)> progress{};
  std::string product{};  // as `servodrome products` lists it; "": unknown
  // Drives::in_cycles of the axis.
  std::function<line::bench::Json(const host::CanDrive& exchanged, const Drives::Work& work)> in_cycles{};
  line::bench::Json found{};  // of an order that finds something out
};

struct Order {
  std::string what;             // "move"
  bool takes_over = false;      // ends another job of the axis, instead of being refused
  bool lives_on_signs = false;  // goes on while signs of life come
  bool in_revolutions = false;
  Scale scale{};
  std::function<void(host::Axis402& axis, Conduct& conduct)> carry_out{};  // does it
};

// `units` is asked for what a revolution is, if the request has its numbers in revolutions. Throws ApiError for what
// cannot be, and what `units` throws.
Order read_order(const std::string& body, const std::function<host::AxisUnits()>& units);

}  // namespace servodrome::studio
