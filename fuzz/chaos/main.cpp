// Runs a line of 64 axes on three buses for hours of line time, while frames are dropped, doubled, corrupted and
// delayed, power is cut and cables are pulled: see README.md of this folder.
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>
#include <string_view>

#include "fibre.hpp"
#include "masters.hpp"
#include "mischief.hpp"

namespace {

using namespace servodrome::chaos;
using servodrome::links::Time;

constexpr const char* help = R"(chaos [OPTION ...]

Runs a line of 64 axes in virtual time: 48 on two CAN buses, 16 on an EtherCAT segment, every product and size. Our
masters move them. Of all frames 1 % are dropped, 1 % doubled, 1 % corrupted and 1 % delayed; power is cut and cables
are pulled at random. After every tick the invariants of motion_fuzz are checked for each axis. After each disturbance
the master must get the axis back into operation; at the end, without disturbances, every axis must make a move.

  --hours H          line time (0.1)
  --seed N           of everything (1); the same seed gives the same run
  --axes N           number of axes (64)
  --only-segment     all axes are on the EtherCAT segment
  --share S          of the frames, for each kind of disturbance (0.01)
  --power-every S    mean seconds between two power cuts of an axis (180)
  --cable-every S    mean seconds between two pulls of its cable (180)
  --recovery S       seconds after a disturbance, within which an axis must be in operation (60)
  --rest-stride N    of an axis at rest, checks the invariants after every Nth tick only: faster (1)
  --no-invariants    does not check the invariants: faster
  --json             the result as one JSON document
  --quiet            no progress
  --help

Ctrl-C or SIGTERM ends the disturbances early. Exit status: 0 nothing found, 1 something found, 2 wrong usage.
)";

volatile std::sig_atomic_t interrupted = 0;

constexpr int progress_s = 30;
constexpr std::int64_t quiet_s = 30;    // without disturbances, before the last moves
constexpr std::int64_t finish_s = 600;  // for the last moves

struct Master {
  Fibre* fibre = nullptr;
  std::unique_ptr<FibreClock> clock;
  std::unique_ptr<Fibre> owner;
};

// Resumes the masters every half millisecond: as often as a process in real time would poll. Each tick would cost more.
constexpr std::int64_t resume_ticks = 8;

void pass(World& world, Mischief& mischief, std::vector<Master>& masters) {
  mischief.tick();
  if (world.tick() % resume_ticks == 0) {
    for (Master& master : masters) master.owner->resume();
  }
  if (world.tick() % ticks_per_s == 0) world.look_for_overdue();
  world.pass_tick();
}

double hours_of(const World& world) { return static_cast<double>(world.tick()) / ticks_per_s / 3600.0; }

nlohmann::json report(World& world, const Mischief& mischief, double seconds) {
  const Options& options = world.options();
  Record sum;
  for (const Subject& subject : world.subjects()) {
    sum.power_cuts += subject.record.power_cuts;
    sum.cable_pulls += subject.record.cable_pulls;
    sum.recoveries += subject.record.recoveries;
    sum.moves += subject.record.moves;
    sum.longest_recovery = std::max(sum.longest_recovery, subject.record.longest_recovery);
  }
  const Mischief::Counts frames = mischief.counts();
  return {{"name", "chaos"},
          {"seed", options.seed},
          {"axes", world.subjects().size()},
          {"line_hours", hours_of(world)},
          {"interrupted", interrupted != 0},
          {"seconds", seconds},
          {"frames", frames.frames},
          {"dropped", frames.dropped},
          {"doubled", frames.doubled},
          {"corrupted", frames.corrupted},
          {"delayed", frames.delayed},
          {"power_cuts", sum.power_cuts},
          {"cable_pulls", sum.cable_pulls},
          {"recoveries", sum.recoveries},
          {"longest_recovery_s", std::chrono::duration<double>(sum.longest_recovery).count()},
          {"moves", sum.moves},
          {"segment_restarts", world.restarts},
          {"can_groups", world.groups},
          {"invariants", options.watches},
          {"rest_stride", options.rest_stride},
          {"errors_of_masters", world.errors()},
          {"finding_count", world.finding_count()},
          {"findings", world.findings()}};
}

