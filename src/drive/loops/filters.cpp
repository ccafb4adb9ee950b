#include "drive/loops/filters.hpp"

#include <cmath>

#include "drive/loops/constants.hpp"

namespace servodrome::drive {
namespace {

Biquad with_coefficients(const Biquad& previous, float b0, float b1, float b2, float a0, float a1, float a2) {
  Biquad filter = previous;
  filter.b0 = b0 / a0;
  filter.b1 = b1 / a0;
  filter.b2 = b2 / a0;
  filter.a1 = a1 / a0;
  filter.a2 = a2 / a0;
  return filter;
}

}  // namespace

float low_pass_gain(float corner_hz, float period_s) {
  return corner_hz > 0.0F ? -std::expm1(-2.0F * pi * corner_hz * period_s) : 1.0F;
}

// s becomes (w / tan(w T / 2)) (z - 1) / (z + 1), divided through by w: with k = tan(w T / 2) and the relative width
// B / w, (s^2 + d B s + w^2) becomes (1 + d k B/w + k^2) + 2 (k^2 - 1) / z + (1 - d k B/w + k^2) / z^2.
Biquad make_notch(float frequency_hz, float width_hz, float depth, float period_s, const Biquad& previous) {
  const float k = std::tan(pi * frequency_hz * period_s);
  const float width = k * width_hz / frequency_hz;
  const float middle = 2.0F * (k * k - 1.0F);
  return with_coefficients(previous, 1.0F + depth * width + k * k, middle, 1.0F - depth * width + k * k,
                           1.0F + width + k * k, middle, 1.0F - width + k * k);
}

// The same transform for w^2 / (s^2 + 2 damping w s + w^2).
Biquad make_low_pass(float corner_hz, float damping, float period_s, const Biquad& previous) {
  const float k = std::tan(pi * corner_hz * period_s);
  const float width = 2.0F * damping * k;
  return with_coefficients(previous, k * k, 2.0F * k * k, k * k, 1.0F + width + k * k, 2.0F * (k * k - 1.0F),
                           1.0F - width + k * k);
}

// The error obeys e' = (1 - g) (e - d), d' = d + h e with a pole p of multiplicity two for g = 1 - p^2, h = (1 - p)^2.
VelocityObserver make_velocity_observer(float corner_hz, float acceleration, float period_s,
                                        const VelocityObserver& previous) {
  VelocityObserver observer = previous;
  const float rest = low_pass_gain(corner_hz, period_s);  // 1 - p
  observer.acceleration = acceleration;
  observer.velocity_gain = rest * (2.0F - rest);
  observer.disturbance_gain = rest * rest;
  return observer;
}

}  // namespace servodrome::drive
