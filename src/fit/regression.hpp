#pragma once

#include <vector>

#include "fit/windows.hpp"

// Linear regression over windows, unbiased by noise in the regressors.
namespace servodrome::fit {

// A term of an equation: factor * (signal or a derivative of it), from `delay_s` earlier.
struct Part {
  const std::vector<double>* signal;
  unsigned derivative = 0;
  double factor = 1.0;
  double delay_s = 0.0;
};

// left = sum of columns[i] * unknown i. A column without parts means that the unknown is not in this equation.
struct Equation {
  std::vector<Part> left;
  std::vector<std::vector<Part>> columns;
  // Instrument of each column, which replaces the column in the products: the value that the model predicts for it from
  // signals other than those of the left side. Empty: the column itself.
  std::vector<std::vector<Part>> instruments = {};
};

struct Unknown {
  double value = 0.0;
  double half_width = 0.0;  // half width of the confidence interval of 95 %
  // Excitation of the unknown: the share of the signal (without noise) in the power of its column, and the share of
  // this signal that the other columns do not contain.
  double signal_share = 0.0;
  double independent_share = 1.0;
};

struct Estimate {
  std::vector<Unknown> unknowns;
  std::size_t windows = 0;  // number of windows used
  double residual_rms = 0.0;
  bool solved = false;  // false: too few windows, or a column without signal
};

// Solves the equations in all windows with a `use` other than 0 and without missing samples.
//
// Normal matrix: products of the moments of the even samples (of the instruments) with those of the odd samples (of the
// columns), and vice versa. The noise of the two halves is independent, so the matrix contains only the power of the
// signals. Noise in the columns therefore does not pull the estimate towards 0, as it does in plain least squares.
//
// Confidence: residuals may be heteroscedastic and correlated between windows. The covariance is that of Newey and West
// with Bartlett's weights; their bandwidth is the square root of the number of windows, at least
// 2 * Windows::overlap. The critical value is that of Kiefer and Vogelsang (2005) for this bandwidth.
Estimate regress(const Windows& windows, const std::vector<Equation>& equations, const std::vector<char>& use);

}  // namespace servodrome::fit
