#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "scope/recording.hpp"

// Files of a recording. Each function returns the whole file, or a function that returns its next part at each call,
// and "" after the last.
namespace servodrome::scope {

struct CsvFormat {
  std::string_view line_end = "\n";  // "\r\n" in RFC 4180
  std::string_view time_name = "seconds";
  int time_decimals = 9;
  // If set: a first column `tick`, with the tick of each row.
  std::function<std::int64_t(std::size_t row)> tick{};
};

// CSV by RFC 4180: a line of names, then a line for each row. The first column is the time in seconds. With several
// groups each has its own time column before its channels (`seconds`, `seconds_NAME`). Units follow the name in
// brackets. A value that is not a number becomes an empty field. Other numbers have as many digits as it takes to read
// them back unchanged.
std::function<std::string()> csv_parts_of(Table table, CsvFormat format = {});
std::string csv_of(const Recording& recording);

// MCAP 0 with uncompressed chunks of about 256 KiB, index and statistics: a topic for each group, JSON messages with a
// JSON schema, times of the wall clock.
std::function<std::string()> mcap_parts_of(Table table);
std::string mcap_of(const Recording& recording);

// All parts of a file.
std::string joined(const std::function<std::string()>& parts);

// An SVG picture: one panel for each unit, with a common time axis.
std::string svg_of(const Recording& recording);

// A plot of braille characters for each channel, `rows` lines high and `columns` characters wide, plus its scale.
std::string terminal_plot_of(const Recording& recording, unsigned columns, unsigned rows);

// Groups channels into panels: those of the same unit share one; a channel without a unit has its own, because it may
// not be comparable.
std::vector<std::vector<std::size_t>> panels_of(const std::vector<Channel>& channels);

// A scale with about `wanted` round numbers between `least` and `greatest`.
struct Ticks {
  double step = 1;
  std::vector<double> at{};
};
Ticks round_ticks(double least, double greatest, unsigned wanted);

}  // namespace servodrome::scope
