#pragma once

#include <array>
#include <concepts>
#include <cstdint>

// Amplitude-invariant Clarke and Park transforms, and the sine they need. Angles are electrical: at 0 the d axis is
// aligned with phase U. In a two-phase motor (two windings in quadrature) U and V are the axes of the stationary frame
// themselves, and there is no W.
namespace servodrome::drive {

struct SinCos {
  float sine;
  float cosine;
};

// An angle in 2^-32 turns. Overflow wraps around by whole turns, in both directions.
using Phase = std::uint32_t;

// For |turns| < 2^31; rounds towards 0.
template <std::floating_point Real>
constexpr Phase phase_of(Real turns) {
  return static_cast<Phase>(static_cast<std::int64_t>(turns * Real{0x1p32}));
}

// Of an angle x in -pi/4 .. pi/4, rad. Absolute error below 2e-7. The polynomials have no branches, and give identical
// bits on every machine with IEEE floats. Independent partial products keep the latency low, as this runs in every
// tick.
constexpr SinCos sin_cos_near_zero(float x) {
  const float x2 = x * x;
  const float x4 = x2 * x2;
  return {
      x + x * x2 * ((-1.6666654611e-1F + x2 * 8.3321608736e-3F) + x4 * -1.9515295891e-4F),
      (1.0F - 0.5F * x2) + x4 * ((4.166664568298827e-2F + x2 * -1.388731625493765e-3F) + x4 * 2.443315711809948e-5F)};
}

// At namespace scope, because the compiler builds a local table on the stack in every call.
inline constexpr std::array<SinCos, 4> quarter_turns{{{0.0F, 1.0F}, {1.0F, 0.0F}, {0.0F, -1.0F}, {-1.0F, 0.0F}}};

// The same of any angle, which is reduced to +-1/8 turn.
constexpr SinCos sin_cos(Phase phase) {
  const std::uint32_t quadrant = (phase + 0x2000'0000U) >> 30;
  const auto [s, c] = sin_cos_near_zero(static_cast<float>(static_cast<std::int32_t>(phase - (quadrant << 30))) *
                                        (6.2831853071795864F * 0x1p-32F));
  const SinCos turn = quarter_turns[quadrant];
  return {s * turn.cosine + c * turn.sine, c * turn.cosine - s * turn.sine};
}

struct DirectQuadrature {
  float d = 0.0F;
  float q = 0.0F;
};

inline constexpr float one_over_sqrt3 = 0.57735026918962576F;
inline constexpr float sqrt3_over_2 = 0.86602540378443865F;

// Factor from products of the amplitudes d and q to power, torque and heat: half the number of phases.
constexpr float phase_factor(unsigned phases) { return 0.5F * static_cast<float>(phases); }

// The greatest amplitude of a sinusoidal phase voltage as a fraction of the DC link voltage. Star connection on three
// half bridges: the circle inside the hexagon of voltages. Two windings on a full bridge each: the circle inside the
// square.
constexpr float voltage_share(unsigned phases) { return phases == 2 ? 1.0F : one_over_sqrt3; }

// Phase values to the rotor frame. The sum of three phase values (U, V, W) need not be zero.
template <unsigned Phases = 3>
constexpr DirectQuadrature to_rotor_frame(const std::array<float, 3>& phase, SinCos angle) {
  static_assert(Phases == 2 || Phases == 3);
  if constexpr (Phases == 2) {
    return {phase[0] * angle.cosine + phase[1] * angle.sine, phase[1] * angle.cosine - phase[0] * angle.sine};
  } else {
    const float alpha = (2.0F * phase[0] - (phase[1] + phase[2])) * (1.0F / 3.0F);
    const float beta = (phase[1] - phase[2]) * one_over_sqrt3;
    return {alpha * angle.cosine + beta * angle.sine, beta * angle.cosine - alpha * angle.sine};
  }
}

template <unsigned Phases = 3>
constexpr std::array<float, 3> to_phases(DirectQuadrature dq, SinCos angle) {
  static_assert(Phases == 2 || Phases == 3);
  const float alpha = dq.d * angle.cosine - dq.q * angle.sine;
  const float beta = dq.d * angle.sine + dq.q * angle.cosine;
  if constexpr (Phases == 2) return {alpha, beta, 0.0F};
  return {alpha, -0.5F * alpha + sqrt3_over_2 * beta, -0.5F * alpha - sqrt3_over_2 * beta};
}

}  // namespace servodrome::drive
