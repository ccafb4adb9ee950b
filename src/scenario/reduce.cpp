#include "scenario/reduce.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <optional>
#include <string_view>

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

// The lines from a heading ("[[rule]]") up to the next one. The first block has none.
struct Block {
  std::vector<std::string> lines;

  bool is(std::string_view heading) const { return !lines.empty() && lines.front().starts_with(heading); }
};

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

std::string_view key_of(std::string_view line) {
  const std::size_t equals = line.find('=');
  return equals == std::string_view::npos ? std::string_view() : trimmed(line.substr(0, equals));
}

std::string_view value_of(std::string_view line) { return trimmed(line.substr(line.find('=') + 1)); }

std::vector<Block> blocks_of(std::string_view text) {
  std::vector<Block> blocks(1);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.starts_with('[')) blocks.emplace_back();
    blocks.back().lines.emplace_back(line);
  }
  return blocks;
}

std::string text_of(const std::vector<Block>& blocks) {
  std::string text;
  for (const Block& block : blocks) {
    for (const std::string& line : block.lines) text += line + "\n";
  }
  return text;
}

std::string name_of(const Block& block) {
  for (const std::string& line : block.lines) {
    if (key_of(line) == "name") return std::string(value_of(line));
  }
  return "without a name";
}

// The parts of an inline table, "{ a = 1, b = { c = 2 } }", at its own level.
std::vector<std::string> parts_of(std::string_view table) {
  std::vector<std::string> parts;
  if (table.size() < 2 || table.front() != '{' || table.back() != '}') return parts;
  std::string part;
  int depth = 0;
  bool quoted = false;
  for (const char c : table.substr(1, table.size() - 2)) {
    if (c == '"') quoted = !quoted;
    if (!quoted && (c == '{' || c == '[')) ++depth;
    if (!quoted && (c == '}' || c == ']')) --depth;
    if (c == ',' && depth == 0 && !quoted) {
      parts.emplace_back(trimmed(part));
      part.clear();
    } else {
      part += c;
    }
  }
  if (!trimmed(part).empty()) parts.emplace_back(trimmed(part));
  return parts;
}

std::optional<double> number_in(std::string_view line) {
  const std::string value(value_of(line));
  char* end = nullptr;
  const double number = std::strtod(value.c_str(), &end);
  const bool is_number = end != value.c_str() && (*end == '\0' || *end == ' ' || *end == '#');
  return is_number ? std::optional(number) : std::nullopt;
}

class Reducer {
 public:
  explicit Reducer(const std::string& text) : blocks_(blocks_of(text)) {}

  std::vector<Reduction> all(const std::string& kept) {
    without_other_expectations(kept);
    const auto rules =
        std::count_if(blocks_.begin(), blocks_.end(), [](const Block& one) { return one.is("[[rule]]"); });
    for (std::size_t i = 0; i < blocks_.size() && rules > 1; ++i) {
      if (!blocks_[i].is("[[rule]]")) continue;
      std::vector<Block> fewer = blocks_;
      fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(i));
      add(fmt::format("without the rule {}", name_of(blocks_[i])), fewer);
    }
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      if (blocks_[i].is("[[rule]]")) reduce_rule(i);
      if (i == 0 || blocks_[i].is("[[rule]]")) shorten(i);
    }
    return std::move(found_);
  }

 private:
  void add(const std::string& what, const std::vector<Block>& blocks) { found_.push_back({what, text_of(blocks)}); }

  void without_other_expectations(const std::string& kept) {
    std::vector<Block> fewer = blocks_;
    const auto erased = std::erase_if(fewer, [&kept](const Block& block) {
      return block.is("[[expect]]") && name_of(block) != fmt::format("\"{}\"", kept);
    });
    if (erased > 0) add("without the other expectations", fewer);
  }

  void replace(std::size_t block, std::size_t line, const std::string& what, std::optional<std::string> by) {
    std::vector<Block> changed = blocks_;
    auto& lines = changed[block].lines;
    if (by) {
      lines[line] = *by;
    } else {
      lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(line));
    }
    const std::string of = block == 0 ? "" : fmt::format("the rule {} ", name_of(blocks_[block]));
    add(of + what, changed);
  }

  void reduce_rule(std::size_t block) {
    bool has_times = false;
    bool has_messages = false;
    for (std::size_t i = 0; i < blocks_[block].lines.size(); ++i) {
      const std::string& line = blocks_[block].lines[i];
      const std::string key(key_of(line));
      has_times = has_times || key == "times";
      has_messages = has_messages || key == "on";
      if (std::find(droppable.begin(), droppable.end(), key) != droppable.end()) {
        replace(block, i, "without " + key, std::nullopt);
      }
      if (key != "when") continue;
      const std::vector<std::string> parts = parts_of(value_of(line));
      for (std::size_t n = 0; n < parts.size() && parts.size() > 1; ++n) {
        std::vector<std::string> fewer = parts;
        fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(n));
        replace(block, i, "without when." + std::string(key_of(parts[n])),
                fmt::format("when = {{ {} }}", fmt::join(fewer, ", ")));
      }
    }
    if (has_times || !has_messages) return;
    std::vector<Block> changed = blocks_;
    auto& lines = changed[block].lines;
    lines.insert(lines.begin() + 1, "times = 1");
    add(fmt::format("the rule {} with times = 1", name_of(blocks_[block])), changed);
  }

  void shorten(std::size_t block) {
    for (std::size_t i = 0; i < blocks_[block].lines.size(); ++i) {
      const std::string& line = blocks_[block].lines[i];
      const auto one =
          std::find_if(halved.begin(), halved.end(), [&](const Halved& h) { return h.key == key_of(line); });
      if (one == halved.end()) continue;
      const auto number = number_in(line);
      if (!number || *number <= one->least) continue;
      const bool whole = line.find('.') == std::string::npos;
      const double half = whole ? std::floor(*number / 2) : *number / 2;
      for (const double smaller : {one->least, std::max(half, one->least)}) {
        const std::string by = fmt::format("{} = {:g}", one->key, smaller);
        replace(block, i, "with " + by, by);
        if (smaller >= half) break;
      }
    }
  }

  std::vector<Block> blocks_;
  std::vector<Reduction> found_;
};

}  // namespace

std::string with_names(const std::string& text) {
  std::vector<Block> blocks = blocks_of(text);
  unsigned number = 0;
  for (Block& block : blocks) {
    if (!block.is("[[rule]]")) continue;
    ++number;
    const bool has_name =
        std::any_of(block.lines.begin(), block.lines.end(), [](const auto& line) { return key_of(line) == "name"; });
    if (!has_name) block.lines.insert(block.lines.begin() + 1, fmt::format("name = \"rule {}\"", number));
  }
  return text_of(blocks);
}

std::vector<Reduction> reductions(const std::string& text, const std::string& kept) { return Reducer(text).all(kept); }

}  // namespace servodrome::scenario
