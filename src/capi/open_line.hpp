#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "capi/servodrome.h"
#include "line/bench/scope/line_scope.hpp"
#include "line/line.hpp"
#include "studio/line_routes.hpp"

namespace servodrome::capi {

using line::Time;

struct OpenLine;

// Something that was opened on a line. It refers to the line, so the line's map of items owns it.
class Item {
 public:
  virtual ~Item() = default;
};

// A port of a master. ready() returns true if it has something to read at the line's time `now`.
class Port : public Item {
 public:
  virtual bool ready(Time now) const = 0;
  // The time at which something that is already on its way arrives; links::never: nothing is known.
  virtual Time arrival() const { return links::never; }
};

// A line with the bench API, and what callers have opened on it. Every access needs the lock.
struct OpenLine {
  OpenLine(const line::LineSettings& settings, std::string its_warnings);
  OpenLine(const OpenLine&) = delete;
  OpenLine& operator=(const OpenLine&) = delete;

  // Runs the line until a port is ready, at the latest until `end`. Returns the index of the first ready port, or
  // `ports.size()`.
  std::size_t run_until_ready(Time end, const std::vector<Port*>& ports);

  std::mutex mutex;
  bool closed = false;
  std::string warnings;  // JSON
  line::Line line;
  line::bench::LineScope scope{line};
  studio::LineRoutes routes;
  std::vector<api::RouteGroup> groups;
  std::vector<api::NamedChannel> channels;
  std::map<std::string, std::uint32_t> channel_numbers;  // by "axis/value"
  std::map<servodrome_handle, std::unique_ptr<Item>> items;
};

}  // namespace servodrome::capi
