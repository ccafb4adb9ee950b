// Takes any bytes as what a client sends to the server, or as a file of a project: the first byte selects the order of
// a job, requests and messages of a stream to the recordings, a request with its header fields, or a file. The
// sanitizers detect misuse of memory. The invariants detect a status of 500 (an exception that no handler expects), an
// answer that is no JSON, access without the right, and a value that its own text does not give again.
#include <array>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <unistd.h>

#include "api/access.hpp"
#include "api/body_reader.hpp"
#include "api/query.hpp"
#include "api/request.hpp"
#include "api/scope/frame.hpp"
#include "api/scope/scope.hpp"
#include "api/static_files.hpp"
#include "master/error.hpp"
#include "parsers.hpp"
#include "studio/order.hpp"
#include "studio/project/project.hpp"
#include "studio/project/recording_files.hpp"

namespace {

using namespace servodrome;
using api::ApiError;
using api::Json;
using fuzz::Bytes;
using fuzz::require;
using fuzz::text_of;

void check_response(const api::Response& response) {
  require(response.status < 500);
  require(response.status == 204 ? response.body.empty()
                                 : response.content_type != "application/json" || Json::accept(response.body));
}
void check_error(const ApiError& error) { check_response(api::error_response(error)); }

// The text in front of the next line end, which is removed with it.
std::string_view take_line(std::string_view& text) {
  const std::string_view line = text.substr(0, text.find('\n'));
  text.remove_prefix(std::min(line.size() + 1, text.size()));
  return line;
}

// ---- Orders of jobs ----

void read_order(Bytes input) {
  const bool knows_units = fuzz::take_byte(input) % 2 != 0;
  try {
    const studio::Order order = studio::read_order(std::string(text_of(input)), [&] {
      return knows_units ? std::optional(catalogue::AxisUnits{65536.0, 65536.0, 65536.0}) : std::nullopt;
    });
    require(!order.what.empty() && order.carry_out);
    require(!order.lives_on_signs || order.moves);
    require(!order.takes_over || !order.target);
  } catch (const ApiError& error) {
    check_error(error);
  } catch (const master::MasterError& error) {
    require(!knows_units && !error.happened().empty());
  }
}

// ---- Recordings and streams ----

// Two axes whose values do not change. They are sampled once per second, so that a recording is short.
class Axes final : public api::Source {
 public:
  std::int64_t tick() const override { return tick_; }
  void advance() {
    tick_ += api::Subscription::longest_stride;
    while (rows_.due() < tick_) rows_.put()[0] = 1.5;
  }
  links::Time wall_epoch() const override { return links::Time{0}; }
  std::vector<std::string> axes() const override { return {"x", "y"}; }
  api::NamedChannel signal(const std::string& axis, std::string_view name) override {
    if (name.size() > 20) throw ApiError{404, "there is no such signal", "signal", ""};
    return channel(axis, {{"axis", axis}, {"signal", name}, {"name", name}, {"unit", "rpm"}});
  }
  api::NamedChannel object(const std::string& axis, std::uint16_t index, std::uint8_t sub) override {
    const std::string address = fmt::format("{:04X}:{:02X}", index, sub);
    return channel(axis, {{"axis", axis}, {"object", address}, {"name", "object"}, {"unit", ""}});
  }
  std::int64_t stride_of(double, const std::vector<api::NamedChannel>&) const override {
    return api::Subscription::longest_stride;
  }
  std::int64_t trigger_stride(std::int64_t stride) const override { return stride; }
  std::vector<Json> views() override { return {Json{{"name", "x"}}, Json{{"name", "y"}}}; }
  Json clock() override { return {{"tick", tick_}}; }

 private:
  api::NamedChannel channel(const std::string& axis, Json view) const {
    if (axis != "x" && axis != "y") throw ApiError{404, "there is no such axis", "axis", ""};
    return {axis, std::move(view), [this](std::int64_t) { return std::make_shared<api::Samples>(rows_); },
            [] { return 1.5; }};
  }

