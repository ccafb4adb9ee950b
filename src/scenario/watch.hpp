#pragma once

#include "line/axis.hpp"
#include "scenario/master_watch.hpp"
#include "scenario/message.hpp"

namespace servodrome::scenario {

// The data that conditions need in addition to the present state of an axis.
struct Facts {
  std::map<std::string, std::optional<Time>, std::less<>> first_acts;  // of each rule; none: it has not acted
  std::map<const line::Axis*, double> travelled;                       // motor revolutions, both directions added
  const MasterWatch* master = nullptr;
  std::optional<Time> master_ended;
  bool master_succeeded = false;
};

// Watches whether a condition holds for an axis.
class Watch {
 public:
  // `axis` may be nullptr if the condition needs no axis (see needs_axis).
  Watch(const Condition& condition, line::Axis* axis) : condition_(&condition), axis_(axis) {}

  // Begins the watch: it counts messages and distances from now on.
  void begin();
  // Call this for each message that the condition is about. The datagrams of a frame are the parts of one message.
  void notice(std::span<const Message> parts);
  const line::Axis* axis() const { return axis_; }
  bool holds(Time now, const Facts& facts) const;
  // The present values of the quantities in the condition: "state fault, position 1.25".
  std::string present(const Facts& facts) const;

 private:
  bool drive_fits() const;
  bool shaft_fits() const;
  bool has_travelled(const Facts& facts) const;
  bool master_fits(Time now, const Facts& facts) const;
  bool bus_fits() const;
  bool deeds_fit(const Facts& facts) const;

  const Condition* condition_;
  line::Axis* axis_;
  unsigned messages_ = 0;
  double start_revolutions_ = 0;
};

// Returns true if the condition needs an axis.
bool needs_axis(const Condition& condition);

// The true position of the shaft in motor revolutions.
double revolutions(const line::Axis& axis);

}  // namespace servodrome::scenario
