#include "axis/jog_keys.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace servodrome::master {
namespace {

constexpr int most_doublings = 4;
constexpr char escape = 27;
constexpr char control_c = 3;
constexpr char control_d = 4;

}  // namespace

void JogKeys::go(int direction, links::Time now) {
  direction_ = direction;
  last_ = now;
}

void JogKeys::feed(std::string_view characters, links::Time now) {
  for (std::size_t i = 0; i < characters.size() && !ended_; ++i) {
    char key = characters[i];
    if (key == escape) {
      // An arrow key sends ESC [ A or ESC O A; the last letter is the direction of the cursor.
      const bool arrow = i + 2 < characters.size() && (characters[i + 1] == '[' || characters[i + 1] == 'O');
      if (arrow) {
        constexpr std::string_view letters = "ABCD";
        constexpr std::string_view keys = "kjlh";
        const std::size_t at = letters.find(characters[i + 2]);
        key = at != std::string_view::npos ? keys[at] : ' ';
        i += 2;
      }
    }
    switch (key) {
      case 'l':
      case '+': go(1, now); break;
      case 'h':
      case '-': go(-1, now); break;
      case 'k': doublings_ = std::min(doublings_ + 1, most_doublings); break;
      case 'j': doublings_ = std::max(doublings_ - 1, -most_doublings); break;
      case 'q':
      case escape:
      case control_c:
      case control_d: ended_ = true; break;
      default: direction_ = 0;
    }
  }
}

std::int32_t JogKeys::speed() const {
  const double wanted = std::round(std::ldexp(std::abs(static_cast<double>(velocity_)), doublings_));
  return static_cast<std::int32_t>(std::min(wanted, static_cast<double>(std::numeric_limits<std::int32_t>::max())));
}

std::optional<std::int32_t> JogKeys::velocity(links::Time now) const {
  if (ended_) return std::nullopt;
  if (direction_ == 0 || now - last_ >= hold_) return 0;
  return direction_ * speed();
}

}  // namespace servodrome::master
