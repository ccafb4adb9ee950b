#pragma once

#include <algorithm>
#include <array>

#include "canopen/301/communication_section.hpp"
#include "canopen/node.hpp"
#include "products/servo_device.hpp"

namespace servodrome::products {

// The communication objects of a node, which determine the size of its memory. A product whose PDOs are not in its
// struct specialises this.
template <typename ProductObjects>
struct NodeSizes {
  using Communication = decltype(ProductObjects::communication);
};

// A CANopen servo drive put together from a product's tables. In addition to what ServoDevice requires, `Product`
// provides
//   profile, factory_node_id, factory_bit_rate
//   std::uint8_t chosen_node_id() const, std::uint32_t chosen_bit_rate() const     as the objects request
template <typename Product, typename ProductObjects, std::size_t SdoBufferBytes = 64>
class CanDevice : public ServoDevice<Product, ProductObjects>, protected canopen::DeviceEvents {
 private:
  using Base = ServoDevice<Product, ProductObjects>;

 public:
  using Base::bus_dictionary;
  using Base::dictionary;
  using Base::drive;
  using typename Base::Communication;

  explicit CanDevice(const Settings& its_settings)
      : CanDevice(its_settings, Base::composition_of_product(), Product::profile) {}
  CanDevice(const Settings& its_settings, const Composition& composition, const canopen::Profile& profile)
      : Base(its_settings, composition), node_(bus_dictionary(), profile, *this, storage_.memory()) {
    listen(dictionary::Owner::communication, bus_dictionary().listener(dictionary::Owner::communication));
  }

  void power_on(const drive::Feedback& feedback, Time now) override {
    Base::clear_objects();
    load_objects(dictionary::Area::all, settings().node_id != 0 ? settings().node_id : Product::factory_node_id);
    // The node-ID may be a saved value, and defaults of other objects depend on it.
    node_id_ = product().chosen_node_id();
    bit_rate_ = product().chosen_bit_rate();
    load_objects(dictionary::Area::all, node_id_);
    drive().configure(product().configuration());
    drive().power_on(feedback);
    last_sync_ = {};
    switch_bit_rate_at_ = canopen::never;
    node_.start(node_id_, now);
    tell_lost_values();
  }
  void power_off() override {
    canopen::Frame frame;
    while (node_.take(frame)) {
    }
  }

  void cycle(Time now) override {
    node_.process_image_updated(now);
    watch_sync(now);
    if (now >= switch_bit_rate_at_) {
      bit_rate_ = next_bit_rate_;
      switch_bit_rate_at_ = canopen::never;
    }
    if constexpr (Product::policy.communication.errors_are_warnings) drive().show_warning(node_.communication_error());
  }
  void receive(const canopen::Frame& frame, Time now) override { node_.receive(frame, now); }
  void poll(Time now) override { node_.poll(now); }
  Time next_deadline() override { return node_.next_deadline(); }
  bool take(canopen::Frame& frame) override { return node_.take(frame); }
  const canopen::WaitingFrame* next_frame() override { return node_.next_frame(); }
  void frame_sent(const canopen::Frame& frame) override { node_.frame_sent(frame); }

  canopen::Node& node() { return node_; }
  canopen::Node* can_node() override { return &node_; }
  std::uint8_t node_id() const override { return node_.node_id(); }
  std::uint32_t bit_rate() const override { return bit_rate_; }

 protected:
  using Base::drive_objects;
  using Base::forget;
  using Base::keep;
  using Base::listen;
  using Base::load_objects;
  using Base::objects;
  using Base::product;
  using Base::save;
  using Base::save_objects;
  using Base::settings;
  using Base::tell_lost_values;

  ~CanDevice() = default;

  // bit_rate() changes to `bit_rate` (bit/s) in the first cycle from `at` on.
  void switch_bit_rate(std::uint32_t bit_rate, Time at) {
    next_bit_rate_ = bit_rate;
    switch_bit_rate_at_ = at;
  }

  // --- canopen::DeviceEvents
  void reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) override {
    load_objects(restore, node_id);
    drive().configure(product().configuration());
    if (command == canopen::NmtCommand::reset_node) {
      drive().restart();
    } else {
      drive().objects_loaded();
      abort_connection();
    }
    tell_lost_values();
  }
  void nmt_state_changed(canopen::NmtState state) override {
    if (state == canopen::NmtState::stopped) abort_connection();
  }
  dictionary::AbortCode store(dictionary::Area areas) override { return save(areas); }
  dictionary::AbortCode restore_defaults(dictionary::Area areas) override { return forget(areas); }
  void sync(std::uint8_t, canopen::Time now) override {
    last_sync_ = now;
    drive().synchronise();
  }
  canopen::LossReaction communication_lost(canopen::LossCause cause, canopen::LossReaction standard) override {
    if constexpr (Product::policy.communication.loss_is_always_fault) {
      drive().communication_lost(cause == canopen::LossCause::bus_off ? drive::Cause::bus_off
                                                                      : drive::Cause::communication_lost);
      standard.emergency_code = 0;  // the drive's own error reports the loss
      return standard;
    }
    reported_by_node_ = standard.emergency_code;
    drive().communication_lost();
    reported_by_node_ = 0;
    return standard;
  }

  // --- drive::DriveEvents
  void fault_raised(const drive::FaultRow& fault) override {
    if (reported_by_node_ == 0) {
      node_.raise(fault.code, fault.error_register);
    } else {
      drive_objects().error_code = reported_by_node_;  // 603Fh shows the code of the EMCY
      node_.hold(fault.error_register);
    }
  }
  void warning_raised(const drive::FaultRow& warning) override { node_.raise(warning.code, warning.error_register); }
  void errors_gone(std::uint8_t remaining) override { node_.clear(remaining); }

 private:
  // Raises 8700h if no SYNC arrives for two periods 1006h while a cyclic synchronous mode needs SYNC: since the last
  // SYNC, or since the mode began to need SYNC.
  void watch_sync(Time now) {
    const auto period = std::chrono::microseconds(objects().communication.communication_cycle_period_us);
    const bool needs = period.count() != 0 && drive::is_cyclic_synchronous(drive().mode()) &&
                       drive().state() == drive::PowerState::operation_enabled;
    if (!needs) {
      without_need_ = now;
    } else if (now - std::max(last_sync_, without_need_) > 2 * period) {
      drive().raise(drive::Cause::sync_lost);
    }
  }

  // 6007h also determines the reaction when the node is stopped or its communication is reset. In a product without
  // that object the drive continues.
  void abort_connection() {
    if (Product::policy.communication.nmt_aborts_connection && dictionary().find(0x6007, 0) != nullptr)
      drive().communication_lost();
  }

  canopen::NodeStorageFor<typename NodeSizes<ProductObjects>::Communication, SdoBufferBytes> storage_{};
  canopen::Node node_;
  std::uint16_t reported_by_node_ = 0;  // code of the EMCY that the node itself is about to send
  Time last_sync_{};                    // 0: none since power on
  Time without_need_{};                 // the last cycle in which no mode needed SYNC
  std::uint8_t node_id_ = Product::factory_node_id;
  std::uint32_t bit_rate_ = Product::factory_bit_rate;
  std::uint32_t next_bit_rate_ = 0;
  Time switch_bit_rate_at_ = canopen::never;
};

}  // namespace servodrome::products
