#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

// A homing method is a short list of legs. A leg runs in one direction at one speed until an event. Directions are
// those of the user (607Eh may reverse them, see HomingConfig::reversed). The limit switch in the direction of travel
// is "ahead", the other one "behind", so that a method and its mirror image differ in direction only.
namespace servodrome::drive {

enum class Direction : std::int8_t { negative = -1, positive = 1 };

constexpr Direction opposite(Direction direction) {
  return direction == Direction::negative ? Direction::positive : Direction::negative;
}

enum class HomingSpeed : std::uint8_t { fast, slow };  // 6099h sub 1, sub 2

enum class Until : std::uint8_t {
  home_rising,     // the home switch becomes active, by its edge
  home_falling,    // ... inactive
  limit_reached,   // the limit switch ahead is active, by level: also when it already was at the start of the leg
  limit_released,  // the limit switch behind becomes inactive, by its edge
  index,           // the encoder's index, by its edge
  stalled,         // torque in the direction of travel above the threshold for the set time
  retracted,       // the retraction distance is travelled
};

enum class Then : std::uint8_t {
  stop,   // ramp to zero, then the next leg
  keep,   // the next leg at once; if it is slower the axis slows down without stopping
  hold,   // the position reached is the new demand, without a ramp (the axis is pressed against a stop); next leg
  latch,  // this is home: the method is done, the axis ramps to zero
};

inline constexpr std::uint8_t no_leg = 0xFF;

struct Leg {
  Direction direction = Direction::positive;
  HomingSpeed speed = HomingSpeed::slow;
  Until until = Until::index;
  Then then = Then::latch;
  std::uint8_t next = no_leg;      // after this leg; not used with Then::latch
  std::uint8_t on_limit = no_leg;  // after a stop at the limit switch ahead; no_leg: error, unless the leg ends there
};

inline constexpr std::size_t max_legs = 6;

struct Method {
  std::int8_t number = 0;         // 6098h
  std::uint8_t leg_count = 0;     // 0: no motion, the present position is home
  std::uint8_t start_active = 0;  // first leg if the home switch is active at the start; otherwise it is leg 0
  bool returns_to_latch = false;  // after the ramp to zero the axis moves back to the latched position
  bool idle = false;              // may be chosen but does nothing: reserved numbers of some products
  bool offset_applies = true;     // 607Ch
  std::array<Leg, max_legs> legs{};
};

// Every leg leads to a later leg only, and each path ends with a latch, so a method cannot loop.
constexpr bool is_well_formed(const Method& method) {
  if (method.leg_count > max_legs) return false;
  if (method.leg_count == 0) return method.start_active == 0 && !method.returns_to_latch;
  if (method.idle) return false;
  if (method.start_active >= method.leg_count) return false;
  for (std::size_t i = 0; i < method.leg_count; ++i) {
    const Leg& leg = method.legs[i];
    const auto leads_on = [&](std::uint8_t to) { return to > i && to < method.leg_count; };
    if (leg.then == Then::latch ? leg.next != no_leg : !leads_on(leg.next)) return false;
    if (leg.on_limit != no_leg && (leg.until == Until::limit_reached || !leads_on(leg.on_limit))) return false;
    if ((leg.until == Until::stalled) != (leg.then == Then::hold)) return false;
    if (leg.until == Until::retracted && leg.then != Then::latch) return false;
    // A latch needs an edge; a level has no position.
    if (leg.until == Until::limit_reached && leg.then == Then::latch) return false;
    // After `keep` the axis does not stop, so the next leg must have the same direction.
    if (leg.then == Then::keep && method.legs[leg.next].direction != leg.direction) return false;
  }
  return true;
}

// All methods are well formed, and each number is unique.
constexpr bool are_well_formed(std::span<const Method> methods) {
  for (std::size_t i = 0; i < methods.size(); ++i) {
    if (!is_well_formed(methods[i])) return false;
    for (std::size_t j = i + 1; j < methods.size(); ++j) {
      if (methods[i].number == methods[j].number) return false;
    }
  }
  return true;
}

// The method with that number; nullptr: not supported.
constexpr const Method* find_method(std::span<const Method> methods, std::int8_t number) {
  for (const Method& method : methods) {
    if (method.number == number) return &method;
  }
  return nullptr;
}

constexpr bool uses_index(const Method& method) {
  for (std::size_t i = 0; i < method.leg_count; ++i) {
    if (method.legs[i].until == Until::index) return true;
  }
  return false;
}

// Returns true if a leg runs at that speed. `retracts`: there is a retraction distance; without one, the leg that
// travels it does not run.
constexpr bool uses_speed(const Method& method, HomingSpeed speed, bool retracts) {
  for (std::size_t i = 0; i < method.leg_count; ++i) {
    if (method.legs[i].speed == speed && (retracts || method.legs[i].until != Until::retracted)) return true;
  }
  return false;
}

constexpr bool needs_limit_switch(const Method& method, Direction end) {
  for (std::size_t i = 0; i < method.leg_count; ++i) {
    const Leg& leg = method.legs[i];
    if (leg.until == Until::limit_reached && leg.direction == end) return true;
    if (leg.until == Until::limit_released && leg.direction == opposite(end)) return true;
  }
  return false;
}

constexpr bool needs_home_switch(const Method& method) {
  for (std::size_t i = 0; i < method.leg_count; ++i) {
    if (method.legs[i].until == Until::home_rising || method.legs[i].until == Until::home_falling) return true;
  }
  return false;
}

// --- Functions to write tables of methods

// A leg; unless `next` is given, make_method() sets it to the following leg.
constexpr Leg leg(Direction direction, HomingSpeed speed, Until until, Then then, std::uint8_t next = no_leg,
                  std::uint8_t on_limit = no_leg) {
  return {direction, speed, until, then, next, on_limit};
}

template <std::size_t count>
constexpr Method make_method(std::int8_t number, const Leg (&legs)[count], std::uint8_t start_active = 0,
                             bool returns_to_latch = false) {
  static_assert(count <= max_legs);
  Method method{.number = number,
                .leg_count = static_cast<std::uint8_t>(count),
                .start_active = start_active,
                .returns_to_latch = returns_to_latch};
  for (std::size_t i = 0; i < count; ++i) {
    method.legs[i] = legs[i];
    if (legs[i].then != Then::latch && legs[i].next == no_leg) {
      method.legs[i].next = static_cast<std::uint8_t>(i + 1);
    }
  }
  return method;
}

// A method without motion: the present position is home.
constexpr Method present_position(std::int8_t number) { return Method{.number = number}; }

// A number that may be chosen but does nothing.
constexpr Method no_homing(std::int8_t number) { return Method{.number = number, .idle = true}; }

// The same method without the home offset: home is 0 for any value of 607Ch.
constexpr Method without_offset(Method method) {
  method.offset_applies = false;
  return method;
}

// The same method for the other end of the axis.
constexpr Method mirrored(std::int8_t number, Method method) {
  method.number = number;
  for (Leg& leg : method.legs) leg.direction = opposite(leg.direction);
  return method;
}

// The same method without a way back: the axis rests where the ramp after the latch ends.
constexpr Method without_return(Method method) {
  method.returns_to_latch = false;
  return method;
}

// The same method without its last leg, the leg to the index: the edge before the index is home.
constexpr Method without_index(std::int8_t number, Method method) {
  method.number = number;
  --method.leg_count;
  const std::uint8_t removed = method.leg_count;
  method.legs[removed] = Leg{};
  for (std::size_t i = 0; i < removed; ++i) {
    if (method.legs[i].next != removed) continue;
    method.legs[i].next = no_leg;
    method.legs[i].then = Then::latch;
  }
  return method;
}

}  // namespace servodrome::drive
