// Carries out N expedited SDO uploads and reads each answer. Instructions per upload: run it under `valgrind
// --tool=callgrind` with two values of N; divide the difference of the totals by the difference of the two values.
#include <cstdio>
#include <cstdlib>

#include "callgrind_device.hpp"

int main(int argc, char** argv) {
  using namespace servodrome;
  const long uploads = argc > 1 ? std::atol(argv[1]) : 1000;
  static bench::Device device;
  const canopen::Frame request{.id = 0x601, .length = 8, .data = {0x40, 0x41, 0x60, 0, 0, 0, 0, 0}};
  canopen::Time now{0};
  unsigned sum = 0;
  for (long i = 0; i < uploads; ++i) {
    now += std::chrono::microseconds(500);
    device.node.receive(request, now);
    device.node.poll(now);
    canopen::Frame answer;
    while (device.node.take(answer)) sum += answer.data[4];
  }
  std::printf("%ld uploads, checksum %u\n", uploads, sum);
  return sum == static_cast<unsigned>(uploads) * 0x37U ? 0 : 1;
}
