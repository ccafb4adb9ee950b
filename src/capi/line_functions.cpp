#include <algorithm>
#include <fmt/format.h>
#include <string_view>

#include "api/scope/channel_list.hpp"
#include "api/version.hpp"
#include "capi/call.hpp"
#include "capi/ports.hpp"
#include "capi/servodrome.h"
#include "line/bench/line_bench.hpp"
#include "line/line_file.hpp"

// The functions of servodrome.h for lines and values of axes.
namespace servodrome::capi {
namespace {

constexpr std::size_t largest_request = 4 * 1024 * 1024;

Json json_of(const std::vector<line::Diagnostic>& diagnostics) {
  Json list = Json::array();
  for (const line::Diagnostic& one : diagnostics) {
    list.push_back(
        {{"file", one.file}, {"line", one.line}, {"column", one.column}, {"what", one.what}, {"hint", one.hint}});
  }
  return list;
}

std::vector<const api::NamedChannel*> channels_of(OpenLine& line, const std::uint32_t* numbers, std::size_t count) {
  std::vector<const api::NamedChannel*> channels;
  for (std::size_t i = 0; i < count; ++i) {
    if (numbers[i] >= line.channels.size()) {
      refuse_argument(fmt::format("there is no channel {}", numbers[i]), "channels",
                      "use the numbers that servodrome_channel gave for this line");
    }
    channels.push_back(&line.channels[numbers[i]]);
  }
  return channels;
}

api::Method method_of(std::string_view word) {
  using api::Method;
  if (word == "GET") return Method::get;
  if (word == "PUT") return Method::put;
  if (word == "POST") return Method::post;
  if (word == "DELETE") return Method::delete_;
  refuse_argument("unknown method", "method", "give GET, PUT, POST or DELETE");
}

// The channel of a signal, an input, an output or an object. Objects begin with a digit of their index and have a
// colon.
api::NamedChannel channel_named(OpenLine& line, const std::string& axis, const std::string& value) {
  const char* key = value.find(':') != std::string::npos ? "object" : "signal";
  return api::read_channels(line.scope.source(), Json::array({{{"axis", axis}, {key, value}}})).front();
}

}  // namespace
}  // namespace servodrome::capi

using namespace servodrome;        // NOLINT(google-build-using-namespace)
using namespace servodrome::capi;  // NOLINT(google-build-using-namespace)

const char* servodrome_version(void) { return servodrome::api::version(); }

int servodrome_interface(void) { return 1; }

const char* servodrome_last_error(void) { return last_reason().c_str(); }

// ---- Lines ----

int servodrome_line_open(const char* text, size_t size, const char* name, servodrome_handle* handle) {
  return guarded([&] {
    require(handle, "line");
    const bool own = text == nullptr;
    const line::LineFile file = line::parse_line_file(own ? line::default_line_text() : std::string_view(text, size),
                                                      name != nullptr ? name
                                                      : own           ? "default.toml"
                                                                      : "line.toml",
                                                      line::all_products());
    if (!file.diagnostics.empty()) {
      const line::Diagnostic& first = file.diagnostics.front();
      throw Failure{SERVODROME_BAD_LINE,
                    {{"what", first.what},
                     {"where", fmt::format("{}:{}:{}", first.file, first.line, first.column)},
                     {"hint", first.hint},
                     {"diagnostics", json_of(file.diagnostics)}}};
    }
    line::LineSettings settings = file.settings;
    settings.clock = line::ClockMode::virtual_time;
    const auto opened = std::make_shared<OpenLine>(settings, api::to_text(json_of(file.warnings)));
    *handle = new_handle();
    add_handle(*handle, opened);
    return SERVODROME_OK;
  });
}

int servodrome_line_close(servodrome_handle handle) {
  return guarded([&] {
    const LockedLine line(handle);
    line.itself();
    line->closed = true;
    for (const auto& item : line->items) remove_handle(item.first);
    line->items.clear();
    remove_handle(handle);
    return SERVODROME_OK;
  });
}

int servodrome_line_warnings(servodrome_handle handle, const char** json) {
  return guarded([&] {
    require(json, "json");
    *json = LockedLine(handle)->warnings.c_str();
    return SERVODROME_OK;
  });
}

int servodrome_line_now(servodrome_handle handle, int64_t* now_ns) {
  return guarded([&] {
    require(now_ns, "now_ns");
    *now_ns = LockedLine(handle).itself()->line.now().count();
    return SERVODROME_OK;
  });
}

int servodrome_line_run_until(servodrome_handle handle, int64_t time_ns) {
  return guarded([&] {
    const LockedLine line(handle);
    const std::int64_t now = line.itself()->line.now().count();
    within(time_ns, now, now + longest_advance_ns, "time_ns");
    line->line.run_until(Time(time_ns));
    return SERVODROME_OK;
  });
}

int servodrome_line_advance(servodrome_handle handle, int64_t span_ns, int64_t* now_ns) {
  return guarded([&] {
    const LockedLine line(handle);
    line.itself();
    within(span_ns, 0, longest_advance_ns, "span_ns");
    line->line.run_until(line->line.now() + Time(span_ns));
    if (now_ns != nullptr) *now_ns = line->line.now().count();
    return SERVODROME_OK;
  });
}

