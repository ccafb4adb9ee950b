#include <gtest/gtest.h>
#include <span>
#include <string>
#include <vector>

#include "drive/homing/cia402_methods.hpp"
#include "drive/homing_axis.hpp"
#include "products/ismc/homing_methods.hpp"
#include "products/jmc_ec/homing_methods.hpp"

namespace servodrome::drive::test {
namespace homing_paths_test {
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

// A cam in the middle for every method, or a switch that stays active up to the end where the standard has it so.
enum class Home : std::uint8_t { as_standard, cam };

void expect_paths(std::span<const Method> methods, std::span<const Paths> rows, Home home = Home::as_standard) {
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
    if (home == Home::as_standard && (number == 3 || number == 4)) world.home_to = 9001;
    if (home == Home::as_standard && (number == 5 || number == 6)) world.home_from = -9000;
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

TEST(HomingPaths, JmcEc) {
  const Paths rows[] = {
      {1, "Nspsr", "", ""},               // L4121-4130
      {2, "Psnsr", "", ""},               // L4132-4142
      {3, "Psnsr", "nsr", "PsNnsr"},      // L4144-4157
      {4, "Ppsr", "nspsr", "PsNnspsr"},   // L4159-4172
      {5, "Nspsr", "psr", "NsPpsr"},      // L4174-4187
      {6, "Nnsr", "psnsr", "NsPpsnsr"},   // L4189-4202
      {7, "Psnsr", "nsr", "PsNnsr"},      // L4204-4217
      {8, "Ppsr", "nspsr", "PsNnspsr"},   // L4219-4232
      {9, "Ppsnsr", "psnsr", "PsNnsr"},   // L4234-4247
      {10, "Ppsr", "psr", "PsNspsr"},     // L4249-4262
      {11, "Nspsr", "psr", "NsPpsr"},     // L4264-4277
      {12, "Nnsr", "psnsr", "NsPpsnsr"},  // L4279-4294
      {13, "Nnspsr", "nspsr", "NsPpsr"},  // L4296-4311
      {14, "Nnsr", "nsr", "NsPsnsr"},     // L4313-4326
      {17, "Nspsr", "", ""},              // L4336-4347
      {18, "Psnsr", "", ""},              // L4349-4360
      {19, "Psnsr", "nsr", "PsNnsr"},     // L4362-4369, as 3
      {20, "Psr", "nspsr", "PsNnspsr"},   // L4371-4384
      {21, "Nspsr", "psr", "NsPpsr"},     // L4386-4399
      {22, "Nsr", "psnsr", "NsPpsnsr"},   // L4401-4414
      {23, "Psnsr", "nsr", "PsNnsr"},     // L4416-4429
      {24, "Psr", "nspsr", "PsNnspsr"},   // L4431-4444
      {25, "Ppsnsr", "psnsr", "PsNsr"},   // L4446-4463
      {26, "Ppsr", "psr", "PsNspsr"},     // L4465-4478
      {27, "Nspsr", "psr", "NsPpsr"},     // L4480-4493
      {28, "Nsr", "psnsr", "NsPpsnsr"},   // L4495-4508
      {29, "Nnspsr", "nspsr", "NsPsr"},   // L4510-4525
      {30, "Nnsr", "nsr", "NsPsnsr"},     // L4527-4540
      {33, "nsr", "", ""},                // L4550-4559
      {34, "psr", "", ""},                // L4561-4570
  };
  expect_paths(products::jmc_ec::homing_methods, rows, Home::cam);
  // A start on the limit switch leaves it slowly at once (L4341, L4354).
  const World on_limit{.negative_limit = -500, .positive_limit = 500};
  for (const int number : {1, 17}) {
    EXPECT_EQ(path(*find_method(products::jmc_ec::homing_methods, static_cast<std::int8_t>(number)), on_limit, -600),
              "spsr");
    EXPECT_EQ(path(*find_method(products::jmc_ec::homing_methods, static_cast<std::int8_t>(number + 1)), on_limit, 600),
              "snsr");
  }
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
}  // namespace homing_paths_test
}  // namespace servodrome::drive::test
