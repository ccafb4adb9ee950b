#include "products/generic402/generic402_ec.hpp"

namespace servodrome::products {

ethercat::SiiDescription Generic402Ec::sii_description(const Settings& settings) {
  static constexpr std::array dc_modes{
      ethercat::DcMode{.name = "DC", .description = "DC-Synchron", .assign_activate = 0x0300},
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
  return generic402::configuration(objects().manufacturer, settings().motor);
}

void Generic402Ec::written(const dictionary::Entry& entry) {
  if (entry.index < 0x2F00) reconfigure();
}

void Generic402Ec::refresh(const dictionary::Entry& entry) {
  if (entry.index == 0x2060) objects().manufacturer.i2t_utilisation = generic402::i2t_utilisation(drive());
}

}  // namespace servodrome::products
