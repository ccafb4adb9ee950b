#pragma once

namespace servodrome::drive {

// First-order low pass, exact for a held input: y += gain (x - y).
struct LowPass {
  float gain = 1.0F;  // 1: passes everything
  float value = 0.0F;

  float apply(float input) {
    value += gain * (input - value);
    return value;
  }
};

// Gain of a LowPass of `corner_hz` applied every `period_s`; 1 (no filter) for a corner of 0 or less.
float low_pass_gain(float corner_hz, float period_s);

// Second-order section, transposed direct form II: b0 + b1/z + b2/z^2 over 1 + a1/z + a2/z^2.
struct Biquad {
  float b0 = 1.0F;
  float b1 = 0.0F;
  float b2 = 0.0F;
  float a1 = 0.0F;
  float a2 = 0.0F;
  float state1 = 0.0F;
  float state2 = 0.0F;

  float apply(float input) {
    const float output = b0 * input + state1;
    state1 = b1 * input - a1 * output + state2;
    state2 = b2 * input - a2 * output;
    return output;
  }
  // Sets the state that results from a long constant `input`.
  void settle(float input) {
    const float output = input * ((b0 + b1 + b2) / (1.0F + a1 + a2));
    state2 = b2 * input - a2 * output;
    state1 = b1 * input - a1 * output + state2;
  }
};

// Coefficients by the bilinear transform, matched at the given frequency. Frequencies in Hz, below half of 1 /
// period_s; the state is that of `previous`, so that a filter may be retuned while it runs.
Biquad make_notch(float frequency_hz, float width_hz, float depth, float period_s, const Biquad& previous = {});
Biquad make_low_pass(float corner_hz, float damping, float period_s, const Biquad& previous = {});

// A low pass that may be switched off; then its output is exactly the input.
struct OptionalLowPass {
  LowPass filter{};
  bool on = false;

  // When switched on, it starts from `present`, the output so far.
  void configure(float corner_hz, float period_s, float present) {
    if (!on) filter.value = present;
    on = corner_hz > 0.0F;
    filter.gain = low_pass_gain(corner_hz, period_s);
  }
  float apply(float input) { return on ? filter.apply(input) : input; }
  void settle(float value) { filter.value = value; }
};

// Disturbance observer: the load torque is the torque that does not accelerate the inertia. Torques as fractions of
// rated, velocities in counts/s.
struct DisturbanceObserver {
  float inertia = 0.0F;  // torque by counts/s per period
  float gain = 1.0F;     // of the low pass
  float velocity = 0.0F;
  float load = 0.0F;

  // One period, with its torque and the velocity at its end.
  void update(float torque, float velocity_now) {
    load += gain * (torque - inertia * (velocity_now - velocity) - load);
    velocity = velocity_now;
  }
};

// Velocity observer: computes the velocity from torque and inertia, and corrects it by the measured velocity. It lags
// only for an unknown load torque or a wrong inertia, which it estimates as a disturbance. Velocities in counts/s.
struct VelocityObserver {
  float acceleration = 0.0F;   // counts/s per period for a torque of 1
  float velocity_gain = 1.0F;  // of the error, per period
  float disturbance_gain = 0.0F;
  float velocity = 0.0F;
  float disturbance = 0.0F;  // counts/s per period

  float apply(float measured, float torque) {
    const float predicted = velocity + acceleration * torque + disturbance;
    const float error = measured - predicted;
    velocity = predicted + velocity_gain * error;
    disturbance += disturbance_gain * error;
    return velocity;
  }
};

// Both poles of the observer's error at `corner_hz`; keeps the state of `previous`.
VelocityObserver make_velocity_observer(float corner_hz, float acceleration, float period_s,
                                        const VelocityObserver& previous = {});

}  // namespace servodrome::drive