  api::SampleRows rows_{api::Subscription::longest_stride, 0, 1};
  std::int64_t tick_ = 0;
};

class Reader final : public api::Outbox {
 public:
  void text(std::string message) override { require(Json::accept(message)); }
  void binary(std::string message) override {
    api::FrameHeader header;
    require(message.size() >= sizeof header);
    std::memcpy(&header, message.data(), sizeof header);
    require(message.size() == sizeof header + std::size_t{header.samples} * header.channels * sizeof(double));
  }
  std::size_t queued() const override { return 0; }
  void close(const std::string& reason) override { require(reason.size() <= 123); }
};

api::Method method_of(char letter) {
  constexpr std::array methods{api::Method::get, api::Method::put, api::Method::post, api::Method::delete_};
  return methods[static_cast<unsigned char>(letter) % methods.size()];
}

// Each line is a message of the stream, or METHOD, target, blank and body of a request; after each a second passes.
void talk_to_recordings(Bytes input) {
  constexpr unsigned most_lines = 32;
  Axes axes;
  api::Scope scope(axes);
  Reader reader;
  api::StreamSession session(scope, reader);
  const api::RouteGroup group{api::recording_routes(), &scope};
  std::string_view rest = text_of(input);
  for (unsigned line_number = 1; !rest.empty() && line_number <= most_lines; ++line_number) {
    const std::string_view line = take_line(rest);
    const api::WallTime now{std::chrono::seconds(line_number)};
    if (line.starts_with('{')) {
      session.receive(line, now);
    } else if (!line.empty()) {
      const std::size_t blank = std::min(line.find(' '), line.size());
      api::Request request{.method = method_of(line[0]), .target = "/api/v1/recordings"};
      request.target += line.substr(1, blank - 1);
      request.body = line.substr(std::min(blank + 1, line.size()));
      api::Response response = api::begin(request, {&group, 1});
      check_response(response);
      for (unsigned parts = 0; response.more && parts < 4 && !response.more().empty();) ++parts;
    }
    axes.advance();
    scope.advance(axes.tick());
    session.send_samples(axes.tick(), now);
    session.attend(now);
  }
  for (const auto& recording : scope.recordings().all()) require(recording->samples() <= recording->plan().samples);
}

// ---- Requests ----

Json read_everything(api::Call& call) {
  const auto number = api::query_number(call, "number", -10, 10);
  require(!number || (*number >= -10 && *number <= 10));
  const auto integer = api::query_integer(call, "integer", 1, 100);
  require(!integer || (*integer >= 1 && *integer <= 100));
  api::query_flag(call, "flag");
  api::BodyReader body(call.body, true);
  const auto limited = body.number("number", 0, 1);
  require(!limited || (*limited >= 0 && *limited <= 1));
  require(body.integer("integer", 5).value_or(0) <= 5);
  body.signed_integer("signed");
  body.boolean("flag");
  Json answer{{"argument", api::unescaped(call.arguments.front())}, {"text", body.string("text").value_or("")}};
  if (body.has("part")) {
    api::BodyReader part("part", body.required("part"));
    part.finish();
  }
  body.finish();
  return answer;
}

constexpr std::array routes{
    api::Route{api::Method::get, "/api/v1/fuzz/{}?number&integer&flag", read_everything},
    api::Route{api::Method::put, "/api/v1/fuzz/{}", read_everything},
    api::Route{api::Method::post, "/api/v1/fuzz/{}/stop", read_everything, 200, api::urgent},
};

// Lines: METHOD and target, Host, Origin, Authorization, If-None-Match; then the body.
void answer_request(Bytes input) {
  static const api::Access access{"secret"};
  static const api::StaticFiles files("");
  const std::uint8_t choice = fuzz::take_byte(input);
  std::string_view rest = text_of(input);
  const std::string_view first = take_line(rest);
  api::Request request{.from_loopback = (choice & 1) != 0, .only_if_urgent = (choice & 2) != 0};
  if (!first.empty()) {
    request.method = method_of(first[0]);
    request.target = first.substr(1);
  }
  request.host = take_line(rest);
  request.origin = take_line(rest);
  request.has_origin = !request.origin.empty();
  request.authorization = take_line(rest);
  request.if_none_match = take_line(rest);
  request.body = rest;
  const auto refusal = api::refuse(access, request);
  if (refusal) check_response(*refusal);
  const bool has_token = request.authorization.ends_with(" secret");
  require(refusal || has_token || (!request.host.empty() && request.authorization.empty()));
  require(refusal || has_token || request.method == api::Method::get || request.from_loopback);
  const api::Response page = files.answer(request);
  check_response(page);
  const api::RouteGroup group{routes, nullptr};
  const api::Response response = api::begin(request, {&group, 1});
  if (!response.postponed) check_response(response);
}

// ---- Projects ----

// A folder with a project, of which the input replaces a file. It is in memory, because a disk is too slow.
class Folder {
 public:
  Folder() : path_(fmt::format("/dev/shm/servodrome_api_fuzz_{}", ::getpid())) {
    std::filesystem::create_directories(path_ / "state");
    std::filesystem::create_directories(path_ / "recordings");
    write(settings_file, settings);
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  static constexpr const char* settings_file = "project.toml";
  static constexpr std::string_view settings = "name = \"fuzz\"\nschema = 1\n";

  void write(const std::string& name, std::string_view text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
  }
  void remove(const std::string& name) const { std::filesystem::remove(path_ / name); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

void open_project(const Folder& folder) {
  try {
    studio::Project project(folder.path());
    require(!project.name().empty() && project.name().size() <= 100);
    require(project.earlier_changes().size() <= studio::Project::most_earlier_changes);
    for (const auto& [name, state] : project.states()) require(Json::accept(state.text.value_or("")));
    for (const auto& change : project.earlier_changes()) require(Json::accept(studio::line_text(change)));
  } catch (const studio::ProjectError& error) {
    require(!error.first().what.empty() && !error.first().file.empty());
  }
}

void open_recordings(const Folder& folder) {
  try {
    api::Recordings recordings([](const api::Recording&) {});
    studio::load_recordings(folder.path() / "recordings", recordings);
    for (const auto& recording : recordings.all()) {
      require(recording->ended() && !studio::about_text(*recording).empty());
    }
  } catch (const studio::ProjectError& error) {
    require(!error.first().what.empty() && !error.first().file.empty());
  }
}

void read_project(Bytes input) {
  static const Folder folder;
  const std::uint8_t choice = fuzz::take_byte(input);
  std::string_view text = text_of(input);
  switch (choice % 4) {
    case 0:
      folder.write(Folder::settings_file, text);
      open_project(folder);
      folder.write(Folder::settings_file, Folder::settings);
      break;
    case 1:
      folder.write("state/panel.json", text);
      open_project(folder);
      folder.remove("state/panel.json");
      break;
    case 2:
      folder.write("changes.jsonl", text);
      open_project(folder);
      folder.remove("changes.jsonl");
      break;
    default:  // the first line is the description, the rest are the samples
      folder.write("recordings/7.json", take_line(text));
      folder.write("recordings/7.csv", text);
      open_recordings(folder);
      folder.remove("recordings/7.json");
      folder.remove("recordings/7.csv");
  }
}

void read_json_of_project(Bytes input) {
  try {
    const nlohmann::json json = studio::parse_json(text_of(input), "fuzz");
    const std::string text = studio::file_text(json);
    require(studio::file_text(studio::parse_json(text, "fuzz")) == text);
    require(studio::file_text(studio::parse_json(studio::line_text(json), "fuzz")) == text);
  } catch (const studio::ProjectError& error) {
    require(error.first().line > 0);
  }
}

constexpr fuzz::Parser parsers[] = {read_order, talk_to_recordings, answer_request, read_project, read_json_of_project};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::parse_with(parsers, {data, size});
  return 0;
}
