#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "drive/power/power_state.hpp"
#include "master/error.hpp"
#include "tools/script/grammar.hpp"
#include "tools/script/words.hpp"

namespace servodrome::master::script {
namespace {

constexpr double default_timeout_s = 60.0;
constexpr unsigned most_repeats = 1'000'000;

template <typename Rows>
std::string list_of(const Rows& rows) {
  std::string list;
  for (const auto& row : rows) {
    std::string_view word;
    if constexpr (requires { row.word; }) {
      word = row.word;
    } else if constexpr (requires { row.keyword; }) {
      word = row.keyword;
    } else {
      word = row;
    }
    if (!word.empty()) list += fmt::format("{}{}", list.empty() ? "" : ", ", word);
  }
  return list;
}

template <typename Rows>
const auto* find_word(const Rows& rows, std::string_view word) {
  const auto found = std::find_if(rows.begin(), rows.end(), [word](const auto& row) { return row.word == word; });
  return found != rows.end() ? &*found : nullptr;
}

class Parser {
 public:
  Parser(const std::string& file, const ObjectCatalogue& catalogue, const CatalogueOf& catalogue_of)
      : catalogue_(catalogue), catalogue_of_(catalogue_of) {
    script_.file = file;
    open_.push_back(&script_.steps);
  }

  Script parse(std::string_view text) {
    for (unsigned number = 1; !text.empty(); ++number) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      line_ = number;
      try {
        read_line(text.substr(0, end));
      } catch (const LineMistake& mistake) {
        mistakes_.push_back({{line_, mistake.column}, mistake.message});
      }
      text.remove_prefix(std::min(end + 1, text.size()));
    }
    for (const Place& place : repeats_) mistakes_.push_back({place, "this `repeat` has no `end`"});
    if (script_.axes.empty()) script_.axes.push_back({});
    if (!mistakes_.empty()) {
      std::sort(mistakes_.begin(), mistakes_.end(),
                [](const Mistake& a, const Mistake& b) { return a.place.line < b.place.line; });
      throw ScriptMistakes(script_.file, mistakes_);
    }
    return std::move(script_);
  }

 private:
  // Returns the next word. If it is missing, the error position is the end of the last word.
  const Word& take(const char* what) {
    if (next_ == words_.size()) {
      const Word& last = words_.back();
      throw LineMistake{static_cast<unsigned>(last.column + last.text.size() + (last.quoted ? 2 : 0)),
                        fmt::format("here {} is missing", what)};
    }
    return words_[next_++];
  }
  bool at_end() const { return next_ == words_.size(); }
  void expect_end() const {
    if (!at_end())
      throw LineMistake{words_[next_].column, fmt::format("unexpected word \"{}\"", shown(words_[next_].text))};
  }

  void read_line(std::string_view line) {
    std::size_t end = 0;
    words_ = words_of(line, end);
    next_ = 0;
    if (words_.empty()) return;
    const Word& first = take("a command");
    if (first.text == "axis") return read_axis();
    if (first.text == "use") {
      selected_ = axis_named(take("the name of an axis"));
      return expect_end();
    }
    if (first.text == "units") return read_units();
    if (first.text == "timeout") {
      timeout_s_ = seconds(take("a time in seconds"));
      return expect_end();
    }
    if (first.text == "end") return read_end(first);
    read_step(first, trimmed(line.substr(0, end)));
  }