nlohmann::json run(const Options& options, bool quiet) {
  using Clock = std::chrono::steady_clock;
  const auto began = Clock::now();
  auto told = began;
  World world(options);
  std::vector<Master> masters(can_buses + 1);
  for (std::size_t i = 0; i < masters.size(); ++i) {
    Master& master = masters[i];
    master.clock = std::make_unique<FibreClock>(world.line(), master.fibre);
    master.owner = std::make_unique<Fibre>([&world, &master, i] {
      i < can_buses ? run_can_master(world, i, *master.clock) : run_ethercat_master(world, *master.clock);
    });
    master.fibre = master.owner.get();
  }
  Mischief mischief(world);
  const auto end = static_cast<std::int64_t>(options.hours * 3600.0 * ticks_per_s);
  while (world.tick() < end && interrupted == 0) {
    pass(world, mischief, masters);
    if (quiet || world.tick() % ticks_per_s != 0 || Clock::now() - told < std::chrono::seconds(progress_s)) continue;
    told = Clock::now();
    std::fprintf(stderr, "chaos: %.0f s: %.3f h of %.3f h, %llu findings\n",
                 std::chrono::duration<double>(told - began).count(), hours_of(world), options.hours,
                 static_cast<unsigned long long>(world.finding_count()));
  }
  mischief.end();
  for (const std::int64_t last = world.tick() + quiet_s * ticks_per_s; world.tick() < last;) {
    pass(world, mischief, masters);
  }
  world.stopping = true;
  const auto at_work = [&masters] {
    return std::any_of(masters.begin(), masters.end(), [](const Master& one) { return !one.owner->over(); });
  };
  for (const std::int64_t last = world.tick() + finish_s * ticks_per_s; at_work() && world.tick() < last;) {
    pass(world, mischief, masters);
  }
  if (at_work()) world.finding("a master does not end");
  for (Subject& subject : world.subjects()) {
    if (subject.watch && !subject.watch->end()) {
      world.finding(fmt::format("{}: {}", subject.axis->settings().name, subject.watch->finding()->text));
    }
  }
  nlohmann::json result = report(world, mischief, std::chrono::duration<double>(Clock::now() - began).count());
  if (!at_work()) return result;
  std::printf("%s\n", result.dump(1).c_str());
  std::fflush(stdout);
  std::_Exit(1);  // no destructors: the stack of a paused fibre refers to objects of the line
}

[[noreturn]] void refuse(const std::string& why) {
  std::fprintf(stderr, "chaos: %s; see --help\n", why.c_str());
  std::exit(2);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  bool json = false;
  bool quiet = false;
  for (int i = 1; i < argc; ++i) {
    const std::string_view option = argv[i];
    const auto value = [&] {
      char* end = nullptr;
      const double number = i + 1 < argc ? std::strtod(argv[i + 1], &end) : 0.0;
      if (end == nullptr || *end != '\0' || end == argv[i + 1] || number < 0.0)
        refuse(fmt::format("{} needs a number that is not negative", option));
      ++i;
      return number;
    };
    if (option == "--hours") {
      options.hours = value();
    } else if (option == "--seed") {
      options.seed = static_cast<std::uint64_t>(value());
    } else if (option == "--axes") {
      options.axes = static_cast<std::size_t>(value());
    } else if (option == "--share") {
      options.share = value();
    } else if (option == "--power-every") {
      options.power_cut_every_s = value();
    } else if (option == "--cable-every") {
      options.cable_every_s = value();
    } else if (option == "--recovery") {
      options.recovery_limit_s = value();
    } else if (option == "--rest-stride") {
      options.rest_stride = static_cast<std::int64_t>(value());
    } else if (option == "--only-segment") {
      options.only_segment = true;
    } else if (option == "--no-invariants") {
      options.watches = false;
    } else if (option == "--json") {
      json = true;
    } else if (option == "--quiet") {
      quiet = true;
    } else if (option == "--help") {
      std::fputs(help, stdout);
      return 0;
    } else {
      refuse(fmt::format("there is no option {}", option));
    }
  }
  if (options.axes < 1 || options.axes > 127) refuse("--axes: 1 .. 127");
  if (options.rest_stride < 1 || options.rest_stride > 16) refuse("--rest-stride: 1 .. 16");
  if (options.share > 0.2) refuse("--share: 0 .. 0.2");
  std::signal(SIGINT, [](int) { interrupted = 1; });
  std::signal(SIGTERM, [](int) { interrupted = 1; });
  const nlohmann::json result = run(options, quiet);
  if (json) {
    std::printf("%s\n", result.dump(1).c_str());
  } else {
    for (const auto& [key, value] : result.items()) std::printf("%-20s %s\n", key.c_str(), value.dump().c_str());
  }
  return result.at("finding_count") == 0 ? 0 : 1;
}
