#pragma once

#include <vector>

namespace servodrome::host::plcopen {

// A point of a cam: where the slave is when the master is there, and how steep the cam is (slave units per master
// unit).
struct CamPoint {
  double master = 0.0;
  double slave = 0.0;
  double slope = 0.0;
};

// A cam: cubic between its points, so that position and velocity are continuous. What MC_CamTableSelect hands out.
class CamTable {
 public:
  struct Value {
    double slave = 0.0;
    double slope = 0.0;
  };

  // Points in order of the master, two at least; else the table is not valid(). Periodic: behind its end it begins
  // again, shifted by what the slave went over one period.
  explicit CamTable(std::vector<CamPoint> points, bool periodic = false);
  // Slopes from the neighbouring points (0 at the ends of a cam that is not periodic).
  static CamTable through(std::vector<CamPoint> points, bool periodic = false);

  bool valid() const { return valid_; }
  bool periodic() const { return periodic_; }
  double begin() const { return points_.front().master; }
  double end() const { return points_.back().master; }
  // Before and behind a cam that is not periodic the slave stands.
  Value at(double master) const;

 private:
  std::vector<CamPoint> points_;
  bool periodic_;
  bool valid_;
};

}  // namespace servodrome::host::plcopen
