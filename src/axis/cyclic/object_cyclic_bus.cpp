#include "axis/cyclic/object_cyclic_bus.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace servodrome::master {

ObjectCyclicBus::ObjectCyclicBus(ObjectClient& objects, std::vector<PdoObject> outputs, std::vector<PdoObject> inputs,
                                 Time period)
    : objects_(objects), image_(outputs_, inputs_, objects.where()), period_(period), next_(objects.now() + period) {
  for (const PdoObject& object : outputs) outputs_.push_back({object});
  for (const PdoObject& object : inputs) inputs_.push_back({object});
  std::vector<ObjectAddress> addresses;
  for (const PdoObject& object : inputs) addresses.push_back(object.object);
  together_ = objects_.read_together(addresses);
  // The first outputs are the present values of the objects.
  for (Value& value : outputs_) {
    const std::vector<std::byte> bytes = objects_.upload(value.object.object);
    std::transform(bytes.begin(),
                   bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bytes.size(), value.bytes.size())),
                   value.bytes.begin(), [](std::byte byte) { return std::to_integer<std::uint8_t>(byte); });
  }
}

std::optional<ProcessObject> ObjectCyclicBus::Image::find(std::vector<Value>& values, ObjectAddress object) {
  const auto found = std::find_if(values.begin(), values.end(), [object](const Value& value) {
    return value.object.object.index == object.index && value.object.object.sub == object.sub;
  });
  if (found == values.end()) return std::nullopt;
  return ProcessObject(found->bytes.data(), {0, found->object.bits});
}

void ObjectCyclicBus::wait(Time span) {
  const Time end = objects_.now() + span;
  while (next_ <= end) {
    if (next_ > objects_.now()) objects_.wait(next_ - objects_.now());
    const Time late = std::max<Time>(objects_.now() - next_, Time{});
    counters_.worst_lateness = std::max(counters_.worst_lateness, late);
    const auto skipped = static_cast<std::uint64_t>(late / period_);
    counters_.skipped += skipped;
    next_ += period_ * (skipped + 1);
    cycle();
  }
  if (end > objects_.now()) objects_.wait(end - objects_.now());
}

void ObjectCyclicBus::read(const std::vector<std::size_t>& places) {
  std::vector<ObjectAddress> objects;
  for (const std::size_t place : places) objects.push_back(inputs_[place].object.object);
  const std::vector<std::vector<std::byte>> values = objects_.upload_together(objects);
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::array<std::uint8_t, 8>& bytes = inputs_[places[i]].bytes;
    for (std::size_t at = 0; at < bytes.size(); ++at) {
      bytes[at] = at < values[i].size() ? std::to_integer<std::uint8_t>(values[i][at]) : std::uint8_t{0};
    }
  }
}

void ObjectCyclicBus::cycle() {
  ++counters_.cycles;
  inputs_taken_ = objects_.now();
  fresh_ = false;
  try {
    for (const std::vector<std::size_t>& places : together_) read(places);
    fresh_ = true;
    if (action_) action_();
    for (const Value& value : outputs_) {
      objects_.download(value.object.object, std::as_bytes(std::span(value.bytes)).first(value.object.bits / 8U));
    }
    lost_in_a_row_ = 0;  // the drive has answered all reads and writes
  } catch (const ObjectError& error) {
    if (error.answered()) {
      refused_ = std::current_exception();
      return;
    }
    ++counters_.missed;
    counters_.longest_miss = std::max(counters_.longest_miss, ++lost_in_a_row_);
    if (!fresh_ && action_) action_();
  }
}

void ObjectCyclicBus::check() const {
  if (refused_) std::rethrow_exception(refused_);
  if (lost_in_a_row_ <= tolerated_losses) return;
  throw MasterError(fmt::format("the drive has not answered for {} cycles", lost_in_a_row_), image_.where(),
                    "check its power");
}

}  // namespace servodrome::master
