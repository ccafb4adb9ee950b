#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "links/time.hpp"

namespace servodrome::host {

// Turns what a terminal sends of a keyboard into the velocity to jog at. A terminal tells of no key that is let go,
// only that a held one repeats: a direction acts until no key came for `hold`, which must be longer than the pause
// before a keyboard begins to repeat.
//
// Right, l or +: forwards. Left, h or -: backwards. Up, k and down, j: the double and the half of the velocity, from
// 1/16 to 16 times. Blank or any other key: stop. q, Escape, Ctrl-C or Ctrl-D: the end.
class JogKeys {
 public:
  explicit JogKeys(std::int32_t velocity, links::Time hold = std::chrono::milliseconds(600))
      : velocity_(velocity), hold_(hold) {}

  // What came from the terminal until `now`. An arrow's three characters come at once.
  void feed(std::string_view characters, links::Time now);
  // Nothing: the end.
  std::optional<std::int32_t> velocity(links::Time now) const;
  // Of a key that is held, in the drive's units.
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

}  // namespace servodrome::host
