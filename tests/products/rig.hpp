#pragma once

#include <functional>
#include <vector>

#include "canopen/node.hpp"
#include "drive/drive.hpp"
#include "plant/plant.hpp"
#include "products/device.hpp"

// One drive on its plant in virtual time, without a bus: the base of the tests of products.
namespace servodrome::test {

// The data of the plant's motor, as the drive knows them.
inline drive::MotorData motor_data(const plant::Parameters& parameters) {
  const plant::Motor& motor = parameters.motor;
  drive::MotorData data;
  const double amplitude = 1.4142135623730951;
  data.counts_per_revolution = static_cast<std::uint32_t>(parameters.encoder.counts_per_revolution);
  data.phases = static_cast<std::uint8_t>(motor.phases);
  data.pole_pairs = static_cast<std::uint16_t>(motor.pole_pairs);
  data.rated_current_a = static_cast<float>(motor.rated_current_a * amplitude);
  data.peak_current_a = 3.0F * data.rated_current_a;
  data.rated_torque_nm = static_cast<float>(motor.rated_torque_nm);
  data.rated_speed_rpm = static_cast<float>(motor.rated_speed_rpm);
  data.max_speed_rpm = 6000.0F;
  data.torque_constant_nm_per_a = static_cast<float>(motor.torque_constant_nm_per_a / amplitude);
  data.resistance_ohm = static_cast<float>(motor.resistance_ohm);
  data.inductance_d_h = static_cast<float>(motor.direct_inductance_h);
  data.inductance_q_h = static_cast<float>(motor.quadrature_inductance_h);
  data.inertia_kgm2 = static_cast<float>(motor.rotor_inertia_kgm2 + parameters.load.inertia_kgm2);
  data.commutation_offset_turns = static_cast<float>(parameters.encoder.commutation_offset_turns);
  data.index_width_counts = static_cast<std::uint32_t>(parameters.encoder.index_width_counts);
  data.phase_order_reversed = parameters.encoder.direction < 0;
  return data;
}

inline plant::Parameters default_plant() {
  plant::Parameters parameters;
  parameters.supply.charged_at_start = true;
  return parameters;
}

// With a load that hangs on the shaft, and a brake; `brake_torque_nm` 0: no brake.
inline plant::Parameters hanging(plant::Parameters parameters, double gravity_torque_nm, double brake_torque_nm) {
  parameters.load.gravity_torque_nm = gravity_torque_nm;
  parameters.motor.brake_torque_nm = brake_torque_nm;
  parameters.motor.brake_release_ms = 30.0;
  parameters.motor.brake_engage_ms = 20.0;
  return parameters;
}

template <typename DeviceType>
class Rig {
 public:
  explicit Rig(const plant::Parameters& parameters = default_plant(), products::Settings settings = {})
      : plant(parameters), device(with_motor(settings, parameters)) {
    plant.sample(feedback);
    device.power_on(feedback, now());
    drain();
  }

  products::Time now() const { return std::chrono::nanoseconds(62500) * ticks_; }
  std::int64_t ticks() const { return ticks_; }

  void tick() {
    ++ticks_;
    const bool cycle = device.drive().tick(feedback, actuation);
    plant.step(actuation, feedback);
    if (device.next_deadline() <= now()) device.poll(now());
    if (cycle) device.cycle(now());
    drain();
  }
  void run_ms(double milliseconds) {
    for (std::int64_t i = 0; i < static_cast<std::int64_t>(milliseconds * 16.0 + 0.5); ++i) tick();
  }
  // Ticks until the condition holds; -1 if it does not within the limit.
  std::int64_t run_until(const std::function<bool()>& condition, double limit_ms) {
    const std::int64_t start = ticks_;
    const auto limit = static_cast<std::int64_t>(limit_ms * 16.0);
    while (!condition()) {
      if (ticks_ - start >= limit) return -1;
      tick();
    }
    return ticks_ - start;
  }

  void send(std::uint32_t id, std::vector<std::uint8_t> bytes, bool remote = false) {
    canopen::Frame frame{.id = id, .remote = remote, .length = static_cast<std::uint8_t>(bytes.size())};
    for (std::size_t i = 0; i < bytes.size(); ++i) frame.data[i] = bytes[i];
    device.receive(frame, now());
    drain();
  }
  std::int64_t get(std::uint16_t index, std::uint8_t sub = 0) { return device.dictionary().number(index, sub); }
  dictionary::AbortCode set(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
    return device.dictionary().set_number(index, sub, value);
  }
  std::uint16_t status() { return static_cast<std::uint16_t>(get(0x6041)); }
  void control(std::uint16_t word) { set(0x6040, 0, word); }
  // Makes the input with this function active or not. Returns false if no input has it.
  bool force(drive::Signal signal, bool active) {
    const drive::InputMap& inputs = device.drive().configuration().inputs;
    for (std::uint8_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].signal != signal) continue;
      plant.force_input(i, inputs[i].active(active));
      return true;
    }
    return false;
  }
  // Goes through the state machine to Operation enabled, with time for the DC link.
  bool enable() {
    run_ms(1);
    control(0x06);
    run_ms(1);
    control(0x07);
    run_ms(200);
    control(0x0F);
    run_ms(1);
    return device.drive().state() == drive::PowerState::operation_enabled;
  }

  void drain() {
    canopen::Frame frame;
    while (device.take(frame)) sent.push_back(frame);
  }

  plant::Plant plant;
  DeviceType device;
  drive::Feedback feedback{};
  drive::Actuation actuation{};
  std::vector<canopen::Frame> sent;

 private:
  static products::Settings with_motor(products::Settings settings, const plant::Parameters& parameters) {
    settings.motor = motor_data(parameters);
    return settings;
  }
  std::int64_t ticks_ = 0;
};

}  // namespace servodrome::test
