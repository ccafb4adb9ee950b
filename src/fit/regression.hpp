#pragma once

#include <vector>

#include "fit/windows.hpp"

// Linear regression over windows, without bias by the noise of the regressors.
namespace servodrome::fit {

// One signal's share of an equation: factor * (signal or a derivative of it), as it was `delay_s` ago.
struct Part {
  const std::vector<double>* signal;
  unsigned derivative = 0;
  double factor = 1.0;
  double delay_s = 0.0;
};

// left = sum of columns[i] * unknown i. A column without parts: the unknown is not in this equation.
struct Equation {
  std::vector<Part> left;
  std::vector<std::vector<Part>> columns;
  // Of each column what stands for it in the products: what the model expects it to be, out of other signals than those
  // of the left side. Empty: the column itself.
  std::vector<std::vector<Part>> instruments = {};
};

struct Unknown {
  double value = 0.0;
  double half_width = 0.0;  // of the confidence interval of 95 %
  // Its part in the excitation: the share of its column's power that is signal and no noise, and how much of that is
  // left when what the other columns show of it is taken away.
  double signal_share = 0.0;
  double independent_share = 1.0;
};

struct Estimate {
  std::vector<Unknown> unknowns;
  std::size_t windows = 0;  // that were of use
  double residual_rms = 0.0;
  bool solved = false;  // false: too few windows, or a column in which there is no signal
};

// Solves the equations in all windows for which `use` is not 0 and no sample is missing.
//
// Normal matrix: products of moments of the even samples (of the instruments) with those of the odd ones (of the
// columns), and the other way round. Their noises are independent, so the matrix has the signals' power alone, and
// noise of the columns does not draw the estimate towards 0 as in plain least squares.
//
// Confidence: residuals as they are (heteroscedastic, correlated from window to window): Newey and West's covariance
// with Bartlett's weights over the square root of the number of windows, and the critical value that Kiefer and
// Vogelsang (2005) give for that bandwidth.
Estimate regress(const Windows& windows, const std::vector<Equation>& equations, const std::vector<char>& use);

}  // namespace servodrome::fit
