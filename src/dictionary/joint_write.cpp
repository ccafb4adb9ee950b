#include "dictionary/joint_write.hpp"

#include <algorithm>
#include <utility>

namespace servodrome::dictionary {

JointWrite::~JointWrite() {
  while (count_ > 0) exchange(items_[--count_]);
}

AbortCode JointWrite::add(const Entry& entry, std::span<std::byte> value) {
  if (count_ == capacity) return AbortCode::out_of_memory;
  if (is_stored(entry)) {
    if (const AbortCode abort = dictionary_.check(entry, value); abort != AbortCode::none) return abort;
    if (View* view = dictionary_.view()) {
      if (!view->take(entry, value)) return AbortCode::none;
      if (const AbortCode abort = dictionary_.check(entry, value); abort != AbortCode::none) return abort;
    }
  } else if (const AbortCode abort = dictionary_.check_by_table(entry, value); abort != AbortCode::none) {
    return abort;
  }
  items_[count_] = {&entry, value};
  exchange(items_[count_++]);
  return AbortCode::none;
}

AbortCode JointWrite::commit() {
  AbortCode first = AbortCode::none;
  for (const Item& item : std::span(items_).first(std::exchange(count_, 0))) {
    if (is_stored(*item.entry)) {
      tell(item);
    } else if (const AbortCode abort = dictionary_.write(*item.entry, item.value); first == AbortCode::none) {
      first = abort;
    }
  }
  return first;
}

void JointWrite::exchange(const Item& item) {
  if (!is_stored(*item.entry)) return;
  std::swap_ranges(item.value.begin(), item.value.end(), dictionary_.storage(*item.entry));
}

void JointWrite::tell(const Item& item) {
  const Entry& entry = *item.entry;
  std::array<std::byte, 8> number{};
  std::copy_n(dictionary_.storage(entry), item.value.size(), number.begin());  // the owner may change it
  Recorder* recorder = dictionary_.recorder();
  if (recorder != nullptr) recorder->before(entry, entry.readable() ? item.value : std::span<std::byte>{});
  if (Listener* owner = dictionary_.listener(entry)) owner->written(entry);
  if (recorder != nullptr) recorder->written(entry, std::span(number).first(item.value.size()));
}

}  // namespace servodrome::dictionary
