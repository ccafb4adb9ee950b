#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "links/time.hpp"

// A check against a standard, and its result.
namespace servodrome::master::conform {

using links::Time;

enum class Verdict : std::uint8_t {
  pass,
  fail,
  departure,  // deviates from the standard, and the product's manual documents it
  skipped,    // could not be carried out; the reason is reported
};
// "pass", "FAIL", "departure" or "skipped".
const char* name(Verdict verdict);

// What a check needs the axis to do.
enum class Demand : std::uint8_t {
  nothing,  // the power stage stays off
  enable,   // the axis is energised and stands still
  motion,   // the axis moves
};
const char* name(Demand demand);

// Kinds of bus, as a bit set.
namespace buses {
inline constexpr unsigned can = 1;
inline constexpr unsigned ethercat = 2;
inline constexpr unsigned modbus = 4;
inline constexpr unsigned sdo = can | ethercat;  // buses with SDOs and abort codes
inline constexpr unsigned all = can | ethercat | modbus;
}  // namespace buses

class Trial;

struct Check {
  std::string_view id;      // for example "power.transition-2"; the group is the part before the dot
  std::string_view clause;  // of the standard
  std::string_view title;   // the claim that is checked
  Demand demand = Demand::nothing;
  unsigned buses = buses::all;
  void (*run)(Trial&, int row) = nullptr;
  int row = 0;  // row in a table of `run`, for checks that differ only in data

  constexpr std::string_view group() const { return id.substr(0, id.find('.')); }
};

// One comparison that a check made.
struct Observation {
  std::string sent;
  std::string expected;
  std::string seen;
  bool met = true;
};

struct Outcome {
  const Check* check = nullptr;
  Verdict verdict = Verdict::pass;
  std::string reason{};  // why it was skipped, or the manual's statement
  std::vector<Observation> observations{};
  Time duration{};
};

}  // namespace servodrome::master::conform