int servodrome_line_run_ticks(servodrome_handle handle, int64_t ticks) {
  return guarded([&] {
    const LockedLine line(handle);
    line.itself();
    within(ticks, 0, longest_advance_ns / SERVODROME_TICK_NS, "ticks");
    line->line.run_until((line->line.now() / line::tick_length + ticks) * line::tick_length);
    return SERVODROME_OK;
  });
}

int servodrome_line_wait(servodrome_handle handle, int64_t time_ns, const servodrome_handle* ports, size_t count,
                         size_t* ready) {
  return guarded([&] {
    require(ready, "ready");
    if (count > 0) require(ports, "ports");
    const LockedLine line(handle);
    const std::int64_t now = line.itself()->line.now().count();
    within(time_ns, INT64_MIN, now + longest_advance_ns, "time_ns");
    std::vector<Port*> waiting;
    for (std::size_t i = 0; i < count; ++i) {
      const auto found = line->items.find(ports[i]);
      auto* port = found == line->items.end() ? nullptr : dynamic_cast<Port*>(found->second.get());
      if (port == nullptr) {
        throw failure(SERVODROME_CLOSED, fmt::format("number {} of the ports is closed, or not of this line", i),
                      "ports", "give open ports of this line");
      }
      waiting.push_back(port);
    }
    *ready = line->run_until_ready(Time(time_ns), waiting);
    return *ready == count ? SERVODROME_NOTHING : SERVODROME_OK;
  });
}

int servodrome_line_request(servodrome_handle handle, const char* method, const char* target, const char* body,
                            size_t size, servodrome_answer* answer) {
  return guarded([&] {
    require(method, "method");
    require(target, "target");
    require(answer, "answer");
    if (size > 0) require(body, "body");
    size_within(size, 0, largest_request, "size");
    api::Request request;
    request.method = method_of(method);
    request.target = target;
    if (size > 0) request.body.assign(body, size);
    thread_local api::Response response;
    const LockedLine line(handle);
    line.itself();
    response = line::bench::handle(line->line, request, line->groups);
    *answer = {response.status, response.content_type.c_str(), response.body.data(), response.body.size()};
    return SERVODROME_OK;
  });
}

// ---- Values of axes ----

int servodrome_channel(servodrome_handle handle, const char* axis, const char* value, uint32_t* channel) {
  return guarded([&] {
    require(axis, "axis");
    require(value, "value");
    require(channel, "channel");
    const LockedLine line(handle);
    line.itself();
    std::string key = std::string(axis) + "/" + value;
    const auto known = line->channel_numbers.find(key);
    if (known != line->channel_numbers.end()) {
      *channel = known->second;
      return SERVODROME_OK;
    }
    line->channels.push_back(channel_named(*line, axis, value));
    *channel = static_cast<std::uint32_t>(line->channels.size() - 1);
    line->channel_numbers.emplace(std::move(key), *channel);
    return SERVODROME_OK;
  });
}

int servodrome_read(servodrome_handle handle, const uint32_t* channels, size_t count, double* values) {
  return guarded([&] {
    if (count > 0) {
      require(channels, "channels");
      require(values, "values");
    }
    const LockedLine line(handle);
    line.itself();
    const auto found = channels_of(*line, channels, count);
    for (const api::NamedChannel* channel : found) *values++ = channel->value();
    return SERVODROME_OK;
  });
}

int servodrome_recorder_open(servodrome_handle handle, const uint32_t* channels, size_t count, int64_t stride,
                             servodrome_handle* recorder) {
  return guarded([&] {
    require(channels, "channels");
    require(recorder, "recorder");
    size_within(count, 1, 4096, "count");
    within(stride, 1, 16000, "stride");
    const LockedLine line(handle);
    line.itself();
    *recorder = line.add(std::make_unique<Recorder>(line->line, channels_of(*line, channels, count), stride));
    return SERVODROME_OK;
  });
}

int servodrome_recorder_rows(servodrome_handle handle, uint64_t* rows, int64_t* first_tick) {
  return guarded([&] {
    require(rows, "rows");
    require(first_tick, "first_tick");
    const LockedLine line(handle);
    auto& recorder = line.item<Recorder>();
    *rows = recorder.rows();
    *first_tick = recorder.first_tick();
    return SERVODROME_OK;
  });
}

int servodrome_recorder_copy(servodrome_handle handle, uint64_t first, uint64_t rows, double* values) {
  return guarded([&] {
    if (rows > 0) require(values, "values");
    const LockedLine line(handle);
    auto& recorder = line.item<Recorder>();
    const std::uint64_t all = recorder.rows();
    if (first > all || rows > all - first) {
      refuse_argument(fmt::format("rows {} and {} following do not exist", first, rows), "rows",
                      fmt::format("the recorder has {} rows", all));
    }
    std::copy_n(recorder.values().data() + first * recorder.columns(), rows * recorder.columns(), values);
    return SERVODROME_OK;
  });
}

int servodrome_recorder_close(servodrome_handle recorder) { return close_item<Recorder>(recorder); }
