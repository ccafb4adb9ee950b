#include "ethercat/slave/process_image.hpp"

#include <algorithm>
#include <cstring>

namespace servodrome::ethercat {

using dictionary::AbortCode;
using dictionary::Entry;

namespace {

constexpr std::uint16_t first_dummy = 0x0001;  // data types as dummy objects (CiA 301 7.4.7.2)
constexpr std::uint16_t last_dummy = 0x001F;

std::uint64_t bits_at(std::span<const std::uint8_t> image, unsigned bit, unsigned bits) {
  std::uint64_t value = 0;
  for (unsigned i = 0; i < bits; ++i) {
    value |= std::uint64_t{image[(bit + i) / 8] >> (bit + i) % 8 & 1U} << i;
  }
  return value;
}

void put_bits(std::span<std::uint8_t> image, unsigned bit, unsigned bits, std::uint64_t value) {
  for (unsigned i = 0; i < bits; ++i) {
    std::uint8_t& byte = image[(bit + i) / 8];
    byte = static_cast<std::uint8_t>(byte | (value >> i & 1) << (bit + i) % 8);
  }
}

// For a number with the length of a dictionary::Type.
void copy_number(void* to, const void* from, unsigned bytes) {
  switch (bytes) {
    case 1: std::memcpy(to, from, 1); break;
    case 2: std::memcpy(to, from, 2); break;
    case 4: std::memcpy(to, from, 4); break;
    default: std::memcpy(to, from, 8); break;
  }
}

// Extends the sign of a signed number of `bits` bits to 64 bits.
std::uint64_t sign_extended(std::uint64_t value, unsigned bits) {
  if (bits >= 64 || (value >> (bits - 1) & 1) == 0) return value;
  return value | ~std::uint64_t{0} << bits;
}

bool holds(dictionary::Type type, std::uint64_t value) {
  const auto number = static_cast<std::int64_t>(value);
  return dictionary::size_of(type) == 8 ||
         (number >= dictionary::minimum_of(type) && number <= dictionary::maximum_of(type));
}

}  // namespace

AbortCode ProcessImage::resolve_entry(std::uint32_t mapping, MappedObject& object) const {
  const auto index = static_cast<std::uint16_t>(mapping >> 16);
  const auto bits = static_cast<std::uint8_t>(mapping);
  object = {};
  object.bits = bits;
  if (bits == 0) return AbortCode::not_mappable;
  if (index == 0 || (direction_ == Direction::outputs && index >= first_dummy && index <= last_dummy)) {
    return AbortCode::none;  // a gap
  }
  AbortCode abort{};
  const Entry* entry = dictionary_.find(index, static_cast<std::uint8_t>(mapping >> 8), abort);
  if (entry == nullptr) return abort;
  const auto wanted = direction_ == Direction::outputs ? dictionary::Pdo::rpdo : dictionary::Pdo::tpdo;
  const bool mappable = (static_cast<unsigned>(entry->pdo) & static_cast<unsigned>(wanted)) != 0;
  if (!mappable || !entry->fixed_size() || bits > 64) return AbortCode::not_mappable;
  const unsigned own = dictionary::size_of(entry->type) * 8U;
  const bool fits = bits == own || (entry->type == dictionary::Type::boolean && bits == 1);
  if (!fits && !profile_.mapped_length_may_differ) return AbortCode::not_mappable;
  object.entry = entry;
  object.place = dictionary_.storage(*entry);
  object.bytes = dictionary::size_of(entry->type);
  object.owner = dictionary_.listener(*entry);
  const auto handlers = object.owner != nullptr ? object.owner->handlers(*entry) : dictionary::Handlers{};
  object.act = direction_ == Direction::outputs ? handlers.written : handlers.refresh;
  object.plain = handlers.check == nullptr && !entry->has_range;
  object.whole = bits == own && object.place != nullptr;
  object.tell = object.act != nullptr;
  return AbortCode::none;
}

AbortCode ProcessImage::check_entry(std::uint32_t mapping) const {
  MappedObject object;
  return mapping == 0 || mapping == profile_.empty_mapping ? AbortCode::none : resolve_entry(mapping, object);
}

AbortCode ProcessImage::check_pdo(std::uint16_t index) const {
  if (index == 0) return AbortCode::none;  // an empty entry
  const std::uint16_t first = direction_ == Direction::outputs ? 0x1600 : 0x1A00;
  const bool is_mapping = index >= first && index < first + 0x200;
  return is_mapping && dictionary_.find(index, 0) != nullptr ? AbortCode::none : AbortCode::value_invalid;
}

AbortCode ProcessImage::check_assignment(unsigned count) const {
  for (unsigned sub = 1; sub <= count; ++sub) {
    const std::uint16_t pdo = assigned_pdo(sub);
    if (pdo == 0 || check_pdo(pdo) != AbortCode::none) return AbortCode::value_invalid;
    for (unsigned other = 1; other < sub; ++other) {
      if (assigned_pdo(other) == pdo) return AbortCode::parameter_incompatible;
    }
  }
  return AbortCode::none;
}

AbortCode ProcessImage::check_count(std::uint16_t index, unsigned count) const {
  unsigned bits = 0;
  for (unsigned sub = 1; sub <= count; ++sub) {
    const auto mapping = static_cast<std::uint32_t>(dictionary_.number(index, static_cast<std::uint8_t>(sub)));
    MappedObject object;
    if (const AbortCode abort = resolve_entry(mapping, object); abort != AbortCode::none) return abort;
    bits += object.bits;
  }
  const unsigned greatest = std::min(greatest_bits(), 8U * profile_.greatest_pdo);
  return bits > greatest ? AbortCode::mapping_exceeds_pdo_length : AbortCode::none;
}

AbortCode ProcessImage::add_pdo(std::uint16_t index) {
  const auto entries = static_cast<unsigned>(dictionary_.number(index, 0));
  for (unsigned sub = 1; sub <= entries; ++sub) {
    const auto mapping = static_cast<std::uint32_t>(dictionary_.number(index, static_cast<std::uint8_t>(sub)));
    if (count_ == objects_.size()) return AbortCode::out_of_memory;
    MappedObject& object = objects_[count_];
    if (const AbortCode abort = resolve_entry(mapping, object); abort != AbortCode::none) return abort;
    object.byte = static_cast<std::uint16_t>(bits_ / 8);
    object.bit = static_cast<std::uint8_t>(bits_ % 8);
    object.whole = object.whole && object.bit == 0;
    bits_ += object.bits;
    if (bits_ > greatest_bits()) return AbortCode::mapping_exceeds_pdo_length;
    if (object.entry != nullptr) ++count_;
  }
  return AbortCode::none;
}

AbortCode ProcessImage::resolve() {
  count_ = 0;
  bits_ = 0;
  const auto pdos = static_cast<unsigned>(dictionary_.number(assignment(), 0));
  AbortCode abort = check_assignment(pdos);
  for (unsigned sub = 1; sub <= pdos && abort == AbortCode::none; ++sub) abort = add_pdo(assigned_pdo(sub));
  if (abort != AbortCode::none) {
    count_ = 0;
    bits_ = 0;
  }
  return abort;
}

void ProcessImage::write_objects(std::span<const std::uint8_t> image) {
  if (image.size() < bytes()) return;
  const bool viewed = dictionary_.view() != nullptr;
  for (MappedObject& object : objects_.first(count_)) {
    if (object.plain && object.whole && !viewed) {
      copy_number(object.place, image.data() + object.byte, object.bytes);
    } else {
      object.tell = store_checked(object, image.subspan(object.byte)) && object.act != nullptr;
    }
  }
  for (const MappedObject& object : objects_.first(count_)) {
    if (object.tell) object.act(*object.owner, *object.entry);
  }
}

// Returns false if the value is refused.
bool ProcessImage::store_checked(const MappedObject& object, std::span<const std::uint8_t> image) {
  const Entry& entry = *object.entry;
  const std::uint8_t* from = image.data();
  std::uint64_t apart = 0;
  if (!object.whole) {
    apart = bits_at(image, object.bit, object.bits);
    if (dictionary::is_signed(entry.type)) apart = sign_extended(apart, object.bits);
    if (!holds(entry.type, apart)) return false;
    from = reinterpret_cast<const std::uint8_t*>(&apart);
  }
  if (dictionary::View* view = dictionary_.view()) {
    std::memcpy(&apart, from, object.bytes);
    if (!view->take(entry, std::as_writable_bytes(std::span(&apart, 1)).first(object.bytes))) return false;
    from = reinterpret_cast<const std::uint8_t*>(&apart);
  }
  const auto value = std::as_bytes(std::span(from, object.bytes));
  if (entry.has_range && dictionary_.check_range(entry, value) != AbortCode::none) return false;
  if (object.owner != nullptr && object.owner->check(entry, value) != AbortCode::none) return false;
  if (object.place != nullptr) copy_number(object.place, from, object.bytes);
  return true;
}

void ProcessImage::read_objects(std::span<std::uint8_t> image) {
  if (image.size() < bytes()) return;
  std::fill(image.begin(), image.end(), std::uint8_t{0});
  dictionary::View* view = dictionary_.view();
  for (const MappedObject& object : objects_.first(count_)) {
    if (object.act != nullptr) object.act(*object.owner, *object.entry);
    if (object.whole && view == nullptr) {
      copy_number(image.data() + object.byte, object.place, object.bytes);
      continue;
    }
    std::uint64_t value = 0;
    if (object.place != nullptr) {
      copy_number(&value, object.place, object.bytes);
    } else {
      value = static_cast<std::uint64_t>(object.entry->default_value);
    }
    if (view != nullptr) view->show(*object.entry, std::as_writable_bytes(std::span(&value, 1)).first(object.bytes));
    if (dictionary::is_signed(object.entry->type)) value = sign_extended(value, object.bytes * 8U);
    put_bits(image.subspan(object.byte), object.bit, object.bits, value);
  }
}

}  // namespace servodrome::ethercat
