#include "described/binding.hpp"

#include <algorithm>
#include <cmath>

#include "products/generic402/policy.hpp"

namespace servodrome::described {

using dictionary::AbortCode;
using dictionary::Entry;

namespace {

std::int64_t clamped(dictionary::Type type, std::int64_t value) {
  return std::clamp(value, dictionary::minimum_of(type), dictionary::maximum_of(type));
}

}  // namespace

void Binding::put(const Entry& entry, std::int64_t value) {
  const auto bytes = dictionary::encode_number(clamped(entry.type, value));
  std::memcpy(dictionary_.storage(entry), bytes.data(), dictionary::size_of(entry.type));
}

void Binding::prepare(drive::Objects& objects, const products::Settings& settings, dictionary::Area areas) {
  for (const Entry& entry : blueprint_.implied) {
    if (contains(areas, dictionary::area_of(entry.index))) put(entry, entry.default_value);
  }
  for (const auto& [key, content] : blueprint_.contents) {
    const Entry* entry = blueprint_.find(static_cast<std::uint16_t>(key >> 8), static_cast<std::uint8_t>(key));
    if (entry == nullptr || !contains(areas, dictionary::area_of(entry->index))) continue;
    const auto length = static_cast<std::uint32_t>(std::min<std::size_t>(content.size(), entry->capacity));
    std::byte* place = dictionary_.storage(*entry);
    std::memcpy(place, &length, sizeof length);
    std::copy_n(reinterpret_cast<const std::byte*>(content.data()), length, place + sizeof length);
  }
  if (contains(areas, dictionary::Area::communication)) {
    const Entry* serial_number = blueprint_.find(0x1018, 4);
    if (serial_number != nullptr && serial_number->default_value == 0) put(*serial_number, settings.serial_number);
  }
  if (!contains(areas, dictionary::Area::profile)) return;
  // Values that the description does not define come from the connected motor.
  const drive::MotorData& motor = settings.motor;
  const auto described = [this](std::uint16_t index, std::uint8_t sub) {
    return blueprint_.find(index, sub) != nullptr;
  };
  if (!described(0x608F, 1)) objects.position_encoder_increments = motor.counts_per_revolution;
  if (objects.motor_rated_current_ma == 0) {
    objects.motor_rated_current_ma =
        static_cast<std::uint32_t>(std::lround(static_cast<double>(motor.rated_current_a) / std::sqrt(2.0) * 1000.0));
  }
  if (objects.motor_rated_torque_mnm == 0) {
    objects.motor_rated_torque_mnm =
        static_cast<std::uint32_t>(std::lround(static_cast<double>(motor.rated_torque_nm) * 1000.0));
  }
}

const Adapted* Binding::find_adapted(const Entry& entry) const {
  const auto found =
      std::lower_bound(blueprint_.adapted.begin(), blueprint_.adapted.end(), entry.key(),
                       [](const Adapted& adapted, std::uint32_t wanted) { return adapted.key < wanted; });
  return found != blueprint_.adapted.end() && found->key == entry.key() ? &*found : nullptr;
}

void Binding::to_drive(const Entry& entry, const Entry& reference) {
  const std::byte* place = dictionary_.storage(entry);
  put(reference, dictionary::decode_number(entry.type, {place, dictionary::size_of(entry.type)}));
}

void Binding::loaded(dictionary::Area areas) {
  for (const Adapted& adapted : blueprint_.adapted) {
    const auto index = static_cast<std::uint16_t>(adapted.key >> 8);
    const Entry* entry = blueprint_.find(index, static_cast<std::uint8_t>(adapted.key));
    if (entry != nullptr && contains(areas, dictionary::area_of(index))) to_drive(*entry, adapted.reference);
  }
}

AbortCode Binding::check(const Entry& entry, std::span<const std::byte> value) {
  const Adapted* adapted = find_adapted(entry);
  if (adapted == nullptr) return AbortCode::none;
  const Entry& reference = adapted->reference;
  const std::int64_t number = dictionary::decode_number(entry.type, value);
  if (number > reference.maximum) return AbortCode::value_too_high;
  if (number < reference.minimum) return AbortCode::value_too_low;
  if (reference.owner != dictionary::Owner::drive) return AbortCode::none;
  const auto bytes = dictionary::encode_number(number);
  return drive_.check(reference, std::span(bytes).first(dictionary::size_of(reference.type)));
}

void Binding::written(const Entry& entry) {
  const Adapted* adapted = find_adapted(entry);
  if (adapted == nullptr) return;
  to_drive(entry, adapted->reference);
  if (adapted->reference.owner == dictionary::Owner::drive) drive_.written(adapted->reference);
}

void Binding::refresh(const Entry& entry) {
  const Adapted* adapted = find_adapted(entry);
  if (adapted == nullptr) return;
  const Entry& reference = adapted->reference;
  if (reference.owner == dictionary::Owner::drive) drive_.refresh(reference);
  put(entry,
      dictionary::decode_number(reference.type, {dictionary_.storage(reference), dictionary::size_of(reference.type)}));
}

std::span<const std::byte> Binding::domain(const Entry& entry) const {
  if (entry.index == 0x1021) return std::as_bytes(std::span(blueprint_.text));
  return {};
}

bool units(const drive::Objects& objects, const drive::MotorData& motor, drive::Units& units) {
  constexpr std::uint32_t coarsest_encoder = 16;  // fewer increments per revolution mean that the value was never set
  drive::Objects known = objects;
  const auto one_if_zero = [](std::uint32_t& value) { value = std::max(value, 1U); };
  for (std::uint32_t* value : {&known.position_encoder_motor_revolutions, &known.gear_motor_revolutions,
                               &known.gear_shaft_revolutions, &known.feed_shaft_revolutions}) {
    one_if_zero(*value);
  }
  if (known.position_encoder_increments / known.position_encoder_motor_revolutions < coarsest_encoder) {
    known.position_encoder_increments = motor.counts_per_revolution;
    known.position_encoder_motor_revolutions = 1;
  }
  if (known.feed <= known.feed_shaft_revolutions) {
    known.feed = known.position_encoder_increments;
    known.feed_shaft_revolutions = known.position_encoder_motor_revolutions;
  }
  known.position_encoder_increments = motor.counts_per_revolution;
  known.position_encoder_motor_revolutions = 1;
  return products::generic402::units(known, motor, units);
}

}  // namespace servodrome::described
