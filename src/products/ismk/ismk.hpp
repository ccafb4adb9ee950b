#pragma once

#include "products/can_device.hpp"
#include "products/ismk/alarms.hpp"
#include "products/ismk/motion.hpp"
#include "products/ismk/object_table.hpp"
#include "products/ismk/policy.hpp"
#include "products/ismk/ratings.hpp"
#include "products/ismk/registers.hpp"
#include "products/ismk/terminals.hpp"
#include "products/ismk/tuning.hpp"

namespace servodrome::products {

// Kinco iSMK integrated servo, variant AA: CANopen and RS485.
class Ismk final : public CanDevice<Ismk, ismk::Objects> {
 public:
  static constexpr std::span<const dictionary::Entry> table{ismk::object_table};
  static constexpr drive::Policy policy = ismk::make_policy();
  static constexpr dictionary::LengthAborts length_aborts{};
  static constexpr canopen::Profile profile{.rpdo_types = {.synchronous_remote = false, .asynchronous_remote = false},
                                            .inhibit_time_unit = std::chrono::milliseconds(1),  // L3034, L3042
                                            .sdo_block = false,                         // five services, L2721-2727
                                            .sdo_download_response_echoes_data = true,  // L2824, L2855-2904
                                            .sdo_expedited_upload_sign_extends = true,  // L2866, L2890
                                            .time_consumer = false,
                                            .lss = false};
  static constexpr std::uint8_t factory_node_id = 1;          // L879
  static constexpr std::uint32_t factory_bit_rate = 500'000;  // L3211

  static constexpr std::span<const modbus::Register> registers{ismk::registers};
  static constexpr modbus::Profile modbus_profile = ismk::modbus_profile;

  explicit Ismk(const Settings& settings) : CanDevice(settings) {}

  // What the RS485 port can be set to: 8N1 at one of four bit rates.
  static bool supports(const modbus::CharacterFormat& format);

  SerialPort* serial_port() override { return &serial_port_; }

  // The rating of Settings::model; the default one for a name that is not known.
  const Model& rating() const;

  void power_on(const drive::Feedback& feedback, Time now) override;
  void cycle(Time now) override;

  // What the manual describes and prints no objects for.
  const ismk::Terminals& terminals() const { return terminals_; }
  const ismk::AlarmLog& alarm_log() const { return alarm_log_; }  // outlives power cycles
  const PastFault* past_fault(std::size_t n) const override { return n < alarm_log_.size() ? &alarm_log_[n] : nullptr; }
  const ismk::LoopTuning& loop_tuning() const { return tuning_; }
  // Functions of the PC software (L943-949): see LoopTuning.
  bool recognise_inertia(double turns) { return tuning_.recognise_inertia(drive(), turns); }
  void set_rigidity(double bandwidth_hz);
  std::array<char, 6> display();  // the alarm, "000.0" without one
  ismk::Capture capture(std::size_t unit) { return ismk::Terminals::capture(drive(), unit); }
  void rearm_capture(std::size_t unit, bool rising) { ismk::Terminals::rearm(drive(), unit, rising); }

 private:
  friend CanDevice;
  friend ServoDevice;

  void prepare(dictionary::Area areas);
  void loaded(dictionary::Area) { ismk::MotionControl::loaded(objects()); }
  drive::Configuration configuration();
  std::uint8_t chosen_node_id() const { return static_cast<std::uint8_t>(objects().buses.station); }
  std::uint32_t chosen_bit_rate() const;

  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override;
  void written(const dictionary::Entry& entry) override;
  void refresh(const dictionary::Entry& entry) override;

  // storage.cpp
  dictionary::AbortCode store_parameters(std::int64_t command);
  dictionary::AbortCode store_motor_data(std::int64_t command);
  dictionary::AbortCode request_restart(std::int64_t command);
  void initialise_parameters();
  void restart(Time now);

  void prepare_rs485(dictionary::Area areas);
  void open_serial_port();
  void select_protocol();

  // --- canopen::DeviceEvents
  void reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) override;
  void sync(std::uint8_t counter, Time now) override;
  canopen::LossReaction communication_lost(canopen::LossCause cause, canopen::LossReaction standard) override;

  // --- drive::DriveEvents
  void fault_raised(const drive::FaultRow& fault) override;
  void errors_gone(std::uint8_t remaining) override;

  ismk::MotionControl motion_control_{};
  bool restart_requested_ = false;
  SerialPort serial_port_{dictionary(), registers, modbus_profile};
  ismk::Terminals terminals_{};
  ismk::AlarmLog alarm_log_{};
  ismk::LoopTuning tuning_{};
};

}  // namespace servodrome::products
