#pragma once

#include <array>
#include <span>

#include "tools/script/script.hpp"

// Keywords of the script language, as tables.
namespace servodrome::master::script {

struct Argument {
  std::string_view keyword;  // "" for the number after the verb
  Quantity quantity = Quantity::plain;
  bool required = false;
};

struct VerbRow {
  std::string_view word;
  Verb verb;
  bool of_axis;
  std::span<const Argument> arguments{};
  std::span<const std::string_view> flags{};
};

inline constexpr Argument within{"within", Quantity::seconds};

inline constexpr std::array home_arguments{Argument{"method"},
                                           Argument{"speed", Quantity::velocity},
                                           Argument{"zero-speed", Quantity::velocity},
                                           Argument{"acceleration", Quantity::acceleration},
                                           Argument{"offset", Quantity::position},
                                           within};
inline constexpr std::array move_arguments{Argument{"to", Quantity::position},
                                           Argument{"by", Quantity::position},
                                           Argument{"velocity", Quantity::velocity},
                                           Argument{"acceleration", Quantity::acceleration},
                                           Argument{"deceleration", Quantity::acceleration},
                                           within};
inline constexpr std::array<std::string_view, 1> move_flags{"nowait"};
inline constexpr std::array arrive_arguments{within};
inline constexpr std::array velocity_arguments{Argument{"", Quantity::velocity, true},
                                               Argument{"acceleration", Quantity::acceleration},
                                               Argument{"deceleration", Quantity::acceleration}, within};
inline constexpr std::array jog_arguments{Argument{"", Quantity::velocity, true},
                                          Argument{"for", Quantity::seconds, true},
                                          Argument{"acceleration", Quantity::acceleration}};
inline constexpr std::array torque_arguments{Argument{"", Quantity::percent, true},
                                             Argument{"slope", Quantity::percent}, within};
inline constexpr std::array probe_arguments{Argument{""}};
inline constexpr std::array<std::string_view, 4> probe_flags{"index", "positive", "negative", "continuous"};
inline constexpr std::array wait_probe_arguments{Argument{""}, within};
inline constexpr std::array<std::string_view, 2> wait_probe_flags{"positive", "negative"};
inline constexpr std::array expect_arguments{Argument{"tolerance"}, within};
inline constexpr std::array wait_arguments{Argument{"", Quantity::seconds, true}};

// `set`, `get`, `expect` and `wait-until` have a subject before these arguments, `print` a text. `wait-until` is an
// `expect` that waits, by default for the script's timeout.
inline constexpr std::array verbs{
    VerbRow{"reset", Verb::reset, true},
    VerbRow{"enable", Verb::enable, true},
    VerbRow{"disable", Verb::disable, true},
    VerbRow{"quick-stop", Verb::quick_stop, true},
    VerbRow{"stop", Verb::stop, true},
    VerbRow{"halt", Verb::halt, true},
    VerbRow{"resume", Verb::resume, true},
    VerbRow{"home", Verb::home, true, home_arguments},
    VerbRow{"move", Verb::move, true, move_arguments, move_flags},
    VerbRow{"arrive", Verb::arrive, true, arrive_arguments},
    VerbRow{"velocity", Verb::velocity, true, velocity_arguments},
    VerbRow{"jog", Verb::jog, true, jog_arguments},
    VerbRow{"torque", Verb::torque, true, torque_arguments},
    VerbRow{"arm-probe", Verb::arm_probe, true, probe_arguments, probe_flags},
    VerbRow{"wait-probe", Verb::wait_probe, true, wait_probe_arguments, wait_probe_flags},
    VerbRow{"set", Verb::set, true},
    VerbRow{"get", Verb::get, true},
    VerbRow{"expect", Verb::expect, true, expect_arguments},
    VerbRow{"wait-until", Verb::expect, true, expect_arguments},
    VerbRow{"wait", Verb::wait, false, wait_arguments},
    VerbRow{"print", Verb::print, false},
    VerbRow{"repeat", Verb::repeat, false},
};

// Words that begin a line and are not verbs of a step.
inline constexpr std::array<std::string_view, 5> other_words{"axis", "use", "units", "timeout", "end"};

struct ComparisonRow {
  std::string_view word;
  Comparison comparison;
};
inline constexpr std::array comparisons{
    ComparisonRow{"==", Comparison::equal},     ComparisonRow{"!=", Comparison::not_equal},
    ComparisonRow{"<", Comparison::less},       ComparisonRow{"<=", Comparison::at_most},
    ComparisonRow{">", Comparison::greater},    ComparisonRow{">=", Comparison::at_least},
    ComparisonRow{"has", Comparison::has_bits}, ComparisonRow{"lacks", Comparison::lacks_bits},
};

struct SubjectRow {
  std::string_view word;
  Subject::Kind kind;
};
inline constexpr std::array subjects{
    SubjectRow{"position", Subject::Kind::position}, SubjectRow{"velocity", Subject::Kind::velocity},
    SubjectRow{"torque", Subject::Kind::torque}, SubjectRow{"state", Subject::Kind::state}};

}  // namespace servodrome::master::script
