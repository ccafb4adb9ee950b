#include "products/generic402/generic402_ec.hpp"

namespace servodrome::products {

ethercat::SiiDescription Generic402Ec::sii_description(const Settings& settings) {
  static constexpr std::array dc_modes{
      ethercat::DcMode{.name = "DC", .description = "DC-Synchron", .assign_activate = 0x0300, .sync0_factor = 1},
      ethercat::DcMode{.name = "FreeRun", .description = "FreeRun or SM-Synchron"},
  };
  return {.vendor_id = vendor_id,
          .product_code = generic402::ethercat_product_code,
          .revision_number = generic402::revision_number,
          .serial_number = settings.serial_number,
          .station_alias = settings.ethercat.station_alias,
          .group = "Drives",
          .order = "generic402-ec",
          .name = "Servodrome CiA 402 reference drive",
          .dc_modes = dc_modes};
}

void Generic402Ec::prepare(dictionary::Area areas) {
  objects().communication.serial_number = settings().serial_number;
  generic402::prepare(objects().manufacturer, objects().drive, settings(), areas);
}

drive::Configuration Generic402Ec::configuration() const {
  drive::Configuration configuration = generic402::configuration(objects().manufacturer, settings().motor);
  configuration.set_point_period_s = set_point_period_s_;
  return configuration;
}

// With SYNC0 the period of set-points is the period of SYNC0, for any value of 60C2h. 60C2h is set to this period if it
// can represent it.
void Generic402Ec::state_changed(ethercat::AlState from, ethercat::AlState to, ethercat::AlStatusCode cause, Time now) {
  EthercatDevice::state_changed(from, to, cause, now);
  if (to == ethercat::AlState::init && set_point_period_s_ != 0.0) {
    set_point_period_s_ = 0.0;
    reconfigure();
  }
  if (from != ethercat::AlState::pre_operational || to != ethercat::AlState::safe_operational) return;
  const std::uint32_t period_ns = objects().communication.output_sync.sync0_cycle_time_ns;
  generic402::set_interpolation_period(objects().drive, period_ns);
  set_point_period_s_ = 1e-9 * period_ns;
  reconfigure();
}

void Generic402Ec::written(const dictionary::Entry& entry) {
  if (entry.index < 0x2F00) reconfigure();
}

void Generic402Ec::refresh(const dictionary::Entry& entry) {
  if (entry.index == 0x2060) objects().manufacturer.i2t_utilisation = generic402::i2t_utilisation(drive());
}

}  // namespace servodrome::products
