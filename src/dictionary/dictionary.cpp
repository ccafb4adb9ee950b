#include "dictionary/dictionary.hpp"

#include <algorithm>

namespace servodrome::dictionary {

std::int64_t decode_number(Type type, std::span<const std::byte> bytes) {
  std::uint64_t raw = 0;
  const auto load = [&](auto whole) {
    std::memcpy(&whole, bytes.data(), sizeof whole);
    raw = whole;
  };
  // Each size has one load of the whole value: only to such a load the processor forwards bytes that were just written
  // (store forwarding).
  switch (bytes.size()) {
    case 1: load(std::uint8_t{}); break;
    case 2: load(std::uint16_t{}); break;
    case 4: load(std::uint32_t{}); break;
    default: std::memcpy(&raw, bytes.data(), std::min<std::size_t>(bytes.size(), sizeof raw));
  }
  const unsigned size = size_of(type);
  if (is_signed(type) && size < 8 && size > 0) {
    const unsigned shift = 64 - size * 8;
    return static_cast<std::int64_t>(raw << shift) >> shift;
  }
  return static_cast<std::int64_t>(raw);
}

const Entry* Dictionary::find(std::uint16_t index, std::uint8_t sub, AbortCode& abort) const {
  const std::uint32_t key = static_cast<std::uint32_t>(index) << 8 | sub;
  const Entry* first = table_.data();
  std::size_t length = table_.size();
  while (length > 1) {
    const std::size_t half = length / 2;
    first = first[half].key() <= key ? first + half : first;
    length -= half;
  }
  if (length == 1 && first->key() == key) {
    abort = AbortCode::none;
    return first;
  }
  // Every object begins with a sub-index 0 (is_valid_table). So if the object exists, the last entry not above the key
  // belongs to it.
  const bool exists = length == 1 && first->index == index;
  abort = exists ? AbortCode::sub_index_does_not_exist : AbortCode::object_does_not_exist;
  return nullptr;
}

AbortCode Dictionary::read(const Entry& entry, ReadValue& value) const {
  const AbortCode abort = read_object(entry, value);
  if (view_ != nullptr && abort == AbortCode::none && entry.fixed_size()) {
    view_->show(entry, std::span(value.number).first(size_of(entry.type)));
  }
  return abort;
}

AbortCode Dictionary::read_object(const Entry& entry, ReadValue& value) const {
  if (!entry.readable()) return AbortCode::write_only;
  if (Listener* owner = listener(entry)) owner->refresh(entry);
  if (entry.fixed_size()) {
    if (entry.offset == Field::no_storage) {
      value.number = encode_number(entry.default_value);
    } else {
      std::memcpy(value.number.data(), objects_.data() + entry.offset, size_of(entry.type));
    }
    value.bytes = std::span(value.number).first(size_of(entry.type));
  } else if (entry.text != nullptr) {
    value.bytes = std::as_bytes(std::span(entry.text, std::strlen(entry.text)));
  } else if (entry.offset != Field::no_storage) {
    std::uint32_t length = 0;
    std::memcpy(&length, objects_.data() + entry.offset, sizeof length);
    value.bytes = objects_.subspan(entry.offset + sizeof length, std::min(length, entry.capacity));
  } else if (Listener* owner = listener(entry)) {
    value.bytes = owner->domain(entry);
  }
  return AbortCode::none;
}

AbortCode Dictionary::check_range(const Entry& entry, std::span<const std::byte> value) const {
  if (!entry.has_range) return AbortCode::none;
  const std::int64_t number = decode_number(entry.type, value);
  if (number > entry.maximum) return AbortCode::value_too_high;
  if (number < entry.minimum) return AbortCode::value_too_low;
  return AbortCode::none;
}

AbortCode Dictionary::write(const Entry& entry, std::span<const std::byte> value) {
  if (!entry.writable()) return AbortCode::read_only;
  if (view_ == nullptr || !entry.fixed_size()) return write_recorded(entry, value);
  if (const AbortCode abort = check_value(entry, value); abort != AbortCode::none) return abort;
  std::array<std::byte, 8> number{};
  std::copy(value.begin(), value.end(), number.begin());
  const std::span changed = std::span(number).first(value.size());
  return view_->take(entry, changed) ? write_recorded(entry, changed) : AbortCode::none;
}

AbortCode Dictionary::write_recorded(const Entry& entry, std::span<const std::byte> value) {
  if (recorder_ == nullptr) return write_any(entry, value);
  ReadValue present;
  const bool is_stored = entry.fixed_size() || entry.offset != Field::no_storage;
  const bool is_known = is_stored && read_object(entry, present) == AbortCode::none;
  recorder_->before(entry, is_known ? present.bytes : std::span<const std::byte>{});
  const AbortCode abort = write_any(entry, value);
  if (abort == AbortCode::none) recorder_->written(entry, value);
  return abort;
}

AbortCode Dictionary::check(const Entry& entry, std::span<const std::byte> value) const {
  return entry.writable() ? check_value(entry, value) : AbortCode::read_only;
}

AbortCode Dictionary::check_by_table(const Entry& entry, std::span<const std::byte> value) const {
  return entry.writable() ? check_length_and_range(entry, value) : AbortCode::read_only;
}

AbortCode Dictionary::check_length_and_range(const Entry& entry, std::span<const std::byte> value) const {
  const std::size_t size = size_of(entry.type);
  if (value.size() > (size != 0 ? size : entry.capacity)) return length_aborts_.too_long;
  if (value.size() < size) return length_aborts_.too_short;
  return size != 0 ? check_range(entry, value) : AbortCode::none;
}

AbortCode Dictionary::check_value(const Entry& entry, std::span<const std::byte> value) const {
  if (const AbortCode abort = check_length_and_range(entry, value); abort != AbortCode::none) return abort;
  Listener* owner = listener(entry);
  return owner != nullptr ? owner->check(entry, value) : AbortCode::none;
}

AbortCode Dictionary::write_any(const Entry& entry, std::span<const std::byte> value) {
  if (const AbortCode abort = check_value(entry, value); abort != AbortCode::none) return abort;
  const std::size_t size = size_of(entry.type);
  Listener* owner = listener(entry);
  if (entry.offset != Field::no_storage) {
    std::byte* place = objects_.data() + entry.offset;
    if (size == 0) {
      const auto length = static_cast<std::uint32_t>(value.size());
      std::memcpy(place, &length, sizeof length);
      place += sizeof length;
    }
    if (!value.empty()) std::memcpy(place, value.data(), value.size());
  }
  if (owner != nullptr) owner->written(entry);
  return AbortCode::none;
}

std::int64_t Dictionary::number(const Entry& entry) const {
  ReadValue value;
  if (read_object(entry, value) != AbortCode::none) return 0;
  return decode_number(entry.type, value.bytes);
}

std::int64_t Dictionary::number(std::uint16_t index, std::uint8_t sub) const {
  const Entry* entry = find(index, sub);
  return entry == nullptr ? 0 : number(*entry);
}

AbortCode Dictionary::set_number(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  AbortCode abort{};
  const Entry* entry = find(index, sub, abort);
  if (entry == nullptr) return abort;
  if (!entry->writable()) return AbortCode::read_only;
  const auto bytes = encode_number(value);
  return write_any(*entry, std::span(bytes).first(size_of(entry->type)));
}

void Dictionary::load_defaults(Area areas, std::uint8_t node_id) {
  for (const Entry& entry : table_) {
    if (entry.offset == Field::no_storage || !contains(areas, area_of(entry.index))) continue;
    if (entry.fixed_size()) {
      const auto bytes = encode_number(default_number(entry, node_id));
      std::memcpy(objects_.data() + entry.offset, bytes.data(), size_of(entry.type));
    } else {
      const std::uint32_t empty = 0;
      std::memcpy(objects_.data() + entry.offset, &empty, sizeof empty);
    }
  }
}

}  // namespace servodrome::dictionary
