// Runs N SYNC cycles with one RPDO and one TPDO, of two objects each. Instructions per cycle: see callgrind_sdo.cpp.
#include <cstdio>
#include <cstdlib>

#include "callgrind_device.hpp"

int main(int argc, char** argv) {
  using namespace servodrome;
  const long cycles = argc > 1 ? std::atol(argv[1]) : 1000;
  static bench::Device device;
  canopen::Frame rpdo{.id = 0x201, .length = 6, .data = {0x0F, 0, 0, 0, 0, 0}};
  const canopen::Frame sync{.id = 0x080};
  canopen::Time now{0};
  unsigned tpdos = 0;
  for (long i = 0; i < cycles; ++i) {
    now += std::chrono::milliseconds(1);
    rpdo.data[2] = static_cast<std::uint8_t>(i);
    device.node.receive(rpdo, now);
    device.node.receive(sync, now);
    device.objects.position_actual = device.objects.target_position;
    device.node.process_image_updated(now);
    device.node.poll(now);
    canopen::Frame frame;
    while (device.node.take(frame)) ++tpdos;
  }
  std::printf("%ld cycles, %u TPDOs\n", cycles, tpdos);
  return tpdos == static_cast<unsigned>(cycles) ? 0 : 1;
}
