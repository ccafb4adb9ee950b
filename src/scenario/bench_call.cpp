#include "scenario/bench_call.hpp"

#include <fmt/format.h>

#include "line/bench/line_bench.hpp"

namespace servodrome::scenario {
namespace {

api::Method method_of(const std::string& name) {
  if (name == "GET") return api::Method::get;
  if (name == "PUT") return api::Method::put;
  return name == "POST" ? api::Method::post : api::Method::delete_;
}

}  // namespace

BenchAnswer call_bench(line::Line& line, const line::Axis& axis, const std::string& method, const std::string& path,
                       const std::string& body) {
  api::Request request;
  request.method = method_of(method);
  request.target = fmt::format("/api/v1/axes/{}{}", axis.settings().name, path);
  request.body = body;
  const api::Response response = line::bench::handle(line, request);
  BenchAnswer answer{.body = nlohmann::json::parse(response.body, nullptr, false)};
  if (response.status < 400) return answer;
  const bool is_explained = answer.body.is_object() && answer.body.contains("error");
  answer.error = is_explained ? fmt::format("{}; {}", answer.body["error"].value("what", ""),
                                            answer.body["error"].value("hint", ""))
                              : response.body;
  return answer;
}

}  // namespace servodrome::scenario
