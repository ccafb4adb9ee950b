#include <array>
#include <fmt/format.h>

#include "drive/drive.hpp"
#include "drive/homing/cia402_methods.hpp"
#include "line/bench/axis_view.hpp"
#include "line/bench/line_bench.hpp"

// The homing methods of a drive, leg by leg, from the table that its homing uses.
namespace servodrome::line::bench {
namespace {

using drive::Direction;
using drive::HomingSpeed;
using drive::Leg;
using drive::Then;
using drive::Until;

template <typename Key>
struct Word {
  Key key;
  const char* name;
  const char* text;
};
constexpr auto until_words = std::to_array<Word<Until>>({
    {Until::home_rising, "home_rising", "the home switch becomes active"},
    {Until::home_falling, "home_falling", "the home switch becomes inactive"},
    {Until::limit_reached, "limit_reached", "the {} limit switch is active"},
    {Until::limit_released, "limit_released", "the {} limit switch becomes inactive"},
    {Until::index, "index", "the next index of the encoder"},
    {Until::stalled, "stalled", "the axis presses against its stop"},
    {Until::retracted, "retracted", "the retraction distance is travelled"},
});

constexpr auto then_words = std::to_array<Word<Then>>({
    {Then::stop, "stop", "then stop"},
    {Then::keep, "keep", "then continue without stopping"},
    {Then::hold, "hold", "then hold the position"},
    {Then::latch, "latch", "this position is home"},
});

template <typename Key, std::size_t Count>
const Word<Key>& row_of(const std::array<Word<Key>, Count>& words, Key key) {
  for (const Word<Key>& row : words) {
    if (row.key == key) return row;
  }
  return words.front();
}

const char* word(Direction direction) { return direction == Direction::negative ? "negative" : "positive"; }

// The names that are opposite to the directions of a leg (the user's) while 607Eh reverses the position.
struct Reversal {
  bool ends = false;      // of the ends of the travel: the geometry names them by the shaft's directions
  bool switches = false;  // of the limit switches: 60FDh names them by the shaft's directions
};

Direction turned(Direction direction, bool reversed) { return reversed ? opposite(direction) : direction; }

// Returns the end of the travel whose limit switch matters for a leg: the end that the leg runs towards, or the end
// that it leaves (limit_released).
Direction limit_of(const Leg& leg) {
  return leg.until == Until::limit_released ? opposite(leg.direction) : leg.direction;
}

Json leg_number(std::uint8_t leg) { return leg == drive::no_leg ? Json(nullptr) : Json(leg); }

Json view_of(const Leg& leg, Reversal reversal) {
  const Word<Until>& until = row_of(until_words, leg.until);
  const Word<Then>& then = row_of(then_words, leg.then);
  const bool fast = leg.speed == HomingSpeed::fast;
  std::string text =
      fmt::format("{}, at the speed during search for {}, until {}; {}", word(leg.direction), fast ? "switch" : "zero",
                  fmt::format(fmt::runtime(until.text), word(turned(limit_of(leg), reversal.switches))), then.text);
  if (leg.on_limit != drive::no_leg) {
    text += fmt::format("; at the {} limit switch stop, then leg {}", word(turned(leg.direction, reversal.switches)),
                        leg.on_limit + 1);
  }
  return Json{{"direction", word(leg.direction)},
              {"speed", fast ? "switch" : "zero"},
              {"until", until.name},
              {"then", then.name},
              {"next", leg_number(leg.next)},
              {"on_limit", leg_number(leg.on_limit)},
              {"text", std::move(text)}};
}

Json view_of(const drive::Method& method, Reversal reversal) {
  Json legs = Json::array();
  for (std::size_t i = 0; i < method.leg_count; ++i) legs.push_back(view_of(method.legs[i], reversal));
  Json needs = Json::array();
  for (const Direction end : {Direction::negative, Direction::positive}) {
    if (!needs_limit_switch(method, turned(end, reversal.ends))) continue;
    needs.push_back(fmt::format("{}_limit", word(end)));
  }
  if (needs_home_switch(method)) needs.push_back("home");
  if (uses_index(method)) needs.push_back("index");
  for (std::size_t i = 0; i < method.leg_count; ++i) {
    if (method.legs[i].until != Until::stalled) continue;
    needs.push_back(fmt::format("{}_stop", word(turned(method.legs[i].direction, reversal.ends))));
  }
  return Json{{"method", method.number},
              {"supported", !method.idle},
              {"legs", std::move(legs)},
              {"start_active", method.start_active},
              {"returns", method.returns_to_latch},
              {"needs", std::move(needs)}};
}

}  // namespace

Json LineBench::show_homing(Call& call) {
  const drive::Drive& drive = axis_of(call).device().drive();
  Json view = homing_view(drive.policy(), drive.axis().units.position_inverted);
  view["index_available"] = drive.axis().configuration.index_available;
  return view;
}

Json homing_view(const drive::Policy& policy, bool reversed) {
  const std::span<const drive::Method> table = policy.homing.methods;
  const Reversal reversal{.ends = reversed, .switches = reversed && !policy.terminals.limit_inputs_follow_polarity};
  Json methods = Json::array();
  for (int number = INT8_MIN; number <= INT8_MAX; ++number) {
    const auto narrow = static_cast<std::int8_t>(number);
    if (const drive::Method* method = find_method(table, narrow)) {
      methods.push_back(view_of(*method, reversal));
    } else if (find_method(drive::cia402_methods, narrow) != nullptr && number > 0) {
      methods.push_back({{"method", number}, {"supported", false}, {"legs", Json::array()}});
    }
  }
  return Json{{"reversed", reversed}, {"methods", std::move(methods)}};
}

}  // namespace servodrome::line::bench
