#include "drive/tuning/inertia_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace servodrome::drive {
namespace {

// Greatest number of cycles in a window without a change of the encoder, as at a reversal. A longer standstill makes
// the window useless, because static friction takes any value.
constexpr std::uint32_t most_standing_cycles = 2;

// Least number of equations for four unknowns and an estimate of their errors.
constexpr std::uint32_t least_windows = 8;

// Regularisation relative to a column's own size. It avoids a division by zero if the motion does not distinguish two
// columns (friction and gravity of an axis that moves one way only).
constexpr double ridge = 1e-6;

double sign(Counts difference) { return difference > 0 ? 1.0 : difference < 0 ? -1.0 : 0.0; }

}  // namespace

void InertiaEstimator::begin(const Settings& settings) {
  *this = {};
  settings_ = settings;
  rad_per_count_ = 2.0 * std::numbers::pi / settings.counts_per_revolution;
  window_cycles_ = std::max(8U, static_cast<std::uint32_t>(std::lround(settings.window_s / settings.cycle_s)));
}

void InertiaEstimator::interrupt() {
  samples_ = 0;
  cycle_ = 0;
}

void InertiaEstimator::sample(Counts position, float torque) {
  position_ = {position_[1], position_[2], position};
  torque_ = {torque_[1], torque_[2], static_cast<double>(torque)};
  if (++samples_ < 3) return;
  samples_ = 3;

  const Counts before = position_[1] - position_[0];
  const Counts after = position_[2] - position_[1];
  if (cycle_ == 0) {
    sums_ = {};
    torque_sum_ = weight_sum_ = 0.0;
    standing_ = 0;
  }
  ++cycle_;
  const double u = static_cast<double>(cycle_) / static_cast<double>(window_cycles_);
  const double bump = 16.0 * u * u * (1.0 - u) * (1.0 - u);
  if (before == 0) ++standing_;
  sums_[0] += bump * static_cast<double>(after - before);
  sums_[1] += bump * 0.5 * (sign(before) + sign(after));
  sums_[3] += bump * 0.5 * static_cast<double>(before + after);
  torque_sum_ += bump * 0.5 * (torque_[1] + torque_[2]);
  weight_sum_ += bump;
  if (cycle_ + 1 == window_cycles_) {
    cycle_ = 0;
    close_window();
  }
}

void InertiaEstimator::close_window() {
  const double scale = 1.0 / weight_sum_;
  const double speed = sums_[3] * scale * rad_per_count_ / settings_.cycle_s;
  const double acceleration = sums_[0] * scale * rad_per_count_ / (settings_.cycle_s * settings_.cycle_s);
  if (standing_ > most_standing_cycles || std::fabs(acceleration) < settings_.least_acceleration) return;
  if (speed > 0.0 ? !settings_.forward : !settings_.reverse) return;
  const Row row{acceleration, sums_[1] * scale, 1.0, speed};
  const double torque_nm = torque_sum_ * scale * settings_.rated_torque_nm;

  ++windows_;
  const double keep = settings_.memory_windows > 0.0 ? 1.0 - 1.0 / settings_.memory_windows : 1.0;
  weight_ = keep * weight_ + 1.0;
  square_ = keep * square_ + torque_nm * torque_nm;
  for (std::size_t i = 0; i < terms; ++i) {
    right_[i] = keep * right_[i] + row[i] * torque_nm;
    for (std::size_t j = 0; j < terms; ++j) matrix_[i][j] = keep * matrix_[i][j] + row[i] * row[j];
  }
}

// Cholesky factorisation with columns scaled to unit length. The variance of the first unknown is that of the residual
// times the first element of the inverse matrix, from forward and backward substitution of the first unit vector.
bool InertiaEstimator::estimate(InertiaEstimate& estimate) const {
  if (windows_ < least_windows) return false;
  constexpr std::size_t n = terms;
  Row scale{};
  for (std::size_t i = 0; i < n; ++i) {
    if (matrix_[i][i] <= 0.0) return false;
    scale[i] = 1.0 / std::sqrt(matrix_[i][i]);
  }
  std::array<Row, terms> factor{};
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double value = matrix_[i][j] * scale[i] * scale[j] + (i == j ? ridge : 0.0);
      for (std::size_t k = 0; k < j; ++k) value -= factor[i][k] * factor[j][k];
      if (i != j) {
        factor[i][j] = value / factor[j][j];
      } else {
        if (value <= 0.0) return false;
        factor[i][i] = std::sqrt(value);
      }
    }
  }
  const auto solve = [&](Row right) {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < i; ++k) right[i] -= factor[i][k] * right[k];
      right[i] /= factor[i][i];
    }
    for (std::size_t i = n; i-- > 0;) {
      for (std::size_t k = i + 1; k < n; ++k) right[i] -= factor[k][i] * right[k];
      right[i] /= factor[i][i];
    }
    return right;
  };
  Row right{};
  for (std::size_t i = 0; i < n; ++i) right[i] = right_[i] * scale[i];
  const Row solution = solve(right);
  double residual = square_;
  for (std::size_t i = 0; i < n; ++i) residual -= solution[i] * right[i];
  const double freedom = weight_ - static_cast<double>(n);
  const double inertia = solution[0] * scale[0];
  if (freedom < 1.0 || inertia <= 0.0) return false;
  const double variance = std::max(residual, 0.0) / freedom * solve(Row{1.0})[0] * scale[0] * scale[0];
  estimate.inertia_kgm2 = inertia;
  estimate.coulomb_nm = solution[1] * scale[1];
  estimate.constant_nm = solution[2] * scale[2];
  estimate.viscous_nms = solution[3] * scale[3];
  estimate.relative_uncertainty = std::sqrt(variance) / inertia;
  estimate.windows = windows_;
  return true;
}

}  // namespace servodrome::drive
