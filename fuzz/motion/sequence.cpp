#include "sequence.hpp"

#include <algorithm>
#include <charconv>
#include <fmt/format.h>
#include <sstream>

#include "plant/injection.hpp"

namespace servodrome::motion {
namespace {

constexpr std::array<const char*, kinds> kind_names{"write",     "write-here", "enable", "stream", "nmt",  "al",
                                                    "heartbeat", "cycle",      "input",  "supply", "load", "inertia",
                                                    "lock",      "inject",     "power",  "cut"};
constexpr std::array<const char*, 3> via_names{"sdo", "pdo", "direct"};

std::string time_text(std::int64_t tick) {
  return fmt::format("{}.{:04}", tick / ticks_per_ms, tick % ticks_per_ms * 625);
}

bool has_object(Kind kind) { return kind == Kind::write || kind == Kind::write_here || kind == Kind::stream; }

class Words {
 public:
  explicit Words(const std::string& line) : in_(line) {}
  std::string word() {
    std::string word;
    in_ >> word;
    return word;
  }
  std::int64_t number() {
    const std::string text = word();
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
      fail(text.empty() ? "a number is missing" : "\"" + text + "\" is no number");
    return value;
  }
  void fail(const std::string& what) {
    if (error_.empty()) error_ = what;
  }
  const std::string& error() const { return error_; }

