#include "api/change_log.hpp"

#include <algorithm>

namespace servodrome::api {

KeptValue::KeptValue(std::span<const std::byte> value) {
  if (value.size() > most_bytes) return;
  std::copy(value.begin(), value.end(), bytes_.begin());
  length_ = static_cast<std::uint8_t>(value.size());
}

bool operator==(const KeptValue& a, const KeptValue& b) {
  return std::equal(a.bytes().begin(), a.bytes().end(), b.bytes().begin(), b.bytes().end());
}

std::string Change::name() const {
  const std::string own = entry->name;
  return own == object_name || object_name[0] == 0 ? own : std::string(object_name) + "." + own;
}

ChangeLog::ChangeLog(std::vector<std::string> axes, std::size_t capacity)
    : axes_(std::move(axes)), capacity_(capacity) {
  ring_.reserve(capacity_);
}

bool ChangeLog::is_motion(std::uint16_t index) {
  constexpr std::array<std::uint16_t, 9> words{0x6040, 0x6042, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60C1, 0x60FF};
  return std::find(words.begin(), words.end(), index) != words.end();
}

void ChangeLog::add(Change change, std::string_view who) {
  if (is_motion(change.entry->index) || (change.before.known() && change.before == change.after)) return;
  change.number = ++last_;
  const std::size_t length = std::min(who.size(), change.who.size() - 1);
  std::copy_n(who.begin(), length, change.who.begin());
  change.who[length] = 0;
  if (ring_.size() < capacity_) {
    ring_.push_back(change);
  } else {
    ring_[place_of(change.number)] = change;
  }
}

}  // namespace servodrome::api
