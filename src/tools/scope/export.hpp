#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tools/scope/recording.hpp"

// Output formats of a recording. Each function returns the whole file.
namespace servodrome::master::scope {

// CSV by RFC 4180 with LF: a line of names, then a line for each row. The first column is `seconds`, counted from the
// trigger or the first sample. With several groups each has its own time column before its channels (`seconds`,
// `seconds_NAME`). Units follow the name in brackets.
std::string csv_of(const Recording& recording);

// MCAP 0 with uncompressed chunks, index and statistics: a topic for each group, JSON messages with a JSON schema,
// times of the wall clock (Recording::zero_unix_ns).
std::string mcap_of(const Recording& recording);

// Source of rows for mcap_parts_of(), which reads them on demand. Each call of the function that it returns produces
// the next part of the file, about 256 KiB; "" after the last.
struct Table {
  std::vector<Channel> channels;
  std::vector<std::size_t> groups;  // group of each channel
  std::vector<std::string> topics;  // topic of each group
  std::size_t rows = 0;
  std::string source{};
  std::string way{};
  std::function<double(std::size_t row, std::size_t channel)> value;
  std::function<std::int64_t(std::size_t row, std::size_t group)> unix_ns;  // time of the row
};
std::function<std::string()> mcap_parts_of(Table table);

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

}  // namespace servodrome::master::scope