  void read_axis() {
    const Word& name = take("a name");
    const auto is_it = [&](const AxisDeclaration& axis) { return axis.name == name.text; };
    if (!script_.steps.empty() || open_.size() > 1) {
      throw LineMistake{1, "axes are declared before the first command"};
    }
    if (std::any_of(script_.axes.begin(), script_.axes.end(), is_it)) {
      throw LineMistake{name.column, fmt::format("there is an axis \"{}\" already", shown(name.text))};
    }
    if (find_word(verbs, name.text) != nullptr ||
        std::find(other_words.begin(), other_words.end(), name.text) != other_words.end() || name.text.empty()) {
      throw LineMistake{name.column, fmt::format("\"{}\" is a command, and no name for an axis", shown(name.text))};
    }
    AxisDeclaration axis{.name = name.text, .place = {line_, name.column}};
    const Word& node = take("a node-ID, station or position");
    axis.node = whole(node, "a node-ID, station or position", 1, 65535);
    const auto same = [&](const AxisDeclaration& other) { return other.node == axis.node; };
    if (std::any_of(script_.axes.begin(), script_.axes.end(), same)) {
      throw LineMistake{node.column, fmt::format("another axis is node {} already", axis.node)};
    }
    if (!at_end()) {
      const Word& product = take("");
      if (product.text != "product") {
        throw LineMistake{product.column, fmt::format("\"{}\" is not known here; write `product NAME` or nothing",
                                                      shown(product.text))};
      }
      const Word& name_of_product = take("the name of a product");
      axis.product = name_of_product.text;
      if (catalogue_of_ && catalogue_of_(axis.product) == nullptr) {
        throw LineMistake{name_of_product.column, fmt::format("there is no product \"{}\"; `servodrome products` "
                                                              "lists them",
                                                              shown(axis.product))};
      }
    }
    expect_end();
    script_.axes.push_back(std::move(axis));
  }

  // `drive`, `counts`, `revolutions`, `rpm` or `degrees`, then optionally the number of units in a revolution; `mm`
  // needs the feed in a revolution before that.
  void read_units() {
    const Word& word = take("what units");
    const auto system = unit_system_named(word.text);
    if (!system) {
      throw LineMistake{word.column,
                        fmt::format("units \"{}\" are not known; write {}", shown(word.text), list_of_unit_systems())};
    }
    UnitChoice units{.system = *system};
    const auto positive = [this](const char* what, const char* refusal, double least, double most) {
      const Word& number = take(what);
      const double value = number_in(number, what);
      if (value < least || value > most) throw LineMistake{number.column, refusal};
      return value;
    };
    if (*system == UnitSystem::millimetres) {
      units.feed_mm = positive("the feed per motor revolution in mm",
                               "the feed per revolution must be 0.000001 to 1e6 mm", 1e-6, 1e6);
    }
    const bool of_revolution = *system != UnitSystem::drive && *system != UnitSystem::counts;
    if (of_revolution && !at_end()) {
      units.units_per_revolution =
          positive("the units of the drive per revolution", "the units per revolution must be 0.001 to 1e9", 1e-3, 1e9);
    }
    expect_end();
    units_ = units;
  }

  void read_end(const Word& word) {
    if (repeats_.empty()) throw LineMistake{word.column, "this `end` has no `repeat`"};
    expect_end();
    repeats_.pop_back();
    open_.pop_back();
  }

  std::size_t axis_named(const Word& name) const {
    for (std::size_t i = 0; i < script_.axes.size(); ++i) {
      if (script_.axes[i].name == name.text) return i;
    }
    throw LineMistake{name.column, fmt::format("there is no axis \"{}\"; declare it with `axis {} NODE`",
                                               shown(name.text), shown(name.text))};
  }
  bool names_axis(const Word& word) const {
    return std::any_of(script_.axes.begin(), script_.axes.end(),
                       [&](const AxisDeclaration& axis) { return axis.name == word.text; });
  }

