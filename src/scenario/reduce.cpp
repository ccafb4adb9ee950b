#include "scenario/reduce.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <string_view>

#include "line/toml_text.hpp"
#include "scenario/document.hpp"

namespace servodrome::scenario {
namespace {

// Keys of a rule that a reduction may remove.
constexpr std::array<std::string_view, 8> droppable{"chance",   "every",     "skip", "again",
                                                    "every_ms", "jitter_ms", "when", "checksum"};
// Numbers that are halved, and the least one that is tried. duration_s is not among them: it is the trial's own limit,
// and a shorter one makes a master fail that is only slow.
struct Halved {
  std::string_view key;
  double least;
};
constexpr std::array<Halved, 6> halved{
    {{"times", 1}, {"copies", 1}, {"for_ms", 1}, {"ms", 1}, {"gap_ms", 0.1}, {"late_ms", 1}}};

// A copy of a table loses the order of its keys, so the text is read again for each change.
template <typename Edit>
std::string changed(const std::string& text, Edit edit) {
  toml::table document = table_of(text);
  edit(document);
  return text_of(document);
}

std::string name_of(const toml::table& rule) {
  const auto name = rule["name"].value<std::string_view>();
  return name ? line::toml_quoted(*name) : "without a name";
}

class Reducer {
 public:
  explicit Reducer(const std::string& text) : text_(text), document_(table_of(text)) {}

  std::vector<Reduction> all(const std::string& kept) {
    without_other_expectations(kept);
    const std::vector<toml::table*> rules = tables_at(document_, "rule");
    for (std::size_t i = 0; i < rules.size() && rules.size() > 1; ++i) {
      add(fmt::format("without the rule {}", name_of(*rules[i])), [i](toml::table& document) {
        toml::array& all = *document["rule"].as_array();
        all.erase(all.begin() + static_cast<std::ptrdiff_t>(i));
      });
    }
    for (std::size_t i = 0; i < rules.size(); ++i) {
      reduce(i, *rules[i]);
      shorten(i, *rules[i]);
    }
    return std::move(found_);
  }

 private:
  template <typename Edit>
  void add(const std::string& what, Edit edit) {
    found_.push_back({what, changed(text_, edit)});
  }

  // `edit` gets the rule number `place`.
  template <typename Edit>
  void add(std::size_t place, const std::string& what, Edit edit) {
    add(fmt::format("the rule {} {}", name_of(*tables_at(document_, "rule")[place]), what),
        [&](toml::table& document) { edit(*tables_at(document, "rule")[place]); });
  }

  void without_other_expectations(const std::string& kept) {
    const auto is_other = [&kept](const toml::node& node) {
      const toml::table* expectation = node.as_table();
      return expectation != nullptr && (*expectation)["name"].value<std::string_view>() != kept;
    };
    const toml::array* expectations = document_["expect"].as_array();
    if (expectations == nullptr || std::none_of(expectations->begin(), expectations->end(), is_other)) return;
    add("without the other expectations", [&is_other](toml::table& document) {
      toml::array& all = *document["expect"].as_array();
      for (std::size_t i = all.size(); i-- > 0;) {
        if (is_other(all[i])) all.erase(all.begin() + static_cast<std::ptrdiff_t>(i));
      }
      if (all.empty()) document.erase("expect");
    });
  }

  void reduce(std::size_t place, const toml::table& rule) {
    for (const std::string_view key : keys_in_order(rule)) {
      if (std::find(droppable.begin(), droppable.end(), key) == droppable.end()) continue;
      add(place, fmt::format("without {}", key), [key](toml::table& changing) { changing.erase(key); });
      const toml::table* conditions = rule["when"].as_table();
      if (key != "when" || conditions == nullptr || conditions->size() < 2) continue;
      for (const std::string_view part : keys_in_order(*conditions)) {
        add(place, fmt::format("without when.{}", part),
            [part](toml::table& changing) { changing["when"].as_table()->erase(part); });
      }
    }
    if (rule.contains("times") || !rule.contains("on")) return;
    add(place, "with times = 1", [](toml::table& changing) { changing.insert_or_assign("times", 1); });
  }

  void shorten(std::size_t place, const toml::table& rule) {
    for (const std::string_view key : keys_in_order(rule)) {
      const auto one = std::find_if(halved.begin(), halved.end(), [key](const Halved& its) { return its.key == key; });
      if (one == halved.end()) continue;
      const auto number = rule[key].value<double>();
      if (!number || *number <= one->least) continue;
      const bool whole = rule[key].is_integer() && one->least >= 1.0;
      const double half = whole ? std::floor(*number / 2) : *number / 2;
      for (const double smaller : {one->least, std::max(half, one->least)}) {
        add(place, fmt::format("with {} = {:g}", key, smaller), [&](toml::table& changing) {
          if (whole) {
            *changing[key].as_integer() = std::llround(smaller);
          } else {
            changing.insert_or_assign(key, smaller);
          }
        });
        if (smaller >= half) break;
      }
    }
  }

  std::string text_;
  toml::table document_;
  std::vector<Reduction> found_;
};

}  // namespace

std::string with_names(const std::string& text) {
  return changed(text, [](toml::table& document) {
    unsigned number = 0;
    for (toml::table* rule : tables_at(document, "rule")) rule->insert("name", fmt::format("rule {}", ++number));
  });
}

std::string with_line(const std::string& text, const std::string& line) {
  return changed(text, [&line](toml::table& document) { document.insert_or_assign("line", line); });
}

std::string with_seed(const std::string& text, std::uint64_t seed) {
  return changed(text, [seed](toml::table& document) { document.insert("seed", static_cast<std::int64_t>(seed)); });
}

std::vector<Reduction> reductions(const std::string& text, const std::string& kept) { return Reducer(text).all(kept); }

}  // namespace servodrome::scenario
