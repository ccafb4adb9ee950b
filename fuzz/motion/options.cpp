#include "options.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <sstream>

#include "watch.hpp"

namespace servodrome::motion {
namespace {

constexpr const char* help = R"(motion_fuzz [OPTION ...]

Draws sequences of what masters and benches do to drives, carries them out in virtual time and checks after every tick
what must hold whatever was done. What fails is shrunk to a short sequence and printed.

  --sequences N     so many (10000 if nothing is said)
  --seconds N       or as many as fit into so many seconds
  --seed N          of the run (1)
  --first N         number of the first sequence (0); with --forks the run begins with the first one of its tree
  --forks N         the last N steps (at most 3) of each beginning are drawn 4 ways each: the beginning is carried out once
                    for 4^N sequences (0). It belongs to a sequence's number as the seed does
  --product NAME    this product alone; --model NAME its size
  --jobs N          processes (1)
  --sequence N      that one of the seed alone, told tick by tick; --print: only its text
  --replay FILE ... carries out the sequences in these files; with --story told by state
  --each N          ... and every N ms (10)
  --only NAME       only this invariant counts
  --without NAME    this invariant does not count; may be given more than once
  --known FILE      lines "INVARIANT PRODUCT reason": counted, and no failure
  --keep FOLDER     what was found is written there, one file each
  --until-found     ends with the first finding
  --no-shrink       what was found is printed as it was drawn
  --coverage        prints which events met which states in which modes
  --invariants      lists what is checked
  --json            the result as one JSON document
  --help

Ctrl-C or SIGTERM ends the run early. It prints the findings so far, and the number to continue with (--first).

Exit status: 0 nothing found, 1 something found, 2 wrong usage.
)";

std::uint64_t number(const char* option, const char* text) {
  char* end = nullptr;
  const std::uint64_t value = std::strtoull(text, &end, 10);
  if (*text == '\0' || *end != '\0' || *text == '-')
    wrong_usage(fmt::format("{} takes a number, not \"{}\"", option, text));
  return value;
}

void read_known(const std::string& path, std::set<std::string>& known) {
  std::ifstream file(path);
  if (!file) wrong_usage(fmt::format("cannot read {}", path));
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string invariant;
    std::string product;
    if (words >> invariant >> product) known.insert(invariant + " " + product);
  }
}

}  // namespace

void wrong_usage(const std::string& what) {
  std::fprintf(stderr, "motion_fuzz: %s\nTry motion_fuzz --help.\n", what.c_str());
  std::exit(2);
}

Options parse_options(int argc, char** argv) {
  Options options;
  bool until = false;
  for (int i = 1; i < argc; ++i) {
    const std::string option = argv[i];
    const auto value = [&] {
      if (i + 1 >= argc) wrong_usage(option + " needs a value");
      return argv[++i];
    };
    if (option == "--help") {
      std::fputs(help, stdout);
      std::exit(0);
    } else if (option == "--invariants") {
      for (const InvariantRow& row : invariants()) std::printf("%-26s %s\n", row.name, row.meaning);
      std::exit(0);
    } else if (option == "--sequences") {
      options.sequences = number("--sequences", value());
      until = true;
    } else if (option == "--seconds") {
      options.seconds = static_cast<double>(number("--seconds", value()));
    } else if (option == "--seed") {
      options.seed = number("--seed", value());
    } else if (option == "--first") {
      options.first = number("--first", value());
    } else if (option == "--forks") {
      options.tree.levels = static_cast<unsigned>(std::min<std::uint64_t>(number("--forks", value()), 3));
    } else if (option == "--product") {
      options.product = value();
    } else if (option == "--model") {
      options.model = value();
    } else if (option == "--jobs") {
      options.jobs = static_cast<int>(std::clamp<std::uint64_t>(number("--jobs", value()), 1, 256));
    } else if (option == "--sequence") {
      options.one = number("--sequence", value());
    } else if (option == "--print") {
      options.print = true;
    } else if (option == "--story") {
      options.story = true;
    } else if (option == "--each") {
      options.each_ms = std::max<std::int64_t>(1, static_cast<std::int64_t>(number("--each", value())));
    } else if (option == "--replay") {
      while (i + 1 < argc && std::strncmp(argv[i + 1], "--", 2) != 0) options.replays.emplace_back(argv[++i]);
      if (options.replays.empty()) wrong_usage("--replay needs a file");
    } else if (option == "--only") {
      options.only = value();
    } else if (option == "--without") {
      options.without.insert(value());
    } else if (option == "--known") {
      read_known(value(), options.known);
    } else if (option == "--keep") {
      options.keep = value();
    } else if (option == "--until-found") {
      options.until_found = true;
    } else if (option == "--no-shrink") {
      options.shrinks = false;
    } else if (option == "--coverage") {
      options.coverage = true;
    } else if (option == "--json") {
      options.json = true;
    } else {
      wrong_usage(fmt::format("there is no option {}", option));
    }
  }
  if (const std::uint64_t first = options.tree.first_leaf(options.first); first != options.first) {
    std::fprintf(stderr,
                 "motion_fuzz: begins with %llu, the first of the %llu sequences that share a beginning with %llu\n",
                 static_cast<unsigned long long>(first), static_cast<unsigned long long>(options.tree.leaves()),
                 static_cast<unsigned long long>(options.first));
    options.first = first;
  }
  if (options.seconds > 0 && !until) options.sequences = std::uint64_t{1} << 62;
  return options;
}

}  // namespace servodrome::motion
