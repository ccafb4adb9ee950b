#pragma once

#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "axis/axis_units.hpp"
#include "axis/object_catalogue.hpp"

// Motion scripts: one command on each line, for one or more axes on a bus. Reference: docs/script.md.
namespace servodrome::master::script {

struct Place {
  unsigned line = 0;  // from 1
  unsigned column = 0;
};

// Kind of quantity, which determines how a number is converted to the drive's units.
enum class Quantity : std::uint8_t { plain, seconds, percent, position, velocity, acceleration };

enum class Verb : std::uint8_t {
  reset,
  enable,
  disable,
  quick_stop,
  stop,
  halt,
  resume,
  home,
  move,
  arrive,
  velocity,
  jog,
  torque,
  arm_probe,
  wait_probe,
  set,
  get,
  expect,
  wait,
  print,
  repeat,
};

enum class Comparison : std::uint8_t { equal, not_equal, less, at_most, greater, at_least, has_bits, lacks_bits };

// Subject of `expect`, `wait-until`, `get` and `set`: an object, or position, velocity, torque or state of the axis.
struct Subject {
  enum class Kind : std::uint8_t { object, position, velocity, torque, state };
  Kind kind = Kind::object;
  ObjectAddress object{};
  std::optional<dictionary::Type> type{};  // of the object; nullopt: determined by its size
  std::string word{};                      // as written in the script
};

struct Step {
  Place place;
  std::string source{};  // the line without surrounding blanks and comment
  Verb verb{};
  std::size_t axis = 0;                                  // number of the axis, for verbs that have one
  UnitChoice units{};                                    // units of the numbers
  double timeout_s = 0.0;                                // timeout of a motion or a wait; 0: none given, evaluated once
  std::map<std::string, double, std::less<>> numbers{};  // by keyword; "" for the number after the verb
  std::vector<std::string> flags{};                      // keywords without a number
  Subject subject{};
  Comparison comparison{};
  std::string text{};        // text of `print`; value of `set` and `expect` as written
  unsigned count = 1;        // number of repetitions of `repeat`
  std::vector<Step> body{};  // steps of `repeat`

  std::optional<double> number(std::string_view keyword) const {
    const auto found = numbers.find(keyword);
    return found != numbers.end() ? std::optional(found->second) : std::nullopt;
  }
  bool has(std::string_view flag) const { return std::find(flags.begin(), flags.end(), flag) != flags.end(); }
};

struct AxisDeclaration {
  std::string name{};     // "" for the only axis of a script that declares none
  unsigned node = 0;      // 0: taken from the command line
  std::string product{};  // "": taken from the drive or the command line
  Place place{};
};

struct Script {
  std::string file;
  std::vector<AxisDeclaration> axes;  // at least one
  std::vector<Step> steps;

  // Number of steps; those within `repeat` count once.
  std::size_t count_steps() const;
};

struct Mistake {
  Place place;
  std::string message;
};

// All errors of a script. what() has one line "FILE:LINE:COLUMN: message" for each.
class ScriptMistakes : public std::runtime_error {
 public:
  ScriptMistakes(const std::string& file, std::vector<Mistake> mistakes);
  const std::vector<Mistake>& mistakes() const { return mistakes_; }

 private:
  std::vector<Mistake> mistakes_;
};

// Returns the catalogue of a product, valid during the parsing; nullptr: unknown product.
using CatalogueOf = std::function<const ObjectCatalogue*(const std::string& product)>;

// Names and types of objects come from `catalogue`, or, for an axis declared with a product, from `catalogue_of` if
// given. Throws ScriptMistakes with all errors.
Script parse(std::string_view text, const std::string& file, const ObjectCatalogue& catalogue,
             const CatalogueOf& catalogue_of = {});

// True for the commands after which an axis that another program has enabled counts as moved by the script.
bool can_move(Verb verb);
// True if the step uses the axis beyond reading and writing objects, for example its controlword or position.
bool needs_axis(const Step& step);
// True if the step may enable, move or stop its axis. A `set` counts: it may write a controlword or a target.
bool commands_axis(const Step& step);
// For each declared axis: true if a step commands it. The script only reads the others.
std::vector<bool> commanded_axes(const Script& script);

// Quantity of the number after a keyword of a verb; used by runner and messages.
Quantity quantity_of(Verb verb, std::string_view keyword);

}  // namespace servodrome::master::script
