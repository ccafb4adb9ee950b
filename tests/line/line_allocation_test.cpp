// A running line takes no memory: operator new counts what is asked of it.
#include <cstdlib>
#include <gtest/gtest.h>
#include <new>

#include "support.hpp"

namespace {
std::size_t allocations = 0;
}

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace servodrome::line {
namespace {

using namespace test;

TEST(LineAllocation, NothingIsAllocatedWhileALineRuns) {
  Line line(settings_of(two_axes));
  links::MemoryPort master(line.buses()[0]->bus);
  canopen::Frame sync;
  sync.id = 0x80;
  line.run_until(10ms);
  const std::size_t before = allocations;
  for (const std::uint8_t node : {std::uint8_t{1}, std::uint8_t{2}}) {
    master.send(sdo_write(node, 0x1017, 0, 5, 2), line.now());
    line.run_until(line.now() + 2ms);
    master.send(nmt(1, node), line.now());
    line.run_until(line.now() + 2ms);
  }
  std::size_t received = 0;
  for (int i = 0; i < 500; ++i) {
    master.send(sync, line.now());
    master.send(sdo_read(1, 0x6064, 0), line.now());
    master.send(sdo_read(2, 0x6064, 0), line.now());
    line.run_until(line.now() + 2ms);
    while (master.receive()) ++received;
  }
  EXPECT_EQ(allocations, before);
  EXPECT_GT(received, 1300U);
  line.run_until(line.now() + 1s);
  EXPECT_EQ(allocations, before);
}

}  // namespace
}  // namespace servodrome::line
