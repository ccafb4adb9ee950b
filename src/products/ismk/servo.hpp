#pragma once

#include "products/ismk/alarms.hpp"
#include "products/ismk/motion.hpp"
#include "products/ismk/object_table.hpp"
#include "products/ismk/ratings.hpp"
#include "products/ismk/registers.hpp"
#include "products/ismk/terminals.hpp"
#include "products/ismk/tuning.hpp"

// The iSMK without its fieldbus: the meaning and the effects of its objects.
namespace servodrome::products::ismk {

class Servo {
 public:
  Servo(drive::Drive& drive, dictionary::Dictionary& dictionary, ServoObjects& objects, const Settings& settings)
      : drive_(drive), dictionary_(dictionary), objects_(objects), settings_(settings) {}

  // The rating of Settings::model; the default one for a name that is not known.
  const Model& rating() const;

  // ---- Start, reset and cycle ----

  void prepare(dictionary::Area areas);
  void loaded() { MotionControl::loaded(objects_); }
  drive::Configuration configuration();

  // Call these before and after the device's power-on, and before and after a reset by the bus. `whole`: the reset
  // includes the application.
  void before_power_on();
  void before_reset(bool whole);
  void after_reset();

  // Once per position-loop cycle. Returns true if 2FFFh requests a restart; then use `restart_feedback`.
  bool cycle(Time now);
  // The feedback after a restart, as after a short loss of supply: the shaft keeps its position, and the encoder knows
  // the position within one turn only.
  drive::Feedback restart_feedback() const;
  // The period of set-points with SYNC0; 0: 3011h sub 1.
  void set_set_point_period(double seconds);
  // A new set-point: a SYNC arrived, or process data.
  void sync(Time now) { motion_control_.sync(drive_, objects_, now); }

  // ---- Objects of Owner::product ----

  // `node_id` is for the guarding COB-ID and for factory values that depend on it; 0 on other buses than CAN.
  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value, std::uint8_t node_id);
  // `port`: 6510h sub 0Ch selects its protocol.
  void written(const dictionary::Entry& entry, std::uint8_t node_id, SerialPort& port);
  void refresh(const dictionary::Entry& entry);

  // ---- Alarms ----

  void raise(const drive::FaultRow& fault) { alarm_log_.raise(fault, objects_.alarms, drive_); }
  void alarms_gone() { AlarmLog::reset(objects_.alarms); }
  std::array<std::uint8_t, 5> emergency_bytes() const { return ismk::emergency_bytes(objects_.alarms); }

  // ---- RS485 ----

  SerialSetup serial_setup() const;

  // ---- Functions that the manual describes without objects ----

  const Terminals& terminals() const { return terminals_; }
  const AlarmLog& alarm_log() const { return alarm_log_; }  // persists over power cycles
  const LoopTuning& loop_tuning() const { return tuning_; }
  // Functions of the PC software (ch. 4.1.3): see LoopTuning.
  bool recognise_inertia(double turns) { return tuning_.recognise_inertia(drive_, turns); }
  void set_rigidity(double bandwidth_hz);
  std::array<char, 6> display() const;  // the alarm, "000.0" without one

 private:
  void reconfigure() { drive_.configure(configuration()); }
  dictionary::AbortCode save(dictionary::Area areas);

  // storage.cpp
  dictionary::AbortCode store_parameters(std::int64_t command);
  dictionary::AbortCode store_motor_data(std::int64_t command);
  dictionary::AbortCode request_restart(std::int64_t command);
  void initialise_parameters(std::uint8_t node_id);

  // rs485.cpp
  void prepare_rs485(dictionary::Area areas);
  void select_protocol(SerialPort& port);

  drive::Drive& drive_;
  dictionary::Dictionary& dictionary_;
  ServoObjects& objects_;
  const Settings& settings_;
  MotionControl motion_control_{};
  Terminals terminals_{};
  AlarmLog alarm_log_{};
  LoopTuning tuning_{};
  bool restart_requested_ = false;
  std::uint32_t restart_cycles_ = 0;  // cycles since then
  double set_point_period_s_ = 0.0;
};

// 2F81h (Table 9-26); 0: no such code.
std::uint32_t can_bit_rate_of(std::uint8_t code);

// Returns true if the RS485 port supports a format: 8N1 at one of four bit rates (ch. 4.1.2.1).
bool supports(const modbus::CharacterFormat& format);

}  // namespace servodrome::products::ismk
