#pragma once

#include "products/ismk/policy.hpp"
#include "products/ismk/servo.hpp"

namespace servodrome::products {

// An iSMK on a fieldbus: `Fieldbus` is CanDevice or EthercatDevice of the variant. Wires the servo to it and to RS485.
template <typename Fieldbus>
class IsmkDevice : public Fieldbus {
 public:
  static constexpr std::span<const modbus::Register> registers{ismk::registers};
  static constexpr modbus::Profile modbus_profile = ismk::modbus_profile;

  using Fieldbus::dictionary;
  using Fieldbus::drive;

  explicit IsmkDevice(const Settings& its_settings) : Fieldbus(its_settings) {}

  static bool supports(const modbus::CharacterFormat& format) { return ismk::supports(format); }
  SerialPort* serial_port() override { return &serial_port_; }

  void power_on(const drive::Feedback& feedback, Time now) override {
    servo_.before_power_on();
    Fieldbus::power_on(feedback, now);
    servo_.after_reset();
    open_serial_port();
  }
  void cycle(Time now) override {
    if (servo_.cycle(now)) return power_on(servo_.restart_feedback(), now);
    Fieldbus::cycle(now);
  }

  // Table 3-1. The lamps of the bus flicker with its traffic; this function does not show the flicker.
  Lamps lamps(Time now) override {
    Lamps lamps;
    lamps.add({"PWR", "green", Light::on});
    const unsigned outputs = objects().servo.io.output_real;
    lamps.add({"RUN", "green", steady((outputs & 1U << ismk::run_output) != 0)});
    lamps.add({"ERR", "red", steady((outputs & 1U << ismk::error_output) != 0)});
    const Lamps of_bus = Fieldbus::lamps(now);
    for (const Lamp& lamp : of_bus.all())
      lamps.add({lamp.name == "RUN" ? "BUS RUN" : "BUS ERR", lamp.colour, lamp.light, lamp.flashes});
    return lamps;
  }

  const Model& rating() const { return servo_.rating(); }
  const ismk::Terminals& terminals() const { return servo_.terminals(); }
  const ismk::AlarmLog& alarm_log() const { return servo_.alarm_log(); }
  const PastFault* past_fault(std::size_t n) const override {
    return n < alarm_log().size() ? &alarm_log()[n] : nullptr;
  }
  const ismk::LoopTuning& loop_tuning() const { return servo_.loop_tuning(); }
  bool recognise_inertia(double turns) { return servo_.recognise_inertia(turns); }
  void set_rigidity(double bandwidth_hz) { servo_.set_rigidity(bandwidth_hz); }
  std::array<char, 6> display() const { return servo_.display(); }
  ismk::Capture capture(std::size_t unit) { return ismk::Terminals::capture(drive(), unit); }
  void rearm_capture(std::size_t unit, bool rising) { ismk::Terminals::rearm(drive(), unit, rising); }

 protected:
  using Fieldbus::objects;
  using Fieldbus::settings;

  ~IsmkDevice() = default;

  ismk::Servo& servo() { return servo_; }
  void open_serial_port() { serial_port_.open(servo_.serial_setup()); }

  // --- Required by the fieldbus device
  void prepare(dictionary::Area areas) {
    objects().communication.serial_number = settings().serial_number;
    servo_.prepare(areas);
  }
  void loaded(dictionary::Area) { servo_.loaded(); }
  drive::Configuration configuration() { return servo_.configuration(); }

  // --- dictionary::Listener
  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override {
    return servo_.check(entry, value, this->node_id());
  }
  void written(const dictionary::Entry& entry) override { servo_.written(entry, this->node_id(), serial_port_); }
  void refresh(const dictionary::Entry& entry) override { servo_.refresh(entry); }

 private:
  ismk::Servo servo_{drive(), dictionary(), objects().servo, Fieldbus::settings()};
  SerialPort serial_port_{dictionary(), registers, modbus_profile};
};

}  // namespace servodrome::products
