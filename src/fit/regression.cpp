#include "fit/regression.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::fit {

namespace {

constexpr double hair = 1e-9;

// A dense square matrix, row by row.
struct Square {
  explicit Square(std::size_t of) : size(of), values(of * of, 0.0) {}
  double& at(std::size_t row, std::size_t column) { return values[row * size + column]; }
  double at(std::size_t row, std::size_t column) const { return values[row * size + column]; }
  std::size_t size;
  std::vector<double> values;
};

// Inverts by elimination with pivots, after scaling rows and columns to a diagonal of 1. The diagonal is increased
// slightly, so that equal columns give large numbers instead of infinity. Returns false if a diagonal element is not
// positive.
bool invert(const Square& matrix, Square& inverse) {
  const std::size_t n = matrix.size;
  Square left = matrix;
  Square right(n);
  std::vector<double> scale(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (!(matrix.at(i, i) > 0.0)) return false;
    scale[i] = 1.0 / std::sqrt(matrix.at(i, i));
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) left.at(i, j) *= scale[i] * scale[j];
    left.at(i, i) += hair;
    right.at(i, i) = 1.0;
  }
  for (std::size_t step = 0; step < n; ++step) {
    std::size_t pivot = step;
    for (std::size_t row = step + 1; row < n; ++row) {
      if (std::abs(left.at(row, step)) > std::abs(left.at(pivot, step))) pivot = row;
    }
    for (std::size_t j = 0; j < n; ++j) {
      std::swap(left.at(step, j), left.at(pivot, j));
      std::swap(right.at(step, j), right.at(pivot, j));
    }
    const double reciprocal = 1.0 / left.at(step, step);
    for (std::size_t j = 0; j < n; ++j) {
      left.at(step, j) *= reciprocal;
      right.at(step, j) *= reciprocal;
    }
    for (std::size_t row = 0; row < n; ++row) {
      const double factor = row == step ? 0.0 : left.at(row, step);
      if (factor == 0.0) continue;
      for (std::size_t j = 0; j < n; ++j) {
        left.at(row, j) -= factor * left.at(step, j);
        right.at(row, j) -= factor * right.at(step, j);
      }
    }
  }
  inverse = Square(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) inverse.at(i, j) = right.at(i, j) * scale[i] * scale[j];
  }
  return true;
}

// The moments of one column in all windows.
struct MatrixColumn {
  std::vector<double> even;
  std::vector<double> odd;
  // Moments of its instrument.
  std::vector<double> even_instrument;
  std::vector<double> odd_instrument;
};
struct Rows {
  std::vector<double> left;
  std::vector<MatrixColumn> columns;
};

std::vector<double> sum_of(const Windows& windows, const std::vector<Part>& parts, Half half) {
  std::vector<double> sum(windows.size(), 0.0);
  for (const Part& part : parts) {
    const std::vector<double> moments = windows.moments(*part.signal, part.derivative, part.delay_s, half);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part.factor * moments[i];
  }
  return sum;
}

Rows rows_of(const Windows& windows, const Equation& equation) {
  Rows rows;
  rows.left = sum_of(windows, equation.left, Half::all);
  for (std::size_t j = 0; j < equation.columns.size(); ++j) {
    MatrixColumn& column = rows.columns.emplace_back();
    column.even = sum_of(windows, equation.columns[j], Half::even);
    column.odd = sum_of(windows, equation.columns[j], Half::odd);
    const bool itself = equation.instruments.empty() || equation.instruments[j].empty();
    column.even_instrument = itself ? column.even : sum_of(windows, equation.instruments[j], Half::even);
    column.odd_instrument = itself ? column.odd : sum_of(windows, equation.instruments[j], Half::odd);
  }
  return rows;
}

bool is_whole(const Rows& rows, std::size_t window) {
  double sum = rows.left[window];
  for (const MatrixColumn& column : rows.columns) {
    sum += column.even[window] + column.odd[window] + column.even_instrument[window] + column.odd_instrument[window];
  }
  return std::isfinite(sum);
}

// Two-sided critical value of 95 % for Bartlett's weights over this share of the sample (Kiefer and Vogelsang 2005,
// table 1).
double critical_value(double share) { return 1.96 + share * (2.9694 + share * (0.416 - share * 0.5324)); }

}  // namespace

