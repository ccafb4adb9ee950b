#pragma once

#include "canopen/301/emergency.hpp"

namespace servodrome::canopen {

// SYNC consumer and producer (CiA 301 7.2.5, objects 1005h, 1006h, 1007h, 1019h).
class Sync {
 public:
  Sync(Link& link, dictionary::Dictionary& dictionary, const Profile& profile, Emergency& emergency)
      : link_(link), dictionary_(dictionary), profile_(profile), emergency_(emergency) {}

  // Call it after a reset, and after a write to one of the objects.
  void configure();
  dictionary::AbortCode check(const dictionary::Entry& entry, std::uint32_t value) const;

  // SYNC is active in pre-operational and operational.
  void set_allowed(bool allowed);

  std::uint16_t can_id() const { return can_id_; }
  bool present() const { return present_; }

  // Returns true if the frame is a SYNC to act on; `counter` is 0 if SYNCs have no counter.
  bool receive(const Frame& frame, std::uint8_t& counter) {
    if (!allowed_) return false;
    if (frame.length != expected_length_ || length_error_) {
      if (!check_length(frame.length)) return false;
    }
    counter = overflow_ != 0 ? frame.data[0] : std::uint8_t{0};
    return true;
  }

  // Latest time for synchronous PDOs of the cycle that begins now.
  Time window_end() const { return window_ == Time{0} ? never : link_.now() + window_; }

  // Returns true if this node has just produced a SYNC; the node consumes it as well.
  bool poll(std::uint8_t& counter);

 private:
  bool check_length(std::uint8_t length);

  Link& link_;
  dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  Emergency& emergency_;
  bool present_ = false;
  bool allowed_ = false;
  bool producing_ = false;
  bool length_error_ = false;
  bool length_matters_ = false;
  std::uint8_t expected_length_ = 0;
  std::uint8_t overflow_ = 0;
  std::uint8_t counter_ = 1;
  std::uint16_t can_id_ = 0x80;
  Time period_{0};
  Time window_{0};
  Time deadline_ = never;
  Link::Place place_ = Link::no_place;
};

}  // namespace servodrome::canopen
