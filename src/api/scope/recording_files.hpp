#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "api/scope/recording.hpp"
#include "links/time.hpp"

// Files of a recording that has ended. Each function returns a function that returns the next part at each call, and
// "" after the last: formatting up to 16 MiB at once would take longer than a drive may wait.
namespace servodrome::api {

// CSV: a row for each sample, with its tick and its time on the line. `line_end` is "\r\n" in RFC 4180.
std::function<std::string()> csv_parts_of(std::shared_ptr<const Recording> recording, std::string_view line_end);
// MCAP: one topic for each axis; its channels are the fields of the messages. `epoch` is the wall-clock time of tick 0.
std::function<std::string()> mcap_parts_of(std::shared_ptr<const Recording> recording, links::Time epoch);

}  // namespace servodrome::api
