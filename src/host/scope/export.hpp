#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "host/scope/recording.hpp"

// What is made of a recording. Each function returns the whole file.
namespace servodrome::host::scope {

// RFC 4180, LF: a line of names, then a line for each row. `seconds` comes first, counted from the trigger or the first
// sample; with several groups each has a time of its own before its channels (`seconds`, `seconds_NAME`). Units are in
// brackets behind the name.
std::string csv_of(const Recording& recording);

// MCAP 0, chunks not compressed, with index and statistics: a topic for each group, JSON messages by a JSON schema,
// times of the wall clock (Recording::zero_unix_ns).
std::string mcap_of(const Recording& recording);

// The same of rows that are looked up while the file is laid out: what a call gives is its next part of some 256
// KiB, "" when there is no more.
struct Table {
  std::vector<Channel> channels;
  std::vector<std::size_t> groups;  // of the channels
  std::vector<std::string> topics;  // of the groups
  std::size_t rows = 0;
  std::string source{};
  std::string way{};
  std::function<double(std::size_t row, std::size_t channel)> value;
  std::function<std::int64_t(std::size_t row, std::size_t group)> unix_ns;  // when
};
std::function<std::string()> mcap_parts_of(Table table);

// A picture: a panel for each unit, one time axis.
std::string svg_of(const Recording& recording);

// A plot in braille characters for each channel, `rows` lines high and `columns` characters wide beside its scale.
std::string terminal_plot_of(const Recording& recording, unsigned columns, unsigned rows);

// Channels that are drawn in one panel: those of the same unit; those without unit each alone, since nothing says that
// they can be compared.
std::vector<std::vector<std::size_t>> panels_of(const std::vector<Channel>& channels);

// A scale that people read: round numbers, `wanted` of them or somewhat more or fewer, that lie within least and
// greatest.
struct Ticks {
  double step = 1;
  std::vector<double> at{};
};
Ticks round_ticks(double least, double greatest, unsigned wanted);

}  // namespace servodrome::host::scope
