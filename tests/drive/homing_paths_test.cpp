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

// --- The path as letters: P, N fast and p, n slow in positive and negative direction; s a ramp to zero, h a hold, r
// the way back. A method of a product is defined by its path, so the whole table is repeated here.

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
  std::string home_inactive;  // the home switch is met, or there is none
  std::string home_active;
  std::string over_limit;  // the home switch is inactive, and the limit switch is met first
};

// A cam in the middle for every method, or a switch that stays active up to the end if the standard shows it so.
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

// The ISMC manual, ch. 4.7.6.
TEST(HomingPaths, Ismc) {
  const Paths rows[] = {
      {-4, "Phns", "", ""},         {-3, "Nhps", "", ""},         {-2, "Phs", "", ""},  // no retraction
      {-1, "Nhs", "", ""},          {1, "Nsps", "", ""},          {2, "Psns", "", ""},
      {3, "Psns", "ns", ""},        {4, "psr", "Nspsr", ""},      {5, "Nspsr", "psr", ""},
      {6, "ns", "Psns", ""},        {7, "Psns", "ns", "PsNns"},   {8, "ps", "Nsps", "psNsps"},
      {9, "Psns", "Psns", "Psns"},  {10, "Pps", "ps", "PsNsps"},  {11, "Nsps", "ps", "NsPps"},
      {12, "ns", "Psns", "nsPsns"}, {13, "Nsps", "Nsps", "Nsps"}, {14, "Nns", "ns", "NsPsns"},
      {17, "Nsps", "", ""},         {18, "Psns", "", ""},         {19, "Psns", "ns", ""},
      {20, "ps", "Nsps", ""},       {21, "Nsps", "ps", ""},       {22, "ns", "Psns", ""},
      {23, "Psns", "ns", "PsNns"},  {24, "ps", "Nsps", "psNsps"}, {25, "Psns", "Psns", "Psns"},
      {26, "Pps", "ps", "PsNsps"},  {27, "Nsps", "ps", "NsPps"},  {28, "ns", "Psns", "nsPsns"},
      {29, "Nsps", "Nsps", "Nsps"}, {30, "Nns", "ns", "NsPsns"},  {33, "ns", "", ""},
      {34, "ps", "", ""},
  };
  expect_paths(products::ismc::homing_methods, rows);
}

// The JMC manual, HM 2.1 to 2.34.
TEST(HomingPaths, JmcEc) {
  const Paths rows[] = {
      {1, "Nspsr", "", ""},
      {2, "Psnsr", "", ""},
      {3, "Psnsr", "nsr", "PsNnsr"},
      {4, "Ppsr", "nspsr", "PsNnspsr"},
      {5, "Nspsr", "psr", "NsPpsr"},
      {6, "Nnsr", "psnsr", "NsPpsnsr"},
      {7, "Psnsr", "nsr", "PsNnsr"},
      {8, "Ppsr", "nspsr", "PsNnspsr"},
      {9, "Ppsnsr", "psnsr", "PsNnsr"},
      {10, "Ppsr", "psr", "PsNspsr"},
      {11, "Nspsr", "psr", "NsPpsr"},
      {12, "Nnsr", "psnsr", "NsPpsnsr"},
      {13, "Nnspsr", "nspsr", "NsPpsr"},
      {14, "Nnsr", "nsr", "NsPsnsr"},
      {17, "Nspsr", "", ""},
      {18, "Psnsr", "", ""},
      {19, "Psnsr", "nsr", "PsNnsr"},  // as 3
      {20, "Psr", "nspsr", "PsNnspsr"},
      {21, "Nspsr", "psr", "NsPpsr"},
      {22, "Nsr", "psnsr", "NsPpsnsr"},
      {23, "Psnsr", "nsr", "PsNnsr"},
      {24, "Psr", "nspsr", "PsNnspsr"},
      {25, "Ppsnsr", "psnsr", "PsNsr"},
      {26, "Ppsr", "psr", "PsNspsr"},
      {27, "Nspsr", "psr", "NsPpsr"},
      {28, "Nsr", "psnsr", "NsPpsnsr"},
      {29, "Nnspsr", "nspsr", "NsPsr"},
      {30, "Nnsr", "nsr", "NsPsnsr"},
      {33, "nsr", "", ""},
      {34, "psr", "", ""},
  };
  expect_paths(products::jmc_ec::homing_methods, rows, Home::cam);
  // A start on the limit switch moves off it slowly from the beginning (HM 2.17 and 2.18).
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
