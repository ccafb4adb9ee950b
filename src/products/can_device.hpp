#pragma once

#include <array>
#include <cstddef>

#include "canopen/301/communication_section.hpp"
#include "canopen/node.hpp"
#include "dictionary/store.hpp"
#include "drive/drive.hpp"
#include "products/device.hpp"

namespace servodrome::products {

// A CANopen servo drive put together from a product's tables. `Product` derives from CanDevice<Product, ...> and gives
//   Objects                        plain struct with members `communication` and `drive`
//   table, policy, profile, length_aborts           the product as data
//   factory_node_id, factory_bit_rate
//   void prepare(Area)             values of these areas that are not defaults: identity, nameplate
//   void loaded(Area)              optional: values that follow from the saved ones
//   drive::Configuration configuration() const      from the present objects and the motor
//   std::uint8_t chosen_node_id() const, std::uint32_t chosen_bit_rate() const     what the objects ask for
//   product_check, product_written, product_refresh for objects of Owner::product
template <typename Product, typename ProductObjects, std::size_t SdoBufferBytes = 64>
class CanDevice : public Device,
                  protected canopen::DeviceEvents,
                  protected drive::DriveEvents,
                  protected dictionary::Listener {
 public:
  using Communication = decltype(ProductObjects::communication);

  explicit CanDevice(const Settings& settings)
      : settings_(settings),
        dictionary_(Product::table, std::as_writable_bytes(std::span(&objects_, 1)), Product::length_aborts),
        drive_(Product::policy, objects_.drive, offsetof(ProductObjects, drive)),
        node_(dictionary_, Product::profile, *this, storage_.memory()) {
    drive_.set_events(this);
    dictionary_.set_listener(dictionary::Owner::drive, &drive_);
    dictionary_.set_listener(dictionary::Owner::product, this);
  }
  CanDevice(const CanDevice&) = delete;
  CanDevice& operator=(const CanDevice&) = delete;

  void power_on(const drive::Feedback& feedback, Time now) override {
    objects_ = {};
    load_objects(dictionary::Area::all, settings_.node_id != 0 ? settings_.node_id : Product::factory_node_id);
    // The node id may itself be a saved value, and defaults depend on it.
    node_id_ = product().chosen_node_id();
    bit_rate_ = product().chosen_bit_rate();
    load_objects(dictionary::Area::all, node_id_);
    drive_.configure(product().configuration());
    drive_.power_on(feedback);
    last_sync_ = {};
    node_.start(node_id_, now);
  }
  void power_off() override {
    canopen::Frame frame;
    while (node_.take(frame)) {
    }
  }

  void cycle(Time now) override {
    node_.process_image_updated(now);
    // 8700h: a SYNC that is expected every 1006h does not come while the axis depends on it.
    const auto period = std::chrono::microseconds(objects_.communication.communication_cycle_period_us);
    const bool depends = period.count() != 0 && last_sync_ != Time{} && drive::is_cyclic_synchronous(drive_.mode()) &&
                         drive_.state() == drive::PowerState::operation_enabled;
    if (depends && now - last_sync_ > 2 * period) drive_.raise(drive::Cause::sync_lost);
    if constexpr (Product::policy.communication_errors_are_warnings) drive_.show_warning(node_.communication_error());
  }
  void receive(const canopen::Frame& frame, Time now) override { node_.receive(frame, now); }
  void poll(Time now) override { node_.poll(now); }
  Time next_deadline() const override { return node_.next_deadline(); }
  bool take(canopen::Frame& frame) override { return node_.take(frame); }

  drive::Drive& drive() override { return drive_; }
  dictionary::Dictionary& dictionary() override { return dictionary_; }
  canopen::Node& node() override { return node_; }
  std::uint8_t node_id() const override { return node_.node_id(); }
  std::uint32_t bit_rate() const override { return bit_rate_; }

 protected:
  ~CanDevice() = default;

  const Settings& settings() const { return settings_; }
  ProductObjects& objects() { return objects_; }
  const ProductObjects& objects() const { return objects_; }
  void reconfigure() { drive_.configure(product().configuration()); }

  // Saves an area at once, as products do with values that a user need not store himself.
  dictionary::AbortCode save(dictionary::Area areas) {
    if (settings_.store == nullptr) return dictionary::AbortCode::hardware_error;
    return dictionary::Store(*settings_.store).save(dictionary_, areas);
  }

  // The objects of these areas have their saved values: for what follows from them.
  void loaded(dictionary::Area) {}

  // --- canopen::DeviceEvents
  void reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) override {
    load_objects(restore, node_id);
    drive_.configure(product().configuration());
    if (command == canopen::NmtCommand::reset_node) {
      drive_.restart();
    } else {
      drive_.objects_loaded();
      abort_connection();
    }
  }
  void nmt_state_changed(canopen::NmtState state) override {
    if (state == canopen::NmtState::stopped) abort_connection();
  }
  dictionary::AbortCode store(dictionary::Area areas) override { return save(areas); }
  dictionary::AbortCode restore_defaults(dictionary::Area areas) override {
    if (settings_.store == nullptr) return dictionary::AbortCode::hardware_error;
    return dictionary::Store(*settings_.store).restore_defaults(areas);
  }
  void sync(std::uint8_t, canopen::Time now) override {
    last_sync_ = now;
    drive_.synchronise();
  }
  canopen::LossReaction communication_lost(canopen::LossCause cause, canopen::LossReaction standard) override {
    if constexpr (Product::policy.communication_loss_is_always_fault) {
      drive_.communication_lost(cause == canopen::LossCause::bus_off ? drive::Cause::bus_off
                                                                     : drive::Cause::communication_lost);
      standard.emergency_code = 0;  // the drive's own error tells it
      return standard;
    }
    reported_by_node_ = standard.emergency_code;
    drive_.communication_lost();
    reported_by_node_ = 0;
    return standard;
  }

