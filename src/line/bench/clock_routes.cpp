#include <algorithm>
#include <cmath>

#include "api/version.hpp"
#include "line/bench/axis_view.hpp"
#include "line/bench/line_bench.hpp"

namespace servodrome::line::bench {
namespace {

constexpr double longest_advance_ms = 60'000;  // limits the duration of a request
constexpr Time piece_of_advance = std::chrono::milliseconds(20);

}  // namespace

Json clock_view(const Line& line) {
  const bool real = line.clock_mode() == ClockMode::real;
  Json clock{{"mode", real ? "real" : "virtual"},
             {"time_ns", line.now().count()},
             {"time_ms", std::chrono::duration<double, std::milli>(line.now()).count()},
             {"ticks", line.now() / tick_length}};
  clock["speed"] = real ? 1.0 : line.speed();
  if (real) {
    clock["lag_ms"] = std::chrono::duration<double, std::milli>(line.lag().total).count();
    clock["lag_count"] = line.lag().count;
  }
  return clock;
}

Json LineBench::show_clock(Call&) { return clock_view(line_); }

Json LineBench::advance(Call& call) {
  BodyReader body(call.body);
  body.required("ms");
  const double ms = body.number("ms", 0, longest_advance_ms).value_or(0);
  body.finish();
  if (line_.clock_mode() == ClockMode::real) {
    throw ApiError{409, "the line runs in real time", "clock", "start it with `servodrome up --virtual`"};
  }
  // In pieces, so that each client of a stream receives the samples so far before there are more.
  call.piece = [&line = line_, left = Time(std::llround(ms * 1e6))]() mutable -> Json {
    const Time piece = std::min(left, piece_of_advance);
    line.run_until(line.now() + piece);
    left -= piece;
    return left > Time{} ? Json(nullptr) : clock_view(line);
  };
  return nullptr;
}

Json LineBench::set_speed(Call& call) {
  BodyReader body(call.body);
  body.required("speed");
  const double speed = body.number("speed", 0, Line::most_speed).value_or(0);
  body.finish();
  if (line_.clock_mode() == ClockMode::real) {
    throw ApiError{409, "the line runs in real time", "clock", "start it with `servodrome up --virtual`"};
  }
  line_.set_speed(speed);
  return clock_view(line_);
}

Json LineBench::show_line(Call&) {
  Json buses = Json::array();
  for (const auto& bus : line_.buses()) buses.push_back(bus->settings.name);
  for (const auto& bus : line_.serial_buses()) buses.push_back(bus->settings.name);
  for (const auto& bus : line_.ethercat_buses()) buses.push_back(bus->settings.name);
  Json names = Json::array();
  for (const Signal& signal : signals()) names.push_back(signal.name);
  Json missing = Json::object();
  if (line_.clock_mode() == ClockMode::real) missing["virtual_time"] = "the line runs in real time";
  return Json{
      {"kind", "virtual"}, {"buses", std::move(buses)}, {"signals", std::move(names)}, {"missing", std::move(missing)}};
}

}  // namespace servodrome::line::bench
