#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "links/time.hpp"

namespace servodrome::master {

// Converts the characters of a terminal into the velocity to jog at. A terminal does not report that a key is released;
// it only repeats a held key. So a direction acts until no direction key has arrived for `hold`, which must be longer
// than the keyboard's delay before its first repeat.
//
// Right, l or +: forwards. Left, h or -: backwards. Up or k doubles the velocity, down or j halves it, from 1/16 to 16
// times. Space or any other key stops. q, Escape, Ctrl-C or Ctrl-D ends.
class JogKeys {
 public:
  // `velocity`: in the drive's units. Its sign is ignored, because the keys select the direction.
  explicit JogKeys(std::int32_t velocity, links::Time hold = std::chrono::milliseconds(600))
      : velocity_(velocity), hold_(hold) {}

  // The characters received until `now`. The three characters of an arrow key must be in one call.
  void feed(std::string_view characters, links::Time now);
  // In the drive's units; nullopt: the user has ended the jog.
  std::optional<std::int32_t> velocity(links::Time now) const;
  // Magnitude of the velocity while a key is held, in the drive's units.
  std::int32_t speed() const;

 private:
  void go(int direction, links::Time now);

  std::int32_t velocity_;
  links::Time hold_;
  int direction_ = 0;
  int doublings_ = 0;
  links::Time last_{};
  bool ended_ = false;
};

}  // namespace servodrome::master
