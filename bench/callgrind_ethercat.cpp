// Sends frames through SLAVES slave controllers until each slave has been passed N times: an LRW with 16 bytes out and
// 16 bytes in of each slave, in as many frames as needed, the first frame with a BRD of the AL status. Instructions per
// slave and cycle: see callgrind_sdo.cpp, with `--toggle-collect='servodrome::ethercat::Segment::process*'`, which
// counts the parsing of the frames and all work of slaves and cables. Copying a composed frame into place is work of
// the master and is not counted.
// Usage: callgrind_ethercat SLAVES N
#include <cstdio>
#include <cstdlib>

#include "controller_line.hpp"

int main(int argc, char** argv) {
  const std::size_t count = argc > 1 ? static_cast<std::size_t>(std::atol(argv[1])) : 8;
  const long cycles = (argc > 2 ? std::atol(argv[2]) : 1000) / static_cast<long>(count);
  servodrome::ethercat::ControllerLine line(count);
  unsigned long counters = 0;
  for (long i = 0; i < cycles; ++i) counters += line.cycle();
  std::printf("%ld cycles, working counters %lu\n", cycles, counters);
  return counters == 4UL * count * static_cast<unsigned long>(cycles) ? 0 : 1;
}
