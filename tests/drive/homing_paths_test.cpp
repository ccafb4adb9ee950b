#include <gtest/gtest.h>
#include <span>
#include <string>
#include <vector>

#include "drive/homing/cia402_methods.hpp"
#include "drive/homing_axis.hpp"
#include "products/ismc/homing_methods.hpp"

namespace servodrome::drive::test {
namespace {

// --- The path itself, in letters: P, N fast and p, n slow in positive, negative direction; s a ramp to zero, h a hold,
// r the way back. A method of a product is its path, so the whole table is spelled out once more.

std::string path(const Method& method, const World& world, Counts start) {
  std::string letters;
  for (const HomingCommand& command : run(method, plain_config(), world, start).commands) {
    char letter = 0;
    switch (command.kind) {
      case HomingCommand::Kind::keep: break;
      case HomingCommand::Kind::velocity:
        letter = command.velocity == 20000.0    ? 'P'
                 : command.velocity == 2000.0   ? 'p'
                 : command.velocity == -20000.0 ? 'N'
                 : command.velocity == -2000.0  ? 'n'
                                                : '?';
        break;
      case HomingCommand::Kind::position: letter = 'r'; break;
      case HomingCommand::Kind::stop: letter = 's'; break;
      case HomingCommand::Kind::hold: letter = 'h'; break;
    }
    if (letters.empty() || letters.back() != letter) letters.push_back(letter);
  }
  return letters;
}

struct Paths {
  int number;
  std::string home_inactive;  // home is met, or there is none
  std::string home_active;
  std::string over_limit;  // home switch inactive, the limit switch is met first
};

void expect_paths(std::span<const Method> methods, std::span<const Paths> rows) {
  for (const Paths& row : rows) {
    const Method* method = find_method(methods, static_cast<std::int8_t>(row.number));
    ASSERT_NE(method, nullptr) << row.number;
    const int number = pattern(row.number);
    World world{.negative_limit = -5000,
                .positive_limit = 5000,
                .home_from = -500,
                .home_to = 500,
                .low_stop = -9000,
                .high_stop = 9000};
    if (number == 3 || number == 4) world.home_to = 9001;
    if (number == 5 || number == 6) world.home_from = -9000;
    if (number < 0) world.low_stop = -3000, world.high_stop = 3000;
    const bool starts_positive = number == 3 || number == 4 || (number >= 7 && number <= 10);
    const Counts before = starts_positive ? -1500 : 1500;
    EXPECT_EQ(path(*method, world, before), row.home_inactive) << row.number;
    if (!row.home_active.empty()) {
      EXPECT_EQ(path(*method, world, 0), row.home_active) << row.number;
    }
    if (!row.over_limit.empty()) {
      EXPECT_EQ(path(*method, world, -before), row.over_limit) << row.number;
    }
  }
}

TEST(HomingPaths, Ismc) {
  const Paths rows[] = {
      {-4, "Phns", "", ""},          // L2585-2588
      {-3, "Nhps", "", ""},          // L2579-2582
      {-2, "Phs", "", ""},           // L2570-2575, no retraction
      {-1, "Nhs", "", ""},           // L2563-2568
      {1, "Nsps", "", ""},           // L2171-2179
      {2, "Psns", "", ""},           // L2181-2188
      {3, "Psns", "ns", ""},         // L2192-2200
      {4, "psr", "Nspsr", ""},       // L2202-2210
      {5, "Nspsr", "psr", ""},       // L2212-2220
      {6, "ns", "Psns", ""},         // L2222-2230
      {7, "Psns", "ns", "PsNns"},    // L2232-2245
      {8, "ps", "Nsps", "psNsps"},   // L2247-2262
      {9, "Psns", "Psns", "Psns"},   // L2264-2278
      {10, "Pps", "ps", "PsNsps"},   // L2280-2295
      {11, "Nsps", "ps", "NsPps"},   // L2297-2310
      {12, "ns", "Psns", "nsPsns"},  // L2312-2325
      {13, "Nsps", "Nsps", "Nsps"},  // L2327-2339
      {14, "Nns", "ns", "NsPsns"},   // L2341-2354
      {17, "Nsps", "", ""},          // L2359-2366
      {18, "Psns", "", ""},          // L2368-2375
      {19, "Psns", "ns", ""},        // L2377-2385
      {20, "ps", "Nsps", ""},        // L2387-2395
      {21, "Nsps", "ps", ""},        // L2397-2405
      {22, "ns", "Psns", ""},        // L2407-2415
      {23, "Psns", "ns", "PsNns"},   // L2417-2431
      {24, "ps", "Nsps", "psNsps"},  // L2433-2451
      {25, "Psns", "Psns", "Psns"},  // L2453-2463
      {26, "Pps", "ps", "PsNsps"},   // L2465-2478
      {27, "Nsps", "ps", "NsPps"},   // L2480-2496
      {28, "ns", "Psns", "nsPsns"},  // L2498-2511
      {29, "Nsps", "Nsps", "Nsps"},  // L2513-2523
      {30, "Nns", "ns", "NsPsns"},   // L2525-2542
      {33, "ns", "", ""},            // L2544-2551
      {34, "ps", "", ""},            // L2553-2557
  };
  expect_paths(products::ismc::homing_methods, rows);
}

TEST(HomingPaths, Cia402) {
  const Paths rows[] = {
      {-4, "Phnsr", "", ""},
      {-3, "Nhpsr", "", ""},
      {-2, "Phs", "", ""},
      {-1, "Nhs", "", ""},
      {1, "Nspsr", "", ""},
      {2, "Psnsr", "", ""},
      {3, "Psnsr", "nsr", ""},
      {4, "PsNspsr", "Nspsr", ""},
      {5, "Nspsr", "psr", ""},
      {6, "NsPsnsr", "Psnsr", ""},
      {7, "Psnsr", "nsr", "PsNnsr"},
      {8, "PsNspsr", "Nspsr", "PsNspsr"},
      {9, "Psnsr", "Psnsr", "PsNsPsnsr"},
      {10, "Ppsr", "psr", "PsNspsr"},
      {11, "Nspsr", "psr", "NsPpsr"},
      {12, "NsPsnsr", "Psnsr", "NsPsnsr"},
      {13, "Nspsr", "Nspsr", "NsPsNspsr"},
      {14, "Nnsr", "nsr", "NsPsnsr"},
      {33, "nsr", "", ""},
      {34, "psr", "", ""},
  };
  expect_paths(cia402_methods, rows);
  std::vector<Paths> without_index;
  for (const Paths& row : rows) {
    if (row.number < 1 || row.number > 14) continue;
    without_index.push_back(row);
    without_index.back().number += 16;
  }
  expect_paths(cia402_methods, without_index);
}

}  // namespace
}  // namespace servodrome::drive::test
