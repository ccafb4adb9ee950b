#pragma once

#include <string>

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
