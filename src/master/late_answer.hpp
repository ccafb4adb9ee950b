#pragma once

#include <array>
#include <chrono>

#include "links/time.hpp"
#include "master/object_address.hpp"

namespace servodrome::master {

// A late answer to an earlier request for an object looks like the answer to the next one. A drive answers in order, so
// no earlier answer comes after its answer for another object: a client reads such an object first. Two objects take
// turns, since the answer for one of them may be late, too.
class LateAnswer {
 public:
  // A request got no answer in time.
  void expect(links::Time now) { until_ = now + longest; }
  bool is_expected(links::Time now) const { return now < until_; }
  // An answer has come for an object that was read for this purpose, or for the last request.
  void rule_out() { until_ = {}; }
  // The object to read: the device type or the vendor-ID.
  ObjectAddress next_object() {
    turn_ = 1 - turn_;
    return objects[turn_];
  }
  // The values of these objects are constant, so a late answer for them does no harm.
  static bool is_constant(ObjectAddress object) { return object == objects[0] || object == objects[1]; }

 private:
  static constexpr links::Time longest = std::chrono::seconds(10);
  static constexpr std::array objects{ObjectAddress{0x1018, 1}, ObjectAddress{0x1000, 0}};
  links::Time until_{};
  std::size_t turn_ = 0;
};

}  // namespace servodrome::master
