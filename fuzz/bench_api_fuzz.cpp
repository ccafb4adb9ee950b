// Sends random requests to the bench API's handler, without sockets. Not guided by coverage: a fixed pseudo-random
// sequence, so that the same seed repeats a failure. Run it in a build with sanitizers:
//
//   bench_api_fuzz COUNT [SEED]
//
// Exit status 1 if an answer breaks a promise of the API: a status below 500; a JSON body, or no body with 204; on the
// stream, JSON texts and frames whose length is correct.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>

#include "../tests/line/bench_requests.hpp"
#include "../tests/line/support.hpp"
#include "api/scope/frame.hpp"
#include "line/bench/scope/line_scope.hpp"

namespace {

// Reads all data at once.
class Reader final : public servodrome::api::Outbox {
 public:
  void text(std::string message) override {
    if (!nlohmann::json::accept(message)) error = "no JSON: " + message;
  }
  void binary(std::string message) override {
    servodrome::api::FrameHeader header;
    if (message.size() < sizeof header) {
      error = "a frame without head";
      return;
    }
    std::memcpy(&header, message.data(), sizeof header);
    if (message.size() != sizeof header + std::size_t{header.samples} * header.channels * sizeof(double)) {
      error = "a frame that is not as long as it says";
    }
  }
  std::size_t queued() const override { return 0; }
  void close(const std::string&) override {}
  std::string error;
};

}  // namespace

int main(int argc, char** argv) {
  using namespace servodrome;
  using namespace servodrome::line;
  const std::uint64_t count = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1'000'000;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  test::RequestGenerator generator(seed);
  Line line(test::settings_of(test::two_axes_and_rs485));
  bench::LineScope looking(line);
  const api::RouteGroup recordings{api::recording_routes(), &looking.scope()};
  Reader reader;
  auto session = std::make_unique<api::StreamSession>(looking.scope(), reader);
  std::array<std::uint64_t, 600> answers{};
  for (std::uint64_t i = 0; i < count; ++i) {
    const api::Request request = generator.next();
    api::Response response = bench::handle(line, request, {&recordings, 1});
    const bool has_body = response.status != 204;
    const bool is_json = response.content_type == "application/json";
    if (response.more) {  // of a recording: reads only a part of it
      for (int part = 0; part < 4 && !response.more().empty(); ++part) {
      }
    }
    if (response.status >= 500 ||
        (has_body ? is_json && !nlohmann::json::accept(response.body) : !response.body.empty())) {
      std::printf("request %llu of seed %llu: status %u, body %s\n", static_cast<unsigned long long>(i),
                  static_cast<unsigned long long>(seed), response.status, response.body.c_str());
      return 1;
    }
    ++answers[response.status];
    // The same on the stream: it must refuse invalid messages, and its output must be valid JSON texts and frames.
    session->receive(generator.message(), std::chrono::steady_clock::time_point(std::chrono::seconds(i)));
    if (!reader.error.empty()) {
      std::printf("message %llu of seed %llu: %s\n", static_cast<unsigned long long>(i),
                  static_cast<unsigned long long>(seed), reader.error.c_str());
      return 1;
    }
    if (i % 256 == 0) session = std::make_unique<api::StreamSession>(looking.scope(), reader);
    if (i % 64 == 0) line.run_until(line.now() + std::chrono::microseconds(700));
    if (i % 4096 == 0) {  // powers axes on again that a request has switched off
      for (const auto& axis : line.axes()) axis->power_on(line.now());
    }
  }
  for (std::size_t status = 0; status < answers.size(); ++status) {
    if (answers[status] != 0) std::printf("%zu: %llu\n", status, static_cast<unsigned long long>(answers[status]));
  }
  return 0;
}
