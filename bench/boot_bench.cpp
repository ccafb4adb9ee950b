// Measures the time from program start until 64 drives on one bus have booted, and the memory of an axis; virtual time,
// one thread.
#include <chrono>
#include <cstdio>
#include <string>

#include "line/line.hpp"
#include "line/line_file.hpp"
#include "links/can/memory_port.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"

int main() {
  using namespace servodrome;
  constexpr int axes = 64;
  std::string text = "clock = \"virtual\"\n[[bus]]\nname = \"can0\"\n";
  for (int i = 1; i <= axes; ++i) {
    text += "[[axis]]\nname = \"a" + std::to_string(i) + "\"\nproduct = \"" + (i % 2 != 0 ? "ismc" : "generic402") +
            "\"\nbus = \"can0\"\nnode = " + std::to_string(i) + "\n";
  }
  const auto start = std::chrono::steady_clock::now();
  const line::LineFile file = line::parse_line_file(text, "bench", line::all_products());
  if (!file.diagnostics.empty()) {
    std::fprintf(stderr, "the line file is wrong: %s\n", file.diagnostics[0].what.c_str());
    return 1;
  }
  line::Line line(file.settings);
  links::MemoryPort master(line.buses()[0]->bus);
  int boot_ups = 0;
  while (boot_ups < axes && line.now() < std::chrono::seconds(10)) {
    line.step();
    while (const auto received = master.receive()) {
      const bool boot_up =
          (received->frame.id & 0x780U) == 0x700 && received->frame.length == 1 && received->frame.data[0] == 0;
      if (boot_up) ++boot_ups;
    }
  }
  const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - start;
  std::printf("%d of %d boot-ups after %.1f ms (aim: 500 ms), %.3f ms of bus time\n", boot_ups, axes, elapsed.count(),
              std::chrono::duration<double, std::milli>(line.now()).count());
  std::printf("bytes per axis: ismc %zu, generic402 %zu, plant %zu\n", sizeof(products::Ismc),
              sizeof(products::Generic402), sizeof(plant::Plant));
  return boot_ups == axes ? 0 : 1;
}
