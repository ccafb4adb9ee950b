#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "tools/tuning/frequency_response.hpp"

namespace servodrome::master::tuning {

// The fit uses an elastic axis only if the misfit of a rigid one is above rigid_misfit, and that of the elastic one is
// lower by the factor `improvement`.
inline constexpr double improvement = 2.0;
inline constexpr double rigid_misfit = 0.05;

// Weight of a measured point in a fit of relative errors. Points with a coherence below 0.8 are ignored; above 0.9999
// the error of the model is greater than that of the measurement.
inline double weight_of(const ResponsePoint& point) {
  if (point.coherence < 0.8) return 0.0;
  return std::min(point.coherence / (1.0 - std::min(point.coherence, 1.0 - 1e-9)), 1e4);
}

// Weighted least squares for real unknowns of complex equations.
template <std::size_t N>
class LeastSquares {
 public:
  void add(const std::array<Complex, N>& coefficients, Complex right, double weight) {
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t k = 0; k < N; ++k) {
        matrix_[i][k] += weight * (std::conj(coefficients[i]) * coefficients[k]).real();
      }
      right_[i] += weight * (std::conj(coefficients[i]) * right).real();
    }
    power_ += weight * std::norm(right);
  }
  // `damping` makes the solution vector shorter (K. Levenberg, 1944; D. Marquardt, 1963). Returns false if the
  // equations do not determine the unknowns.
  bool solve(std::array<double, N>& unknowns, double damping = 0.0) const {
    auto matrix = matrix_;
    auto right = right_;
    for (std::size_t i = 0; i < N; ++i) matrix[i][i] *= 1.0 + damping;
    for (std::size_t i = 0; i < N; ++i) {
      std::size_t pivot = i;
      for (std::size_t k = i + 1; k < N; ++k) {
        if (std::abs(matrix[k][i]) > std::abs(matrix[pivot][i])) pivot = k;
      }
      std::swap(matrix[i], matrix[pivot]);
      std::swap(right[i], right[pivot]);
      if (!(std::abs(matrix[i][i]) > 1e-300)) return false;
      for (std::size_t k = i + 1; k < N; ++k) {
        const double factor = matrix[k][i] / matrix[i][i];
        for (std::size_t j = i; j < N; ++j) matrix[k][j] -= factor * matrix[i][j];
        right[k] -= factor * right[i];
      }
    }
    for (std::size_t i = N; i-- > 0;) {
      double sum = right[i];
      for (std::size_t k = i + 1; k < N; ++k) sum -= matrix[i][k] * unknowns[k];
      unknowns[i] = sum / matrix[i][i];
    }
    return true;
  }
  // Power of the residuals divided by the power of the right side.
  double remainder(const std::array<double, N>& unknowns) const {
    double explained = 0.0;
    for (std::size_t i = 0; i < N; ++i) {
      double row = -2.0 * right_[i];
      for (std::size_t k = 0; k < N; ++k) row += matrix_[i][k] * unknowns[k];
      explained += unknowns[i] * row;
    }
    return power_ > 0.0 ? std::max(0.0, 1.0 + explained / power_) : 1.0;
  }

 private:
  std::array<std::array<double, N>, N> matrix_{};
  std::array<double, N> right_{};
  double power_ = 0.0;
};

}  // namespace servodrome::master::tuning
