#include "axis/plcopen/cam_table.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::master::plcopen {

CamTable::CamTable(std::vector<CamPoint> points, bool periodic) : points_(std::move(points)), periodic_(periodic) {
  valid_ = points_.size() >= 2;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const CamPoint& point = points_[i];
    valid_ = valid_ && std::isfinite(point.master) && std::isfinite(point.slave) && std::isfinite(point.slope) &&
             (i == 0 || points_[i - 1].master < point.master);
  }
}

CamTable CamTable::through(std::vector<CamPoint> points, bool periodic) {
  const std::size_t last = points.size() - 1;
  if (points.size() >= 2) {
    for (std::size_t i = 1; i < last; ++i) {
      points[i].slope = (points[i + 1].slave - points[i - 1].slave) / (points[i + 1].master - points[i - 1].master);
    }
    double ends = 0.0;
    if (periodic) {
      ends = (points[1].slave - points[0].slave + points[last].slave - points[last - 1].slave) /
             (points[1].master - points[0].master + points[last].master - points[last - 1].master);
    }
    points[0].slope = points[last].slope = ends;
  }
  return CamTable(std::move(points), periodic);
}

CamTable::Value CamTable::at(double master) const {
  double shift = 0.0;
  if (periodic_) {
    const double turns = std::floor((master - begin()) / (end() - begin()));
    master -= turns * (end() - begin());
    shift = turns * (points_.back().slave - points_.front().slave);
  } else if (master <= begin()) {
    return {points_.front().slave, 0.0};
  } else if (master >= end()) {
    return {points_.back().slave, 0.0};
  }
  const auto next = std::upper_bound(points_.begin() + 1, points_.end() - 1, master,
                                     [](double value, const CamPoint& point) { return value < point.master; });
  const CamPoint& a = *(next - 1);
  const CamPoint& b = *next;
  // Cubic Hermite interpolation.
  const double width = b.master - a.master;
  const double s = (master - a.master) / width;
  const double rise = b.slave - a.slave;
  const double p = a.slope * width;
  const double q = b.slope * width;
  const double c2 = 3.0 * rise - 2.0 * p - q;
  const double c3 = p + q - 2.0 * rise;
  return {shift + a.slave + s * (p + s * (c2 + s * c3)), (p + s * (2.0 * c2 + 3.0 * c3 * s)) / width};
}

}  // namespace servodrome::master::plcopen
