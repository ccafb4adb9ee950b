// Random requests against the bench API's handler, without sockets. Not coverage-guided: a fixed pseudo-random
// sequence, so that a failure is found again by its seed. Run it in a build with sanitizers:
//
//   bench_api_fuzz COUNT [SEED]
//
// Exit status 1 if an answer is not what the API promises: a status below 500, a JSON body or none with 204.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "../tests/line/bench_requests.hpp"
#include "../tests/line/support.hpp"

int main(int argc, char** argv) {
  using namespace servodrome::line;
  const std::uint64_t count = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1'000'000;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  test::RequestGenerator generator(seed);
  Line line(test::settings_of(test::two_axes_and_rs485));
  std::array<std::uint64_t, 600> answers{};
  for (std::uint64_t i = 0; i < count; ++i) {
    const bench::Request request = generator.next();
    const bench::Response response = bench::handle(line, request);
    const bool has_body = response.status != 204;
    if (response.status >= 500 || (has_body ? !nlohmann::json::accept(response.body) : !response.body.empty())) {
      std::printf("request %llu of seed %llu: status %u, body %s\n", static_cast<unsigned long long>(i),
                  static_cast<unsigned long long>(seed), response.status, response.body.c_str());
      return 1;
    }
    ++answers[response.status];
    if (i % 64 == 0) line.run_until(line.now() + std::chrono::microseconds(700));
    if (i % 4096 == 0) {  // something to work on again
      for (const auto& axis : line.axes()) axis->power_on(line.now());
    }
  }
  for (std::size_t status = 0; status < answers.size(); ++status) {
    if (answers[status] != 0) std::printf("%zu: %llu\n", status, static_cast<unsigned long long>(answers[status]));
  }
  return 0;
}