 private:
  std::istringstream in_;
  std::string error_;
};

std::int64_t read_time(Words& words, const std::string& text) {
  try {
    std::size_t used = 0;
    const double ms = std::stod(text, &used);
    if (used == text.size() && ms >= 0 && ms < 1e9) return static_cast<std::int64_t>(ms * ticks_per_ms + 0.5);
  } catch (const std::exception&) {
  }
  words.fail("\"" + text + "\" is no time in ms");
  return 0;
}

void read_axis(Words& words, Sequence& sequence) {
  AxisSetup axis;
  axis.product = words.word();
  for (std::string key = words.word(); !key.empty(); key = words.word()) {
    if (key == "model") {
      axis.model = words.word();
    } else if (key == "start") {
      axis.start_counts = words.number();
    } else if (key == "inertia") {
      axis.inertia_percent = words.number();
    } else if (key == "friction") {
      axis.friction_percent = words.number();
    } else if (key == "travel") {
      axis.travel_counts = words.number();
    } else if (key == "stops") {
      axis.stop_counts = words.number();
    } else {
      words.fail("an axis has no \"" + key + "\"; it has model, start, inertia, friction, travel and stops");
    }
  }
  sequence.axes.push_back(axis);
}

void read_line(Words& words, Sequence& sequence) {
  for (std::string key = words.word(); !key.empty(); key = words.word()) {
    if (key == "cycle") {
      sequence.cycle_us = words.number();
    } else if (key == "sync") {
      sequence.sync = words.number() != 0;
    } else if (key == "mapped") {
      sequence.mapped = words.number() != 0;
    } else {
      words.fail("a line has no \"" + key + "\"; it has cycle, sync and mapped");
    }
  }
  if (sequence.cycle_us < 125) words.fail("a cycle has 125 us or more");
}

void read_object(Words& words, Event& event) {
  const std::string text = words.word();
  unsigned index = 0;
  unsigned sub = 0;
  if (std::sscanf(text.c_str(), "%x:%x", &index, &sub) < 1)
    words.fail("\"" + text + "\" is no object; write 6040 or 6099:01");
  event.index = static_cast<std::uint16_t>(index);
  event.sub = static_cast<std::uint8_t>(sub);
}

// Reads a decimal number, or a hexadecimal one with 0x.
std::int64_t read_value(Words& words) {
  const std::string text = words.word();
  try {
    const std::string_view digits = std::string_view(text).substr(text.starts_with('-') ? 1 : 0);
    const int base = digits.starts_with("0x") ? 16 : 10;  // not 0, with which "010" would be octal
    std::size_t used = 0;
    const std::int64_t value = std::stoll(text, &used, base);
    if (used == text.size()) return value;
  } catch (const std::exception&) {
  }
  words.fail(text.empty() ? "a value is missing" : "\"" + text + "\" is no number");
  return 0;
}

void read_event(Words& words, const std::string& time, Sequence& sequence) {
  Event event;
  event.tick = read_time(words, time);
  const std::string first = words.word();
  if (first == "end") {
    sequence.end_tick = event.tick;
    return;
  }
  unsigned axis = 0;
  if (std::sscanf(first.c_str(), "a%u", &axis) != 1 || axis >= sequence.axes.size()) {
    words.fail("\"" + first + "\" is none of the axes; the first is a0");
    return;
  }
  event.axis = static_cast<std::uint8_t>(axis);
  const std::string kind = words.word();
  const auto found = std::find(kind_names.begin(), kind_names.end(), kind);
  if (found == kind_names.end()) {
    words.fail("there is no event \"" + kind + "\"");
    return;
  }
  event.kind = static_cast<Kind>(found - kind_names.begin());
  if (has_object(event.kind)) read_object(words, event);
  if (event.kind == Kind::inject) {
    const std::string name = words.word();
    if (const auto injection = plant::injection_from_name(name)) {
      event.count = static_cast<std::int64_t>(*injection);
    } else {
      words.fail("there is no injection \"" + name + "\"");
    }
  }
  if (event.kind == Kind::input) event.count = words.number();
  if (event.kind != Kind::enable) event.value = read_value(words);
  if (event.kind == Kind::stream || event.kind == Kind::cycle) event.count = words.number();
  if (event.kind == Kind::stream) event.gap = words.number();
  if (event.kind == Kind::write || event.kind == Kind::write_here) {
    const std::string via = words.word();
    const auto way = std::find(via_names.begin(), via_names.end(), via);
    if (way == via_names.end()) {
      words.fail("a write goes by sdo, pdo or direct, not by \"" + via + "\"");
      return;
    }
    event.via = static_cast<Via>(way - via_names.begin());
  }
  sequence.events.push_back(event);
}

}  // namespace

const char* name_of(Kind kind) { return kind_names[static_cast<std::size_t>(kind)]; }

std::string to_text(const Event& event) {
  std::string text = fmt::format("{:>10} a{} {}", time_text(event.tick), event.axis, name_of(event.kind));
  if (has_object(event.kind)) {
    text +=
        event.sub == 0 ? fmt::format(" {:04X}", event.index) : fmt::format(" {:04X}:{:02X}", event.index, event.sub);
  }
  if (event.kind == Kind::inject)
    text += fmt::format(" {}", plant::name_of(static_cast<plant::Injection>(event.count)));
  if (event.kind == Kind::input) text += fmt::format(" {}", event.count);
  if (event.kind != Kind::enable) {
    text += event.index == 0x6040 && event.value >= 0 ? fmt::format(" 0x{:02X}", event.value)
                                                      : fmt::format(" {}", event.value);
  }
  if (event.kind == Kind::stream || event.kind == Kind::cycle) text += fmt::format(" {}", event.count);
  if (event.kind == Kind::stream) text += fmt::format(" {}", event.gap);
  if (event.kind == Kind::write || event.kind == Kind::write_here) {
    text += fmt::format(" {}", via_names[static_cast<std::size_t>(event.via)]);
  }
  return text;
}

std::string to_text(const Sequence& sequence) {
  std::string text;
  for (const AxisSetup& axis : sequence.axes) {
    text += "axis " + axis.product;
    if (!axis.model.empty()) text += " model " + axis.model;
    if (axis.start_counts != 0) text += fmt::format(" start {}", axis.start_counts);
    if (axis.inertia_percent != 100) text += fmt::format(" inertia {}", axis.inertia_percent);
    if (axis.friction_percent != 100) text += fmt::format(" friction {}", axis.friction_percent);
    if (axis.travel_counts != 0) text += fmt::format(" travel {}", axis.travel_counts);
    if (axis.stop_counts != 0) text += fmt::format(" stops {}", axis.stop_counts);
    text += "\n";
  }
  text += fmt::format("line cycle {} sync {} mapped {}\n", sequence.cycle_us, sequence.sync ? 1 : 0,
                      sequence.mapped ? 1 : 0);
  for (const Event& event : sequence.events) text += to_text(event) + "\n";
  text += fmt::format("{:>10} end\n", time_text(sequence.end_tick));
  return text;
}

ParsedSequence parse_sequence(std::string_view text) {
  ParsedSequence parsed;
  std::istringstream lines{std::string(text)};
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    line = line.substr(0, line.find('#'));
    Words words(line);
    const std::string first = words.word();
    if (first.empty()) continue;
    if (first == "axis") {
      read_axis(words, parsed.sequence);
    } else if (first == "line") {
      read_line(words, parsed.sequence);
    } else {
      read_event(words, first, parsed.sequence);
    }
    if (const std::string more = words.word(); words.error().empty() && !more.empty())
      words.fail("\"" + more + "\" is too much");
    if (!words.error().empty()) {
      parsed.error = fmt::format("{}: {}", number, words.error());
      return parsed;
    }
  }
  if (parsed.sequence.axes.empty()) parsed.error = "1: there is no axis; the first line is: axis PRODUCT";
  std::stable_sort(parsed.sequence.events.begin(), parsed.sequence.events.end(),
                   [](const Event& a, const Event& b) { return a.tick < b.tick; });
  if (parsed.sequence.end_tick == 0 && !parsed.sequence.events.empty()) {
    parsed.sequence.end_tick = parsed.sequence.events.back().tick + 500 * ticks_per_ms;
  }
  return parsed;
}

}  // namespace servodrome::motion
