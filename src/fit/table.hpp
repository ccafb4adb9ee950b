#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

// A recording as columns of numbers, out of the text of any file that `servodrome scope` and the bench API write.
namespace servodrome::fit {

struct Column {
  std::string axis;  // of a line's recording; empty: the recording is of one drive and does not name it
  std::string name;  // letters, digits and "_", all small: "velocity_actual_value"
  std::string unit;
  std::size_t clock = 0;       // which of the table's clocks its samples were taken by
  std::vector<double> values;  // not a number: there was none
};

struct Table {
  std::string source;                       // of the recording, for messages
  std::vector<std::vector<double>> clocks;  // s, rising; channels that one request reads share one
  std::vector<Column> columns;              // as many values as its clock has times
};

// CSV of `servodrome scope -o FILE.csv` and of the bench API (`GET .../data.csv`), MCAP of both, and the document of
// `servodrome scope --json`, recognised by the first bytes. Throws Error for what is none of them, and for one that is
// damaged, with the line of a CSV file or the byte of an MCAP file.
Table read_table(std::string_view bytes, const std::string& source);

// Small letters and digits of a name, "_" for what is between them; of an object of the bench API without its index.
std::string plain_name(std::string_view text);

}  // namespace servodrome::fit
