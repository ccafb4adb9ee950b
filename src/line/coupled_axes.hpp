#pragma once

#include <string>
#include <vector>

#include "line/axis.hpp"
#include "line/config.hpp"
#include "plant/axis_coupling.hpp"

namespace servodrome::line {

// Two axes whose loads are coupled. When the line advances one of them, both advance together, tick by tick. Before
// each tick the coupling calculates its torque from the positions and speeds after the previous tick.
class CoupledAxes {
 public:
  CoupledAxes(const plant::CouplingParameters& parameters, Axis& first, Axis& second);
  CoupledAxes(const CoupledAxes&) = delete;
  CoupledAxes& operator=(const CoupledAxes&) = delete;

  // Runs all ticks of both axes up to and including number `tick`.
  void run_to(std::int64_t tick);
  // Relaxes the coupling after the bench has placed one of the axes, as if the coupling had been unscrewed for this.
  void relax() { coupling_.relax(); }

  const Axis& partner_of(const Axis& axis) const { return &axis == &first_ ? second_ : first_; }
  // Turns of `axis` in a turn of its partner.
  double ratio_of(const Axis& axis) const;
  // Returns the messages of plant::validate if `axis` had the parameters `changed`.
  std::vector<std::string> judge(const Axis& axis, const plant::Parameters& changed) const;

 private:
  Axis& first_;
  Axis& second_;
  plant::AxisCoupling coupling_;
};

}  // namespace servodrome::line
