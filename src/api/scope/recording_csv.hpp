#pragma once

#include <string>
#include <string_view>

#include "api/scope/recording.hpp"

// A recording as CSV (RFC 4180): a head, and a row for each sample. `line_end` is "\r\n" in the RFC.
namespace servodrome::api {

std::string csv_head(const Recording& recording, std::string_view line_end);
// A value that is not a number becomes an empty field. Numbers have as many digits as it takes to read them back
// unchanged.
void append_csv_row(std::string& text, const Recording& recording, std::int64_t row, std::string_view line_end);

}  // namespace servodrome::api
