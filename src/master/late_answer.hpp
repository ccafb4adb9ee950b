#pragma once

#include <array>
#include <chrono>

#include "links/time.hpp"
#include "master/object_address.hpp"

namespace servodrome::master {

// Prevents that a late answer is taken for the answer to the next request. A late answer to a read of an object looks
// like the answer to a second read of the same object. But a drive answers in order: once it has answered the read of
// another object, no earlier answer can follow. So after a missing answer, a client first reads another, constant
// object. Two such objects are used in turn, because the answer for one of them may be late, too.
class LateAnswer {
 public:
  // A request got no answer in time.
  void expect(links::Time now) { until_ = now + longest; }
  bool is_expected(links::Time now) const { return now < until_; }
  // No late answer can follow any more: the drive has answered the read of next_object(), or another request after the
  // missing answer.
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
