#pragma once

#include <vector>

namespace servodrome::master::plcopen {

// A point of a cam: positions of master and slave, and the slope of the cam there (slave units per master unit).
struct CamPoint {
  double master = 0.0;
  double slave = 0.0;
  double slope = 0.0;
};

// A cam as MC_CamTableSelect provides it: cubic between its points, so that position and velocity are continuous.
class CamTable {
 public:
  struct Value {
    double slave = 0.0;
    double slope = 0.0;
  };

  // The points must be in ascending order of the master, at least two; otherwise valid() is false. Periodic: after its
  // end the cam repeats, shifted by the slave's travel over one period.
  explicit CamTable(std::vector<CamPoint> points, bool periodic = false);
  // A cam whose slopes are computed from the neighbouring points (0 at the ends of a cam that is not periodic).
  static CamTable through(std::vector<CamPoint> points, bool periodic = false);

  bool valid() const { return valid_; }
  bool periodic() const { return periodic_; }
  double begin() const { return points_.front().master; }
  double end() const { return points_.back().master; }
  // Outside a cam that is not periodic the slave stands still.
  Value at(double master) const;

 private:
  std::vector<CamPoint> points_;
  bool periodic_;
  bool valid_;
};

}  // namespace servodrome::master::plcopen
