// Runs random sequences on complete drives in virtual time and checks invariants after each tick: see README.md of this
// folder.
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "explore.hpp"
#include "machine.hpp"
#include "options.hpp"
#include "run_number.hpp"
#include "shrink.hpp"

namespace {

using namespace servodrome::motion;

// Returns a finding as the text of a case file that replays it.
std::string case_text(const Options& options, const std::pair<std::string, std::string>& group, const Found& found,
                      const std::vector<Variant>& variants) {
  Sequence sequence = draw(options.seed, found.number, variants, options.tree).sequence;
  const RunOptions run_options{.recover = recovers(found.number, options.tree)};
  const bool twice = group.first == "not-deterministic";
  if (options.shrinks) {
    sequence = shrink(sequence, [&](const Sequence& candidate) {
      const Outcome outcome = run_checked(candidate, run_options, twice);
      return outcome.finding && outcome.finding->invariant == group.first &&
             product_of(candidate, *outcome.finding) == group.second;
    });
  }
  const Outcome outcome = run_checked(sequence, run_options, twice);
  std::string text =
      fmt::format("# {} on {}: {}\n", group.first, group.second, outcome.finding ? outcome.finding->text : found.text);
  if (outcome.finding)
    text += fmt::format("# at {:.4f} ms, axis a{}; found by motion_fuzz --seed {} --sequence {}{}{}\n",
                        static_cast<double>(outcome.finding->tick) / ticks_per_ms, outcome.finding->axis, options.seed,
                        found.number, options.tree.levels == 0 ? "" : fmt::format(" --forks {}", options.tree.levels),
                        options.product.empty() ? "" : " --product " + options.product);
  if (run_options.recover) text += "# recover\n";
  return text + to_text(sequence);
}

std::string file_text(const std::string& path) {
  std::ifstream file(path);
  if (!file) wrong_usage(fmt::format("cannot read {}", path));
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

int replay(const Options& options) {
  int status = 0;
  for (const std::string& path : options.replays) {
    const std::string text = file_text(path);
    const ParsedSequence parsed = parse_sequence(text);
    if (!parsed.error.empty()) {
      std::fprintf(stderr, "motion_fuzz: %s:%s\n", path.c_str(), parsed.error.c_str());
      return 2;
    }
    Story story;
    RunOptions run_options{.story = options.story ? &story : nullptr,
                           .story_ticks = options.each_ms * ticks_per_ms,
                           .recover = text.find("# recover") != std::string::npos};
    try {
      const Outcome outcome = run_checked(parsed.sequence, run_options, true);
      std::fputs(story.c_str(), stdout);
      if (outcome.finding) {
        std::printf("%s: FAILED %s at %.4f ms, axis a%zu: %s\n", path.c_str(), outcome.finding->invariant.c_str(),
                    static_cast<double>(outcome.finding->tick) / ticks_per_ms, outcome.finding->axis,
                    outcome.finding->text.c_str());
        status = 1;
      } else {
        std::printf("%s: ok\n", path.c_str());
      }
    } catch (const std::exception& error) {
      std::fprintf(stderr, "motion_fuzz: %s: %s\n", path.c_str(), error.what());
      return 2;
    }
  }
  return status;
}

int run_one(const Options& options, const std::vector<Variant>& variants) {
  const Sequence sequence = draw(options.seed, *options.one, variants, options.tree).sequence;
  std::fputs(to_text(sequence).c_str(), stdout);
  if (options.print) return 0;
  Story story;
  const Outcome outcome =
      run_number(options, *options.one, sequence, {.story = &story, .story_ticks = options.each_ms * ticks_per_ms});
  std::fputs(story.c_str(), stdout);
  if (!outcome.finding) return 0;
  std::printf("FAILED %s at %.4f ms, axis a%zu: %s\n", outcome.finding->invariant.c_str(),
              static_cast<double>(outcome.finding->tick) / ticks_per_ms, outcome.finding->axis,
              outcome.finding->text.c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = parse_options(argc, argv);
  if (!options.replays.empty()) return replay(options);
  std::vector<Variant> list = variants(options.product);
  if (!options.model.empty()) std::erase_if(list, [&](const Variant& one) { return one.model != options.model; });
  if (list.empty()) wrong_usage(fmt::format("there is no product \"{}\" {}", options.product, options.model));
  if (options.one) return run_one(options, list);
  std::signal(SIGINT, [](int) { interrupted = 1; });
  std::signal(SIGTERM, [](int) { interrupted = 1; });
  const Result result = explore(options, list);
  int status = result.crashes.empty() ? 0 : 1;
  nlohmann::json document{{"seed", options.seed},
                          {"sequences", result.done},
                          {"next", result.next},
                          {"seconds", result.seconds},
                          {"drive_seconds", static_cast<double>(result.ticks) / 16000.0},
                          {"crashes", result.crashes}};
  document["findings"] = nlohmann::json::array();
  for (const auto& [group, found] : result.groups) {
    const bool known = options.known.contains(group.first + " " + group.second);
    if (!known) status = 1;
    const std::string text = known ? "" : case_text(options, group, found, list);
    document["findings"].push_back({{"invariant", group.first},
                                    {"product", group.second},
                                    {"count", found.count},
                                    {"sequence", found.number},
                                    {"known", known},
                                    {"text", found.text},
                                    {"case", text}});
    if (!options.keep.empty() && !known) {
      std::filesystem::create_directories(options.keep);
      std::ofstream(fmt::format("{}/{}-{}.case", options.keep, group.first, group.second)) << text;
    }
    if (!options.json)
      std::printf("%s %s on %s, %llu times, first in sequence %llu: %s\n%s\n", known ? "known" : "FOUND",
                  group.first.c_str(), group.second.c_str(), static_cast<unsigned long long>(found.count),
                  static_cast<unsigned long long>(found.number), found.text.c_str(), text.c_str());
  }
  if (options.json) {
    std::printf("%s\n", document.dump(2).c_str());
    return status;
  }
  for (const std::string& crash : result.crashes) std::printf("CRASH %s\n", crash.c_str());
  if (options.coverage) std::fputs(report(result.coverage, list).c_str(), stdout);
  if (interrupted != 0)
    std::printf("ended early: go on with --first %llu\n", static_cast<unsigned long long>(result.next));
  std::printf("%llu sequences, %.0f s of drives' time in %.1f s (%.0f sequences/s): %zu kinds of findings\n",
              static_cast<unsigned long long>(result.done), static_cast<double>(result.ticks) / 16000.0, result.seconds,
              static_cast<double>(result.done) / result.seconds, result.groups.size());
  return status;
}
