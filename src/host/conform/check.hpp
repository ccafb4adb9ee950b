#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "links/time.hpp"

// What a check of a standard is, and what came of it.
namespace servodrome::host::conform {

using links::Time;

enum class Verdict : std::uint8_t {
  pass,
  fail,
  departure,  // not as the standard says, and the product's manual says so
  skipped,    // it could not be looked at, and why is said
};
// "pass", "FAIL", "departure", "skipped"
const char* name(Verdict verdict);

// What the axis is let do by a check.
enum class Demand : std::uint8_t {
  nothing,  // its power stage stays off
  enable,   // it is energised and stands
  motion,   // it moves
};
const char* name(Demand demand);

// Kinds of bus, as a set.
namespace buses {
inline constexpr unsigned can = 1;
inline constexpr unsigned ethercat = 2;
inline constexpr unsigned modbus = 4;
inline constexpr unsigned sdo = can | ethercat;  // those with SDOs and abort codes
inline constexpr unsigned all = can | ethercat | modbus;
}  // namespace buses

class Trial;

struct Check {
  std::string_view id;      // "power.transition-2"; before the dot is the group
  std::string_view clause;  // of the standard
  std::string_view title;   // what is claimed
  Demand demand = Demand::nothing;
  unsigned buses = buses::all;
  void (*run)(Trial&, int row) = nullptr;
  int row = 0;  // of the table that `run` works through, for checks that differ in data only

  constexpr std::string_view group() const { return id.substr(0, id.find('.')); }
};

// One thing that a check looked at.
struct Observation {
  std::string sent;
  std::string expected;
  std::string seen;
  bool met = true;
};

struct Outcome {
  const Check* check = nullptr;
  Verdict verdict = Verdict::pass;
  std::string reason{};  // why it was skipped, or what the manual says
  std::vector<Observation> observations{};
  Time duration{};
};

}  // namespace servodrome::host::conform
