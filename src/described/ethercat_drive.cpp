#include "described/ethercat_drive.hpp"

namespace servodrome::described {
namespace {

// The information memory of the description, with serial number and alias of this slave.
ethercat::SiiDescription sii_of(const Blueprint& blueprint, const products::Settings& settings) {
  ethercat::SiiDescription sii = blueprint.ethercat->sii;
  sii.serial_number = settings.serial_number;
  sii.station_alias = settings.ethercat.station_alias;
  return sii;
}

}  // namespace

EthercatDrive::EthercatDrive(std::shared_ptr<const Blueprint> blueprint, const products::Settings& settings)
    : EthercatDevice(settings, {blueprint->table, blueprint->table, blueprint->policy, blueprint->object_bytes},
                     blueprint->ethercat->profile, sii_of(*blueprint, settings)),
      blueprint_(std::move(blueprint)) {}

// With SYNC0 the period of the set-points is that of SYNC0, whatever the master writes to 60C2h. From PREOP to SAFEOP
// 60C2h gets the period of SYNC0, if it can represent it.
void EthercatDrive::state_changed(ethercat::AlState from, ethercat::AlState to, ethercat::AlStatusCode cause,
                                  products::Time now) {
  EthercatDevice::state_changed(from, to, cause, now);
  if (to == ethercat::AlState::init && set_point_period_s_ != 0.0) {
    set_point_period_s_ = 0.0;
    reconfigure();
  }
  if (from != ethercat::AlState::pre_operational || to != ethercat::AlState::safe_operational) return;
  const auto period = static_cast<std::uint32_t>(dictionary().number(0x1C32, 0x0A));
  products::generic402::set_interpolation_period(drive_objects(), period);
  set_point_period_s_ = 1e-9 * period;
  reconfigure();
}

}  // namespace servodrome::described
