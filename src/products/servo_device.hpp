#pragma once

#include <cstddef>

#include "dictionary/store.hpp"
#include "drive/drive.hpp"
#include "products/device.hpp"

namespace servodrome::products {

// The parts of a device: constants of its product, or data that the program builds from a description at run time.
struct Composition {
  std::span<const dictionary::Entry> table;
  std::span<const dictionary::Entry> bus_table;  // the part that the fieldbus can access
  const drive::Policy& policy;
  std::size_t object_bytes = 0;  // memory of the objects; 0: the product's struct
};

// The memory of a device's objects, which is part of the device. A product whose objects are not in a struct
// specialises this.
template <typename ProductObjects>
class ObjectMemory {
 public:
  explicit ObjectMemory(const Composition&) {}

  ProductObjects& objects() { return objects_; }
  const ProductObjects& objects() const { return objects_; }
  std::span<std::byte> bytes() { return std::as_writable_bytes(std::span(&objects_, 1)); }
  void clear() { objects_ = {}; }

 private:
  ProductObjects objects_{};
};

// The common part of servo drives on all fieldbuses: objects, dictionary, drive and non-volatile memory, put together
// from a product's tables. `Product` derives from CanDevice<Product, ...> or EthercatDevice<Product, ...>, which derive
// from this, and provides
//   table, policy, length_aborts   the product as data
//   void prepare(Area)             values of these areas that are not defaults: identity, nameplate
//   void loaded(Area)              optional: values that follow from the saved ones
//   drive::Configuration configuration() const      from the present objects and the motor
//   bus_table                      optional: what the fieldbus sees of the table (dictionary::make_bus_table)
// or hands a Composition to the constructor in place of `table`, `bus_table` and `policy`.
// `ProductObjects` is a plain struct with members `communication` and `drive`; a product with variants for several
// fieldbuses has `drive` in a member `servo` that they share.
template <typename Product, typename ProductObjects>
class ServoDevice : public Device, protected drive::DriveEvents, protected dictionary::Listener {
 public:
  using Communication = decltype(ProductObjects::communication);

  ServoDevice(const ServoDevice&) = delete;
  ServoDevice& operator=(const ServoDevice&) = delete;

  drive::Drive& drive() override { return drive_; }
  dictionary::Dictionary& dictionary() override { return dictionary_; }
  dictionary::Dictionary& bus_dictionary() override { return bus_dictionary_; }

 protected:
  ServoDevice(const Settings& settings, const Composition& composition)
      : settings_(settings),
        memory_(composition),
        dictionary_(composition.table, memory_.bytes(), Product::length_aborts),
        bus_dictionary_(composition.bus_table, memory_.bytes(), Product::length_aborts),
        drive_(composition.policy, drive_objects(), drive_offset()) {
    drive_.set_events(this);
    listen(dictionary::Owner::drive, &drive_);
    listen(dictionary::Owner::product, this);
  }
  drive::Objects& drive_objects() {
    if constexpr (requires(ProductObjects all) { all.servo; }) {
      return objects().servo.drive;
    } else {
      return objects().drive;
    }
  }
  static constexpr std::size_t drive_offset() {
    if constexpr (requires(ProductObjects all) { all.servo; }) {
      return offsetof(ProductObjects, servo) + offsetof(decltype(ProductObjects::servo), drive);
    } else {
      return offsetof(ProductObjects, drive);
    }
  }
  static constexpr std::span<const dictionary::Entry> table_of_bus() {
    if constexpr (requires { Product::bus_table; }) {
      return Product::bus_table;
    } else {
      return Product::table;
    }
  }
  static constexpr Composition composition_of_product() { return {Product::table, table_of_bus(), Product::policy}; }
  void listen(dictionary::Owner owner, dictionary::Listener* listener) {
    dictionary_.set_listener(owner, listener);
    bus_dictionary_.set_listener(owner, listener);
  }
  ~ServoDevice() = default;

  const Settings& settings() const { return settings_; }
  ProductObjects& objects() { return memory_.objects(); }
  const ProductObjects& objects() const { return memory_.objects(); }
  void clear_objects() { memory_.clear(); }
  Product& product() { return static_cast<Product&>(*this); }
  void reconfigure() { drive_.configure(product().configuration()); }

  // Saves an area at once.
  dictionary::AbortCode save(dictionary::Area areas) {
    if (settings_.store == nullptr) return dictionary::AbortCode::hardware_error;
    return dictionary::Store(*settings_.store).save(dictionary_, areas);
  }

  // Saves single objects at once; their keys (Entry::key) in ascending order. Other values are not saved by this, and
  // defaults that were restored by 1011h stay restored.
  dictionary::AbortCode save_objects(std::span<const std::uint32_t> keys) {
    if (settings_.store == nullptr) return dictionary::AbortCode::hardware_error;
    return dictionary::Store(*settings_.store).save_objects(dictionary_, keys);
  }

  // `save` and `save_objects` for values that the device saves by itself: a failure of the memory is a fault.
  void keep(dictionary::Area areas, drive::Cause failed = drive::Cause::memory) {
    if (settings_.store != nullptr && save(areas) != dictionary::AbortCode::none) drive_.raise(failed);
  }
  void keep(const dictionary::Entry& entry) {
    const std::uint32_t key = entry.key();
    if (settings_.store != nullptr && save_objects({&key, 1}) != dictionary::AbortCode::none) {
      drive_.raise(drive::Cause::memory);
    }
  }

  // Deletes saved values; this acts after the next restart.
  dictionary::AbortCode forget(dictionary::Area areas) {
    if (settings_.store == nullptr) return dictionary::AbortCode::hardware_error;
    return dictionary::Store(*settings_.store).restore_defaults(dictionary_, areas);
  }

  // Called when the objects of these areas have their saved values, to set values that follow from them.
  void loaded(dictionary::Area) {}

  // `node_id` is for defaults that depend on it.
  void load_objects(dictionary::Area areas, std::uint8_t node_id = 0) {
    using Loaded = dictionary::Store::Loaded;
    load_factory_values(areas, node_id);
    Loaded loaded = Loaded::nothing;
    if (settings_.store != nullptr) {
      loaded = dictionary::Store(*settings_.store).load(dictionary_, areas);
      if (loaded != Loaded::values) load_factory_values(areas, node_id);  // the memory may have failed halfway
    }
    values_lost_ = loaded == Loaded::damaged;
    product().loaded(areas);
  }

  // Raises a fault if factory values replaced lost ones. Call this once the drive runs, because the drive accepts no
  // faults before.
  void tell_lost_values() {
    if (values_lost_) drive_.raise(drive::Cause::memory);
  }

  // --- dictionary::Listener for Owner::product
  dictionary::AbortCode check(const dictionary::Entry&, std::span<const std::byte>) override {
    return dictionary::AbortCode::none;
  }

 private:
  void load_factory_values(dictionary::Area areas, std::uint8_t node_id) {
    dictionary_.load_defaults(areas, node_id);
    product().prepare(areas);
  }

  Settings settings_;
  bool values_lost_ = false;
  ObjectMemory<ProductObjects> memory_;
  dictionary::Dictionary dictionary_;
  dictionary::Dictionary bus_dictionary_;  // over the same objects
  drive::Drive drive_;
};

}  // namespace servodrome::products