  void read_step(const Word& first, std::string_view source) {
    Step step{.place = {line_, first.column}, .source = std::string(source), .units = units_};
    step.axis = selected_;
    const Word* word = &first;
    bool axis_given = false;
    if (names_axis(first)) {
      step.axis = axis_named(first);
      axis_given = true;
      word = &take("a command");
    }
    const VerbRow* const row = find_word(verbs, word->text);
    if (row == nullptr) {
      throw LineMistake{word->column, fmt::format("\"{}\" is neither a command nor an axis; commands are {}, {}",
                                                  shown(word->text), list_of(verbs), list_of(other_words))};
    }
    if (axis_given && !row->of_axis) {
      throw LineMistake{word->column, fmt::format("`{}` cannot have an axis before it", row->word)};
    }
    step.verb = row->verb;
    const bool waits = row->word == "wait-until";
    step.timeout_s = row->verb == Verb::expect && !waits ? 0.0 : timeout_s_;
    try {
      switch (row->verb) {
        case Verb::set: read_subject(step, false), read_value(step); break;
        case Verb::get: read_subject(step, true); break;
        case Verb::expect: read_subject(step, true), read_comparison(step); break;
        case Verb::print: step.text = take("a text").text; break;
        case Verb::repeat: step.count = whole(take("a number of times"), "a number of times", 1, most_repeats); break;
        default: break;
      }
      read_arguments(step, *row);
      check(step, *word);
    } catch (const LineMistake&) {
      // Opens the body in spite of the error, so that its `end` does not cause a second error.
      if (row->verb == Verb::repeat) open_repeat({}, *word);
      throw;
    }
    if (row->verb == Verb::repeat) {
      open_repeat(std::move(step), *word);
    } else {
      open_.back()->push_back(std::move(step));
    }
  }

  void open_repeat(Step step, const Word& word) {
    open_.back()->push_back(std::move(step));
    repeats_.push_back({line_, word.column});
    open_.push_back(&open_.back()->back().body);
  }

  void read_arguments(Step& step, const VerbRow& row) {
    const auto positional =
        std::find_if(row.arguments.begin(), row.arguments.end(), [](const Argument& a) { return a.keyword.empty(); });
    if (positional != row.arguments.end()) {
      const bool is_number = !at_end() && !words_[next_].text.empty() &&
                             std::string_view("+-.0123456789").find(words_[next_].text[0]) != std::string_view::npos;
      if (positional->required || is_number) step.numbers[""] = argument_value(*positional, take("a number"));
    }
    while (!at_end()) {
      const Word& word = take("");
      if (std::find(row.flags.begin(), row.flags.end(), word.text) != row.flags.end()) {
        step.flags.push_back(word.text);
        continue;
      }
      const auto found = std::find_if(row.arguments.begin(), row.arguments.end(), [&](const Argument& argument) {
        return !argument.keyword.empty() && argument.keyword == word.text;
      });
      if (found == row.arguments.end()) {
        const std::string keywords = list_of(row.arguments);
        const std::string flags = list_of(row.flags);
        const bool both = !keywords.empty() && !flags.empty();
        throw LineMistake{word.column, keywords.empty() && flags.empty()
                                           ? fmt::format("unexpected word \"{}\"", shown(word.text))
                                           : fmt::format("`{}` does not know \"{}\"; it knows {}{}{}", row.word,
                                                         shown(word.text), keywords, both ? ", " : "", flags)};
      }
      if (step.numbers.contains(word.text)) {
        throw LineMistake{word.column, fmt::format("`{}` is given twice", found->keyword)};
      }
      const double value = argument_value(*found, take("a number"));
      step.numbers[word.text] = value;
      if (found->keyword == "within") step.timeout_s = value;
    }
    for (const Argument& argument : row.arguments) {
      if (argument.required && !step.numbers.contains(argument.keyword))
        take(fmt::format("`{}`", argument.keyword).c_str());
    }
  }

  double argument_value(const Argument& argument, const Word& word) const {
    if (argument.quantity == Quantity::seconds) return seconds(word);
    const double value = number_in(word, "a number");
    const bool never_negative = argument.quantity == Quantity::acceleration || argument.keyword == "tolerance" ||
                                argument.keyword == "slope" ||
                                (argument.quantity == Quantity::velocity && !argument.keyword.empty());
    if (never_negative && value < 0) {
      throw LineMistake{word.column, fmt::format("`{}` cannot be below 0", argument.keyword)};
    }
    return value;
  }

  void read_subject(Step& step, bool may_be_axis) {
    const Word& word = take("an object");
    step.subject.word = word.text;
    if (const SubjectRow* const row = word.quoted ? nullptr : find_word(subjects, word.text)) {
      if (!may_be_axis) throw LineMistake{word.column, fmt::format("`{}` is read-only", row->word)};
      step.subject.kind = row->kind;
      return;
    }
    try {
      step.subject.object = catalogue_for(step.axis).resolve(word.text);
    } catch (const MasterError& error) {
      throw LineMistake{word.column, fmt::format("{}; {}", error.happened(), error.remedy())};
    }
    const NamedObject* const known = catalogue_for(step.axis).find(step.subject.object);
    if (known != nullptr) step.subject.type = known->type;
  }