  // --- drive::DriveEvents
  void fault_raised(const drive::FaultRow& fault) override {
    if (reported_by_node_ == 0) {
      node_.raise(fault.code, fault.error_register);
    } else {
      objects_.drive.error_code = reported_by_node_;  // 603Fh tells what the EMCY tells
    }
  }
  void warning_raised(const drive::FaultRow& warning) override { node_.raise(warning.code, warning.error_register); }
  void errors_gone(std::uint8_t remaining) override { node_.clear(remaining); }

  // --- dictionary::Listener for Owner::product
  dictionary::AbortCode check(const dictionary::Entry&, std::span<const std::byte>) override {
    return dictionary::AbortCode::none;
  }

 private:
  Product& product() { return static_cast<Product&>(*this); }

  // 6007h also tells what to do when the node is stopped or its communication is reset; a product without that object
  // goes on.
  void abort_connection() {
    if (Product::policy.nmt_aborts_connection && dictionary_.find(0x6007, 0) != nullptr) drive_.communication_lost();
  }

  void load_objects(dictionary::Area areas, std::uint8_t node_id) {
    load_factory_values(areas, node_id);
    if (settings_.store != nullptr && !dictionary::Store(*settings_.store).load(dictionary_, areas)) {
      load_factory_values(areas, node_id);  // nothing saved, or the memory failed halfway
    }
    product().loaded(areas);
  }
  void load_factory_values(dictionary::Area areas, std::uint8_t node_id) {
    dictionary_.load_defaults(areas, node_id);
    product().prepare(areas);
  }

  Settings settings_;
  ProductObjects objects_{};
  dictionary::Dictionary dictionary_;
  drive::Drive drive_;
  canopen::NodeStorage<Communication::rpdo_count, Communication::tpdo_count, Communication::mapping_entries,
                       Communication::heartbeat_consumer_count, SdoBufferBytes>
      storage_{};
  canopen::Node node_;
  std::uint16_t reported_by_node_ = 0;  // code of the EMCY that the node itself is about to send
  Time last_sync_{};                    // 0: none since power on
  std::uint8_t node_id_ = Product::factory_node_id;
  std::uint32_t bit_rate_ = Product::factory_bit_rate;
};

}  // namespace servodrome::products
