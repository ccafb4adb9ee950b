#pragma once

#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "host/axis_units.hpp"
#include "host/object_catalogue.hpp"

// Motion scripts: a command on each line, for one axis or several on one bus. docs/script.md is their reference.
namespace servodrome::host::script {

struct Place {
  unsigned line = 0;  // from 1
  unsigned column = 0;
};

// What a number is: how a script's units turn it into the drive's.
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

// What `expect`, `wait-until`, `get` and `set` look at: an object, or position, velocity, torque or state of the axis.
struct Subject {
  enum class Kind : std::uint8_t { object, position, velocity, torque, state };
  Kind kind = Kind::object;
  ObjectAddress object{};
  std::optional<dictionary::Type> type{};  // of the object; nothing: by its size
  std::string word{};                      // as it was written
};

struct Step {
  Place place;
  std::string source{};  // the line without blanks around it and comment
  Verb verb{};
  std::size_t axis = 0;                                  // number of the axis; of verbs that are about one
  UnitChoice units{};                                    // what numbers are in
  double timeout_s = 0.0;                                // of a motion or a wait; 0: none was given, look once
  std::map<std::string, double, std::less<>> numbers{};  // by keyword; "" for the one without
  std::vector<std::string> flags{};                      // keywords without number
  Subject subject{};
  Comparison comparison{};
  std::string text{};        // of `print`; the value of `set` and `expect` as it was written
  unsigned count = 1;        // of `repeat`
  std::vector<Step> body{};  // of `repeat`

  std::optional<double> number(std::string_view keyword) const {
    const auto found = numbers.find(keyword);
    return found != numbers.end() ? std::optional(found->second) : std::nullopt;
  }
  bool has(std::string_view flag) const { return std::find(flags.begin(), flags.end(), flag) != flags.end(); }
};

struct AxisDeclaration {
  std::string name{};     // "" for the only axis of a script that declares none
  unsigned node = 0;      // 0: as the command says
  std::string product{};  // "": as the drive or the command says
  Place place{};
};

struct Script {
  std::string file;
  std::vector<AxisDeclaration> axes;  // one at least
  std::vector<Step> steps;

  // Steps, those within `repeat` once.
  std::size_t count_steps() const;
};

struct Mistake {
  Place place;
  std::string message;
};

// All that is wrong with a script. what() is "FILE:LINE:COLUMN: message", a line for each.
class ScriptMistakes : public std::runtime_error {
 public:
  ScriptMistakes(const std::string& file, std::vector<Mistake> mistakes);
  const std::vector<Mistake>& mistakes() const { return mistakes_; }

 private:
  std::vector<Mistake> mistakes_;
};

// The catalogue of a product, which lives as long as the parsing; nullptr: there is none of this name.
using CatalogueOf = std::function<const ObjectCatalogue*(const std::string& product)>;

// Names and types of objects are those of the catalogue; for an axis that is declared with its product, those of
// `catalogue_of` (if there is one). Throws ScriptMistakes with every mistake there is.
Script parse(std::string_view text, const std::string& file, const ObjectCatalogue& catalogue,
             const CatalogueOf& catalogue_of = {});

// Does the step need more of its axis than objects: a controlword, a position?
bool needs_axis(const Step& step);

// How a quantity of a verb's keyword is read; for the runner and the messages.
Quantity quantity_of(Verb verb, std::string_view keyword);

}  // namespace servodrome::host::script