Estimate regress(const Windows& windows, const std::vector<Equation>& equations, const std::vector<char>& use) {
  const std::size_t unknowns = equations.front().columns.size();
  std::vector<Rows> all;
  for (const Equation& equation : equations) all.push_back(rows_of(windows, equation));
  std::vector<std::size_t> good;
  for (std::size_t window = 0; window < windows.size(); ++window) {
    const auto whole = [&](const Rows& rows) { return is_whole(rows, window); };
    if (use[window] != 0 && std::all_of(all.begin(), all.end(), whole)) good.push_back(window);
  }

  Estimate estimate{.unknowns = std::vector<Unknown>(unknowns), .windows = good.size()};
  if (good.size() < 3 * unknowns) return estimate;
  Square normal(unknowns);
  std::vector<double> right(unknowns, 0.0);
  std::vector<double> power(unknowns, 0.0);  // of the columns and of their instruments, including noise
  std::vector<double> instrument_power(unknowns, 0.0);
  for (const Rows& rows : all) {
    for (const std::size_t w : good) {
      for (std::size_t i = 0; i < unknowns; ++i) {
        const MatrixColumn& row = rows.columns[i];
        const double even = row.even_instrument[w];
        const double odd = row.odd_instrument[w];
        right[i] += 0.5 * (even + odd) * rows.left[w];
        power[i] += row.even[w] * row.even[w] + row.odd[w] * row.odd[w];
        instrument_power[i] += even * even + odd * odd;
        for (std::size_t j = 0; j < unknowns; ++j) {
          normal.at(i, j) += 0.5 * (even * rows.columns[j].odd[w] + odd * rows.columns[j].even[w]);
        }
      }
    }
  }
  for (std::size_t i = 0; i < unknowns; ++i) {
    const double mean = 0.5 * std::sqrt(power[i] * instrument_power[i]);
    if (mean > 0.0) estimate.unknowns[i].signal_share = normal.at(i, i) / mean;
  }
  Square inverse(unknowns);
  if (!invert(normal, inverse)) return estimate;
  estimate.solved = true;
  for (std::size_t i = 0; i < unknowns; ++i) {
    Unknown& unknown = estimate.unknowns[i];
    for (std::size_t j = 0; j < unknowns; ++j) unknown.value += inverse.at(i, j) * right[j];
    unknown.independent_share = 1.0 / (inverse.at(i, i) * normal.at(i, i));
    if (!std::isfinite(unknown.value)) estimate.solved = false;
  }
  if (!estimate.solved) return Estimate{.unknowns = std::vector<Unknown>(unknowns), .windows = good.size()};

  // Residuals of each window times its instruments, as the mean over both halves of the samples.
  std::vector<std::vector<double>> scores(good.size(), std::vector<double>(unknowns, 0.0));
  double squares = 0.0;
  for (const Rows& rows : all) {
    for (std::size_t k = 0; k < good.size(); ++k) {
      const std::size_t w = good[k];
      double by_even = rows.left[w];
      double by_odd = rows.left[w];
      for (std::size_t j = 0; j < unknowns; ++j) {
        by_even -= rows.columns[j].even[w] * estimate.unknowns[j].value;
        by_odd -= rows.columns[j].odd[w] * estimate.unknowns[j].value;
      }
      squares += 0.25 * (by_even + by_odd) * (by_even + by_odd);
      for (std::size_t i = 0; i < unknowns; ++i) {
        scores[k][i] +=
            0.5 * (rows.columns[i].even_instrument[w] * by_odd + rows.columns[i].odd_instrument[w] * by_even);
      }
    }
  }
  const auto count = static_cast<double>(good.size());
  estimate.residual_rms = std::sqrt(squares / (count * static_cast<double>(all.size())));
  const auto lags = static_cast<std::size_t>(std::max(2.0 * Windows::overlap, std::ceil(std::sqrt(count))));
  Square spread(unknowns);
  for (std::size_t k = 0; k < good.size(); ++k) {
    for (std::size_t m = k; m < good.size() && good[m] - good[k] < lags; ++m) {
      const double weight = 1.0 - static_cast<double>(good[m] - good[k]) / static_cast<double>(lags);
      for (std::size_t i = 0; i < unknowns; ++i) {
        for (std::size_t j = 0; j < unknowns; ++j) {
          const double product = scores[k][i] * scores[m][j];
          spread.at(i, j) += weight * product;
          if (m != k) spread.at(j, i) += weight * product;
        }
      }
    }
  }
  const double correction = count / (count - static_cast<double>(unknowns));
  const double critical = critical_value(static_cast<double>(lags) / count);
  for (std::size_t i = 0; i < unknowns; ++i) {
    double variance = 0.0;
    for (std::size_t j = 0; j < unknowns; ++j) {
      for (std::size_t k = 0; k < unknowns; ++k) variance += inverse.at(i, j) * spread.at(j, k) * inverse.at(i, k);
    }
    estimate.unknowns[i].half_width = critical * std::sqrt(std::max(0.0, correction * variance));
    if (!std::isfinite(estimate.unknowns[i].half_width)) estimate.solved = false;
  }
  return estimate;
}

}  // namespace servodrome::fit
