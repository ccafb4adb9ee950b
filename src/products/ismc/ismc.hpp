#pragma once

#include "products/can_device.hpp"
#include "products/ismc/objects.hpp"

namespace servodrome::products {

// ISMC servo drive, CANopen variant (manual V1.6).
class Ismc final : public CanDevice<Ismc, ismc::Objects> {
 public:
  static constexpr std::span<const dictionary::Entry> table{ismc::object_table};
  static constexpr drive::Policy policy = ismc::make_policy();
  // One code for every length error (Table 2-16, G5).
  static constexpr dictionary::LengthAborts length_aborts{dictionary::AbortCode::length_mismatch,
                                                          dictionary::AbortCode::length_mismatch};
  static constexpr canopen::Profile profile{
      .rpdo_types = {.synchronous_remote = false, .asynchronous_remote = false},
      .tpdo_types = {.synchronous_remote = false,
                     .asynchronous_remote = false},  // 241..253 are not available (ch. 2.6.2)
      .remote_frames = false,
      .sdo_block = false,  // Table 1-2
      .time_consumer = false,
      .lss = false};
  static constexpr std::uint8_t factory_node_id = 1;            // ch. 6, 'Master slave CANopen configuration'
  static constexpr std::uint32_t factory_bit_rate = 1'000'000;  // ch. 6, 'Master slave CANopen configuration'

  explicit Ismc(const Settings& settings) : CanDevice(settings) {}

  // It flashes on a fault (ch. 5); how often is not printed.
  Lamps lamps(Time) override {
    Lamps lamps;
    lamps.add({"fault", "red", drive().any_fault() ? Light::blinking : Light::off});
    return lamps;
  }

 private:
  friend CanDevice;
  friend ServoDevice;

  void prepare(dictionary::Area areas);
  drive::Configuration configuration() const;
  std::uint8_t chosen_node_id() const { return objects().manufacturer.node_id; }
  std::uint32_t chosen_bit_rate() const { return objects().manufacturer.bit_rate; }

  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override;
  void written(const dictionary::Entry& entry) override;
};

}  // namespace servodrome::products
