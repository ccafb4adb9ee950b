#include "tools/script/script.hpp"

#include <fmt/format.h>
#include <utility>

#include "tools/script/grammar.hpp"

namespace servodrome::master::script {
namespace {

std::string text_of(const std::string& file, const std::vector<Mistake>& mistakes) {
  std::string text;
  for (const Mistake& mistake : mistakes) {
    text += fmt::format("{}{}:{}:{}: {}", text.empty() ? "" : "\n", file, mistake.place.line, mistake.place.column,
                        mistake.message);
  }
  return text;
}

std::size_t count(const std::vector<Step>& steps) {
  std::size_t sum = 0;
  for (const Step& step : steps) sum += 1 + count(step.body);
  return sum;
}

void note_commanded(const std::vector<Step>& steps, std::vector<bool>& axes) {
  for (const Step& step : steps) {
    if (commands_axis(step)) axes[step.axis] = true;
    note_commanded(step.body, axes);
  }
}

}  // namespace

ScriptMistakes::ScriptMistakes(const std::string& file, std::vector<Mistake> mistakes)
    : std::runtime_error(text_of(file, mistakes)), mistakes_(std::move(mistakes)) {}

std::size_t Script::count_steps() const { return count(steps); }

bool can_move(Verb verb) {
  switch (verb) {
    case Verb::disable:
    case Verb::halt:
    case Verb::resume:
    case Verb::home:
    case Verb::move:
    case Verb::arrive:
    case Verb::velocity:
    case Verb::jog:
    case Verb::torque: return true;
    default: return false;
  }
}

bool needs_axis(const Step& step) {
  switch (step.verb) {
    case Verb::set:
    case Verb::get:
    case Verb::expect: return step.subject.kind != Subject::Kind::object;
    case Verb::wait:
    case Verb::print:
    case Verb::repeat: return false;
    default: return true;
  }
}

bool commands_axis(const Step& step) {
  switch (step.verb) {
    case Verb::arm_probe:
    case Verb::wait_probe:
    case Verb::get:
    case Verb::expect:
    case Verb::wait:
    case Verb::print:
    case Verb::repeat: return false;
    default: return true;
  }
}

std::vector<bool> commanded_axes(const Script& script) {
  std::vector<bool> axes(script.axes.size(), false);
  note_commanded(script.steps, axes);
  return axes;
}

Quantity quantity_of(Verb verb, std::string_view keyword) {
  for (const VerbRow& row : verbs) {
    if (row.verb != verb) continue;
    for (const Argument& argument : row.arguments) {
      if (argument.keyword == keyword) return argument.quantity;
    }
  }
  return Quantity::plain;
}

}  // namespace servodrome::master::script
