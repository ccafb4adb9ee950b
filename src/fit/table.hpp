#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

// A recording as columns of numbers, read from any file that `servodrome scope` or the bench API writes.
namespace servodrome::fit {

struct Column {
  std::string axis;  // axis in a line's recording; empty: recording of a single drive without a name
  std::string name;  // lower-case letters, digits and "_": "velocity_actual_value"
  std::string unit;
  std::size_t clock = 0;       // index of the clock of its samples
  std::vector<double> values;  // NaN: no sample
};

struct Table {
  std::string source;                       // name of the recording, for messages
  std::vector<std::vector<double>> clocks;  // s, increasing; channels that one request reads share a clock
  std::vector<Column> columns;              // as many values as the times of its clock
};

// Greatest recording that is read: 512 MB of numbers.
inline constexpr std::size_t most_columns = 4096;
inline constexpr std::size_t most_values = std::size_t{1} << 26;

// Reads the CSV of `servodrome scope -o FILE.csv` and of the bench API (`GET .../data.csv`), the MCAP of both, and the
// document of `servodrome scope --json`; recognises them by the first bytes. Throws Error, with the line of a CSV file
// or the byte of a JSON or MCAP file, for other formats and damaged files. Also throws Error for more columns or values
// than above, and for times that do not increase or are beyond 1e12 s.
Table read_table(std::string_view bytes, const std::string& source);

// A name in lower-case letters and digits with "_" between them; the index of an object is omitted.
std::string plain_name(std::string_view text);

}  // namespace servodrome::fit
