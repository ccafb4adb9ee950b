#pragma once

#include <cstddef>
#include <map>
#include <span>

#include "api/change_log.hpp"
#include "catalogue/parameter_rules.hpp"
#include "master/object_address.hpp"

namespace servodrome::studio {

// The values of a drive's parameters as they last passed on the bus, in a limited amount of memory. A value is not
// known
// - after a request to write it that the drive has not answered,
// - after a write to a command of CiA 301 or of the maker: 1011h and others restore values,
// - after a restart of the drive, which the caller reports by forget().
// A change that does not pass on the bus as SDO (process data, keypad, the drive itself) is not noticed.
class HeardValues {
 public:
  static constexpr std::size_t most_objects = 4096;  // further objects are not known

  // `rules` must outlive this object.
  explicit HeardValues(const catalogue::ParameterRules& rules) : rules_(rules) {}

  void note_read(master::ObjectAddress object, std::span<const std::byte> value) { set(object, value); }
  // A request to write the object, before the drive's answer.
  void note_request(master::ObjectAddress object);
  void note_refusal(master::ObjectAddress object);
  // The drive has confirmed the write. Returns the value before.
  api::KeptValue note_write(master::ObjectAddress object, std::span<const std::byte> value);
  void forget() { values_.clear(); }

 private:
  struct Value {
    api::KeptValue value{};
    bool is_in_doubt = false;  // a request to write it has no answer yet
  };
  void set(master::ObjectAddress object, std::span<const std::byte> value);

  const catalogue::ParameterRules& rules_;
  std::map<master::ObjectAddress, Value> values_;
};

}  // namespace servodrome::studio
