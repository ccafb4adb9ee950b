#pragma once

#include <array>

#include "ethercat/sii/image.hpp"
#include "ethercat/slave/communication_section.hpp"
#include "ethercat/slave/slave.hpp"
#include "products/servo_device.hpp"

namespace servodrome::products {

// Sizes of what an EtherCAT device keeps in memory.
struct EthercatSizes {
  std::size_t mapped_objects = 48;  // per direction
  std::size_t mailbox_bytes = 512;
  std::size_t sdo_bytes = 1024;  // largest object that goes in segments
  std::size_t sii_bytes = 2048;  // a multiple of 128
};

// An EtherCAT servo drive put together from a product's tables. In addition to what ServoDevice requires, `Product`
// provides
//   ethercat_profile                                                what the slave offers
//   static ethercat::SiiDescription sii_description(const Settings&)    further content of its information memory
template <typename Product, typename ProductObjects, EthercatSizes Sizes = EthercatSizes{}>
class EthercatDevice : public ServoDevice<Product, ProductObjects>, protected ethercat::SlaveEvents {
 private:
  using Base = ServoDevice<Product, ProductObjects>;

 public:
  using Base::bus_dictionary;
  using Base::dictionary;
  using Base::drive;
  using typename Base::Communication;
  static constexpr std::size_t sii_bytes = Sizes.sii_bytes;

  explicit EthercatDevice(const Settings& its_settings)
      : EthercatDevice(its_settings, Base::composition_of_product(), Product::ethercat_profile,
                       Product::sii_description(its_settings)) {}
  EthercatDevice(const Settings& its_settings, const Composition& composition, const ethercat::Profile& profile,
                 const ethercat::SiiDescription& sii)
      : Base(its_settings, composition), slave_(esc_, bus_dictionary(), profile, *this, storage_.memory()) {
    listen(dictionary::Owner::communication, bus_dictionary().listener(dictionary::Owner::communication));
    // The slave information memory is written here and not at power-on: it is non-volatile, and a master may change it.
    ethercat::write_sii_image(sii, profile, composition.bus_table, sii_);
    esc_.clock().set_oscillator(its_settings.ethercat.oscillator_ppb, Time{});
  }

  void power_on(const drive::Feedback& feedback, Time now) override {
    Base::clear_objects();
    load_objects(dictionary::Area::all);
    if (const auto limit = settings().ethercat.sync_error_limit) objects().communication.sync_error_limit = *limit;
    drive().configure(product().configuration());
    drive().power_on(feedback);
    esc_.power_on(now);
    slave_.start(now);
    tell_lost_values();
  }
  void power_off() override {}

  void cycle(Time now) override { slave_.process_image_updated(now); }
  void poll(Time now) override { slave_.poll(now); }
  Time next_deadline() override { return slave_.next_deadline(); }

  // The lamps RUN and ERR of ETG.1300.
  Lamps lamps(Time) override {
    Lamps lamps;
    lamps.add(blinking_lamp("RUN", "green", ethercat::run_indicator(slave_.state())));
    lamps.add(blinking_lamp("ERR", "red", ethercat::error_indicator(slave_.error(), slave_.status_code())));
    return lamps;
  }

  ethercat::Slave* ethercat_slave() override { return &slave_; }
  ethercat::Esc* ethercat_controller() override { return &esc_; }
  ethercat::Slave& slave() { return slave_; }
  ethercat::Esc& esc() { return esc_; }
  // The present content of the slave information memory.
  std::span<const std::uint8_t> sii() const { return sii_; }

 protected:
  using Base::forget;
  using Base::keep;
  using Base::listen;
  using Base::load_objects;
  using Base::objects;
  using Base::product;
  using Base::save;
  using Base::settings;
  using Base::tell_lost_values;

  ~EthercatDevice() = default;

  // --- ethercat::SlaveEvents
  void state_changed(ethercat::AlState from, ethercat::AlState, ethercat::AlStatusCode, Time) override {
    // Outputs are no longer valid: 6007h determines the reaction (ETG.6010 clause 5.2).
    if (from == ethercat::AlState::operational) drive().communication_lost();
  }
  void process_data(Time) override { drive().synchronise(); }
  dictionary::AbortCode store(dictionary::Area areas) override { return save(areas); }
  dictionary::AbortCode restore_defaults(dictionary::Area areas) override { return forget(areas); }

  // --- drive::DriveEvents
  void fault_raised(const drive::FaultRow& fault) override { report(fault.code, fault.error_register); }
  void warning_raised(const drive::FaultRow& warning) override { report(warning.code, warning.error_register); }
  void errors_gone(std::uint8_t remaining) override {
    objects().communication.error_register = remaining;
    slave_.emergency(0, remaining, {});
  }

  // Sends an emergency over the mailbox and sets 1001h.
  void report(std::uint16_t code, std::uint8_t error_register, const std::array<std::uint8_t, 5>& data = {}) {
    std::uint8_t& shown = objects().communication.error_register;
    shown = static_cast<std::uint8_t>(shown | error_register);
    slave_.emergency(code, shown, data);
  }

 private:
  std::array<std::uint8_t, Sizes.sii_bytes> sii_{};
  ethercat::Esc esc_{sii_};
  ethercat::SlaveStorage<Sizes.mapped_objects, Sizes.mailbox_bytes, Sizes.sdo_bytes> storage_{};
  ethercat::Slave slave_;
};

}  // namespace servodrome::products