  const ObjectCatalogue& catalogue_for(std::size_t axis) const {
    if (axis >= script_.axes.size() || script_.axes[axis].product.empty() || !catalogue_of_) return catalogue_;
    const ObjectCatalogue* const own = catalogue_of_(script_.axes[axis].product);
    return own != nullptr ? *own : catalogue_;
  }

  void read_value(Step& step) {
    const Word& word = take("a value");
    step.text = word.text;
    if (step.subject.kind == Subject::Kind::state) return check_state(word);
    if (step.subject.kind != Subject::Kind::object) {
      step.numbers["value"] = number_in(word, "a number");
      return;
    }
    if (!step.subject.type) return;
    try {
      parse_value(word.text, *step.subject.type);
    } catch (const MasterError& error) {
      throw LineMistake{word.column, fmt::format("{}; {}", error.happened(), error.remedy())};
    }
  }

  static void check_state(const Word& word) {
    std::string list;
    for (unsigned i = 0; i <= static_cast<unsigned>(drive::PowerState::fault); ++i) {
      const std::string name = drive::name(static_cast<drive::PowerState>(i));
      if (name == word.text) return;
      list += fmt::format("{}\"{}\"", list.empty() ? "" : ", ", name);
    }
    throw LineMistake{word.column, fmt::format("\"{}\" is not a state; states are {}", shown(word.text), list)};
  }

  void read_comparison(Step& step) {
    const Word& word = take("a comparison");
    const ComparisonRow* const row = find_word(comparisons, word.text);
    if (row == nullptr) {
      throw LineMistake{word.column,
                        fmt::format("\"{}\" is not a comparison; they are {}", shown(word.text), list_of(comparisons))};
    }
    step.comparison = row->comparison;
    const bool by_name = step.subject.kind == Subject::Kind::state;
    const bool of_bits = row->comparison == Comparison::has_bits || row->comparison == Comparison::lacks_bits;
    if (by_name && row->comparison != Comparison::equal && row->comparison != Comparison::not_equal) {
      throw LineMistake{word.column, "a state is == or != another"};
    }
    if (of_bits && step.subject.kind != Subject::Kind::object) {
      throw LineMistake{word.column, fmt::format("`{}` is for the bits of an object", row->word)};
    }
    read_value(step);
  }

  void check(const Step& step, const Word& word) const {
    if (step.verb == Verb::move && step.numbers.contains("to") == step.numbers.contains("by")) {
      throw LineMistake{word.column, "`move` needs either `to POSITION` or `by DISTANCE`"};
    }
    const auto probe = step.number("");
    if ((step.verb == Verb::arm_probe || step.verb == Verb::wait_probe) && probe && *probe != 1 && *probe != 2) {
      throw LineMistake{word.column, "there are touch probes 1 and 2"};
    }
    if (const auto method = step.number("method");
        method && (*method != std::floor(*method) || *method < -128 || *method > 127)) {
      throw LineMistake{word.column, "a homing method is a whole number from -128 to 127"};
    }
  }

  const ObjectCatalogue& catalogue_;
  const CatalogueOf& catalogue_of_;
  Script script_;
  std::vector<std::vector<Step>*> open_;  // where steps are added: the script, then the bodies of the open repeats
  std::vector<Place> repeats_;
  std::vector<Mistake> mistakes_;
  std::vector<Word> words_;
  std::size_t next_ = 0;
  unsigned line_ = 0;
  std::size_t selected_ = 0;
  UnitChoice units_;
  double timeout_s_ = default_timeout_s;
};

}  // namespace

Script parse(std::string_view text, const std::string& file, const ObjectCatalogue& catalogue,
             const CatalogueOf& catalogue_of) {
  return Parser(file, catalogue, catalogue_of).parse(text);
}

}  // namespace servodrome::master::script
