#pragma once

#include <cstdint>
#include <numeric>

namespace servodrome::drive {

using Counts = std::int64_t;  // encoder increments

// An exact ratio, both parts in 1 .. 2^31 - 1 after reduction.
struct Ratio {
  std::int64_t numerator = 1;
  std::int64_t denominator = 1;

  // Reduces by the greatest common divisor.
  static constexpr Ratio reduced(std::int64_t numerator, std::int64_t denominator) {
    const std::int64_t divisor = std::gcd(numerator, denominator);
    return {numerator / divisor, denominator / divisor};
  }
  constexpr bool valid() const {
    return numerator > 0 && denominator > 0 && numerator < (std::int64_t{1} << 31) &&
           denominator < (std::int64_t{1} << 31);
  }
  constexpr Ratio inverse() const { return {denominator, numerator}; }
  constexpr bool is_one() const { return numerator == denominator; }
  constexpr double value() const { return static_cast<double>(numerator) / static_cast<double>(denominator); }
};

// Product of two valid ratios; not valid() if it does not fit.
constexpr Ratio operator*(Ratio a, Ratio b) {
  const Ratio x = Ratio::reduced(a.numerator, b.denominator);
  const Ratio y = Ratio::reduced(b.numerator, a.denominator);
  return {x.numerator * y.numerator, y.denominator * x.denominator};
}

// value * ratio, rounded to the nearest integer, halves away from zero. Exact for every value whose result fits:
// quotient and remainder are scaled separately, so that no intermediate value exceeds 64 bits.
constexpr std::int64_t scale(std::int64_t value, Ratio ratio) {
  if (ratio.is_one()) return value;
  const std::int64_t quotient = value / ratio.denominator;
  const std::int64_t remainder = value % ratio.denominator;
  const std::int64_t part = remainder * ratio.numerator;
  const std::int64_t half = ratio.denominator / 2;
  const std::int64_t rounded = part >= 0 ? (part + half) / ratio.denominator : -((-part + half) / ratio.denominator);
  return quotient * ratio.numerator + rounded;
}

// The value of a position in a 32-bit object: it wraps around as a counter does.
constexpr std::int32_t wrap_to_32_bits(std::int64_t value) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(value));
}

// Conversion of user units to counts. `position` is an exact ratio, because errors of positions would accumulate;
// rates are factors.
struct Units {
  Ratio position{};              // counts per position unit
  double velocity = 1.0;         // counts/s per velocity unit
  double acceleration = 1.0;     // counts/s^2 per acceleration unit
  double jerk = 1.0;             // counts/s^3 per jerk unit
  double velocity_sensor = 1.0;  // counts/s per unit of 6069h
  double current = 0.001;        // rated current per current unit (6073h, 6078h)
  double counts_per_revolution = 131072.0;
  bool position_inverted = false;  // 607Eh bit 7
  bool velocity_inverted = false;  // 607Eh bit 6

  constexpr Counts to_counts(std::int64_t user) const {
    const Counts counts = scale(user, position);
    return position_inverted ? -counts : counts;
  }
  constexpr std::int64_t to_user(Counts counts) const {
    return scale(position_inverted ? -counts : counts, position.inverse());
  }
  constexpr double velocity_to_counts(double user) const { return (velocity_inverted ? -user : user) * velocity; }
  constexpr double velocity_to_user(double counts_per_s) const {
    return (velocity_inverted ? -counts_per_s : counts_per_s) / velocity;
  }
};

}  // namespace servodrome::drive
