// Storing, initialising and restarting the iSMK by 2FF0h and 2FFFh (ch. 7.10 and 7.14; Table 10-5, 800.0). There is no
// 1010h.
#include "dictionary/store.hpp"
#include "products/ismk/servo.hpp"

namespace servodrome::products::ismk {

namespace {

using dictionary::AbortCode;
using dictionary::Area;

// "All control parameters, motor parameters excluded" (ch. 7.10, 2FF0.01).
constexpr Area control_parameters = Area::communication | Area::manufacturer | Area::profile;
constexpr std::int64_t store_command = 1;
constexpr std::int64_t restart_command = 0xAA55;
constexpr std::int64_t boot_loader_command = 0x55AA;

}  // namespace

AbortCode Servo::save(Area areas) {
  if (settings_.store == nullptr) return AbortCode::hardware_error;
  return dictionary::Store(*settings_.store).save(dictionary_, areas);
}

AbortCode Servo::store_parameters(std::int64_t command) {
  if (command == 0) return AbortCode::none;
  if (command == store_command) return save(control_parameters);
  if (command != initialise_command) return AbortCode::value_invalid;
  return drive_.energised() ? AbortCode::device_state : AbortCode::none;
}

AbortCode Servo::store_motor_data(std::int64_t command) {
  return command == store_command ? save(Area::motor) : AbortCode::none;
}

// Factory values apply at once. They persist only if they are stored afterwards (Table 10-5, 800.0; Table 10-6, 000.2).
// Objects that are never stored (targets, commands) keep their values.
void Servo::initialise_parameters(std::uint8_t node_id) {
  for (const dictionary::Entry& entry : dictionary_.table()) {
    if (!entry.saved || !entry.fixed_size() || dictionary::area_of(entry.index) == Area::motor) continue;
    std::byte* place = dictionary_.storage(entry);
    if (place == nullptr) continue;
    const auto bytes = dictionary::encode_number(dictionary::Dictionary::default_number(entry, node_id));
    std::memcpy(place, bytes.data(), dictionary::size_of(entry.type));
  }
  loaded();
  after_reset();
  reconfigure();
}

AbortCode Servo::request_restart(std::int64_t command) {
  if (command == boot_loader_command) return AbortCode::device_state;  // there is no boot loader to start
  if (command != restart_command) return AbortCode::value_invalid;
  restart_requested_ = true;
  return AbortCode::none;
}

}  // namespace servodrome::products::ismk
