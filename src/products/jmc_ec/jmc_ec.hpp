#pragma once

#include "products/ethercat_device.hpp"
#include "products/jmc_ec/leds.hpp"
#include "products/jmc_ec/monitor.hpp"
#include "products/jmc_ec/object_table.hpp"
#include "products/jmc_ec/panel_control.hpp"
#include "products/jmc_ec/policy.hpp"
#include "products/jmc_ec/ratings.hpp"
#include "products/jmc_ec/service_port.hpp"

namespace servodrome::products {

// JMC EC series on EtherCAT: the integrated servos IHSV-EC, the stepper drives 2HSS458-EC and 2DM542-EC.
class JmcEc final
    : public EthercatDevice<JmcEc, jmc_ec::Objects, EthercatSizes{.mapped_objects = 48, .sii_bytes = 4096}> {
 public:
  static constexpr std::span<const dictionary::Entry> table{jmc_ec::object_table};
  static constexpr std::span<const dictionary::Entry> bus_table{jmc_ec::bus_object_table};
  static constexpr drive::Policy policy = jmc_ec::make_policy();
  static constexpr dictionary::LengthAborts length_aborts{};
  static constexpr ethercat::Profile ethercat_profile{.greatest_outputs = jmc_ec::process_data_bytes,
                                                      .greatest_inputs = jmc_ec::process_data_bytes,
                                                      .greatest_pdo = jmc_ec::pdo_bytes,
                                                      .mapped_length_may_differ = true,  // 60FDh with 16 bits, D-05
                                                      .empty_mapping = jmc_ec::empty_mapping,
                                                      .start_up = jmc_ec::start_up,
                                                      .least_cycle = std::chrono::microseconds(250),
                                                      .cycle_too_short = ethercat::AlStatusCode{0x002E}};  // E61B
  static ethercat::SiiDescription sii_description(const Settings& settings);

  // The service port.
  static constexpr std::span<const modbus::Register> registers{jmc_ec::service_registers};
  static constexpr modbus::Profile modbus_profile = jmc_ec::service_profile;
  static bool supports(const modbus::CharacterFormat& format);

  explicit JmcEc(const Settings& settings) : EthercatDevice(settings) {}

  // The rating of Settings::model; an unknown name gives the default.
  const jmc_ec::Rating& rating() const { return jmc_ec::find_rating(settings().model); }

  SerialPort* serial_port() override { return &serial_port_; }

  void power_on(const drive::Feedback& feedback, Time now) override;
  void cycle(Time now) override;

  // Functions that the manual describes without objects. The alarm to show: the first fault, else the error of the bus,
  // else a warning; "" if there is none.
  jmc_ec::AlarmText alarm() { return jmc_ec::alarm_text(alarm_to_show().number); }
  jmc_ec::Leds leds(Time now);
  Lamps lamps(Time now) override;
  const jmc_ec::PanelControl& panel() const { return panel_control_; }

 private:
  friend EthercatDevice;
  friend ServoDevice;

  void prepare(dictionary::Area areas);
  void loaded(dictionary::Area) { start_panel(); }
  drive::Configuration configuration() const;

  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override;
  void written(const dictionary::Entry& entry) override;
  void refresh(const dictionary::Entry& entry) override;
  void set_position_window();

  // panel.cpp
  drive::MotorData rated_motor() const;
  void prepare_panel();
  void configure_panel(drive::Configuration& configuration) const;
  void start_panel();
  void cycle_panel();
  dictionary::AbortCode check_panel(const dictionary::Entry& entry, std::int64_t value);
  void panel_written(const dictionary::Entry& entry);

  // alarms.cpp
  struct Alarm {
    std::uint16_t code = 0;  // of 603Fh
    std::uint16_t number = jmc_ec::no_alarm_number;
  };
  Alarm alarm_to_show();
  void show_alarm();
  void follow_bus_error();
  void bus_error(ethercat::AlStatusCode code);

  // --- ethercat::SlaveEvents
  ethercat::AlStatusCode may_change(ethercat::AlState from, ethercat::AlState to) override;
  void state_changed(ethercat::AlState from, ethercat::AlState to, ethercat::AlStatusCode cause, Time now) override;

  // --- drive::DriveEvents
  void fault_raised(const drive::FaultRow& fault) override;
  void warning_raised(const drive::FaultRow& warning) override;
  void errors_gone(std::uint8_t remaining) override;

  jmc_ec::PanelControl panel_control_{};
  jmc_ec::Monitor monitor_{};
  SerialPort serial_port_{dictionary(), registers, modbus_profile};
  bool was_energised_ = false;
  bool position_change_written_ = false;  // 607Bh
  double set_point_period_s_ = 0.0;       // of SYNC0; 0: 60C2h
  ethercat::AlStatusCode bus_error_ = ethercat::AlStatusCode::none;
  bool fault_told_ = false;  // reported by an emergency
  std::uint32_t frames_ = 0;
  Time last_frame_{-1};  // time of the last traffic; -1: none yet
};

}  // namespace servodrome::products
