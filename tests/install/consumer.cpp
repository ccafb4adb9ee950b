// Moves a drive by ten revolutions in virtual time, without a bus: an example of a test of motion code.
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "drive/drive.hpp"
#include "line/line.hpp"
#include "line/line_file.hpp"
#include "line/registry.hpp"

using namespace servodrome;
using namespace std::chrono_literals;

int main() {
  const line::LineFile file = line::parse_line_file(R"(
    clock = "virtual"
    [[bus]]
    name = "can0"
    [[axis]]
    name = "x"
    product = "generic402"
    node = 1
  )",
                                                    "consumer.toml", line::all_products());
  if (!file.diagnostics.empty()) return EXIT_FAILURE;
  line::Line line(file.settings);
  line::Axis& axis = *line.find_axis("x");
  dictionary::Dictionary& objects = axis.device().dictionary();

  objects.set_number(0x6060, 0, 1);  // profile position
  for (const int controlword : {0x06, 0x07, 0x0F}) {
    objects.set_number(0x6040, 0, controlword);
    line.run_until(line.now() + 500ms);
  }
  const std::int64_t start = axis.plant().position_counts();
  objects.set_number(0x607A, 0, 10 * 131072);  // target position
  objects.set_number(0x6040, 0, 0x5F);         // relative, new set-point
  line.run_until(line.now() + 20s);

  const std::int64_t moved = axis.plant().position_counts() - start;
  const std::string_view state = drive::name(axis.device().drive().state());
  std::printf("%s, moved by %lld counts\n", state.data(), static_cast<long long>(moved));
  return state == "operation enabled" && std::llabs(moved - 10 * 131072) <= 3 ? EXIT_SUCCESS : EXIT_FAILURE;
}
