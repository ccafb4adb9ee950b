#include <atomic>
#include <cstdlib>
#include <gtest/gtest.h>
#include <new>

#include "line/bench/scope/line_scope.hpp"
#include "line/line.hpp"
#include "line/line_file.hpp"
#include "links/can/memory_port.hpp"
#include "support.hpp"

// Counts all allocations of the program. There must be none while a line runs.
namespace {
std::atomic<std::uint64_t> allocations{0};
}  // namespace

// Not inlined, because GCC 12 would otherwise report new and delete as mismatched.
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t alignment) {
  ++allocations;
  const auto align = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(align, (size + align - 1) / align * align)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace servodrome::line {
namespace {

canopen::Frame download(std::uint8_t node, std::uint16_t index, std::uint8_t size, std::uint32_t value) {
  canopen::Frame frame{.id = 0x600U + node, .length = 8};
  frame.data = {static_cast<std::uint8_t>(0x23 | (4 - size) << 2),
                static_cast<std::uint8_t>(index),
                static_cast<std::uint8_t>(index >> 8),
                0,
                static_cast<std::uint8_t>(value),
                static_cast<std::uint8_t>(value >> 8),
                static_cast<std::uint8_t>(value >> 16),
                static_cast<std::uint8_t>(value >> 24)};
  return frame;
}

TEST(Allocation, NothingIsAllocatedWhileALineRuns) {
  const LineFile file = parse_line_file(default_line_text(), "default.toml", all_products());
  ASSERT_TRUE(file.diagnostics.empty());
  Line line(file.settings);
  links::MemoryPort master(line.buses()[0]->bus);
  line.run_until(std::chrono::milliseconds(10));
  while (master.receive()) {
  }

  const std::uint64_t before = allocations;
  const auto send = [&](const canopen::Frame& frame) {
    master.send(frame, line.now());
    line.run_until(line.now() + std::chrono::milliseconds(5));
  };
  canopen::Frame start{.id = 0, .length = 2};
  start.data = {1, 0};
  send(start);
  for (const std::uint8_t node : {std::uint8_t{1}, std::uint8_t{2}}) {
    send(download(node, 0x6060, 1, 1));
    send(download(node, 0x6081, 4, 500000));
    send(download(node, 0x607A, 4, 300000));
    send(download(node, 0x1017, 2, 10));
    for (const std::uint32_t word : {0x06U, 0x07U, 0x0FU, 0x1FU}) {
      send(download(node, 0x6040, 2, word));
      if (word == 0x07U) line.run_until(line.now() + std::chrono::milliseconds(200));  // the DC link charges
    }
  }
  canopen::Frame sync{.id = 0x80, .length = 0};
  std::size_t received = 0;
  for (int i = 0; i < 1000; ++i) {
    send(sync);
    canopen::Frame upload{.id = 0x602, .length = 8};
    upload.data = {0x40, 0x64, 0x60, 0};
    send(upload);
    if (i == 500) line.axes()[0]->plant().inject(plant::Injection::encoder_loss, true);  // causes a fault and its EMCY
    while (master.receive()) ++received;
  }
  EXPECT_EQ(allocations - before, 0U);
  EXPECT_GT(received, 500U);
  EXPECT_NE(line.axes()[0]->plant().position_counts(), 0);
}

// Streams and recordings sample every tick. They allocate their memory before.
TEST(Allocation, NothingIsAllocatedWhileALineIsLookedAt) {
  const LineFile file = parse_line_file(default_line_text(), "default.toml", all_products());
  ASSERT_TRUE(file.diagnostics.empty());
  Line line(file.settings);
  bench::LineScope looking(line);
  bench::LineSource source(line);
  api::Recordings& recordings = looking.scope().recordings();
  const std::string axis = line.axes()[0]->settings().name;
  const auto recording = [&](const std::string& what, const std::string& trigger) -> const api::Recording& {
    return recordings.add(source, R"({"channels": [{"axis": ")" + axis + R"(", )" + what +
                                      R"(}], "duration_ms": 400,)" + R"("pre_ms": 100, "trigger": )" + trigger + "}");
  };
  const auto& done = recording(R"("signal": "velocity_rpm")", R"({"kind": "now"})");
  const auto& armed = recording(R"("object": "6041:00")", R"({"kind": "level", "level": 1e9})");
  const std::shared_ptr<api::Samples> tap = source.signal(axis, "position_counts").open(1);
  line.run_until(std::chrono::milliseconds(500));  // the drives have started, the first recording is done

  const std::uint64_t before = allocations;
  line.run_until(std::chrono::milliseconds(1300));
  EXPECT_EQ(allocations - before, 0U);
  EXPECT_EQ(done.state(), api::RecordingState::done);
  EXPECT_EQ(armed.state(), api::RecordingState::armed);
  EXPECT_EQ(tap->due(), 1300 * 16 + 1);
}

// Requests the statusword of the drive on the RS485 line repeatedly.
class Poller final : public links::SerialStation {
 public:
  explicit Poller(links::SerialLine& line) : line_(line), port_(line.attach(*this)) {}
  ~Poller() override { line_.detach(port_); }
  Poller(const Poller&) = delete;
  Poller& operator=(const Poller&) = delete;

  void ask() { line_.transmit(port_, request_, line_.now()); }
  void receive(std::uint8_t, bool, Time) override { ++received; }

  std::size_t received = 0;

 private:
  links::SerialLine& line_;
  links::SerialPortId port_;
  std::array<std::uint8_t, 8> request_ = [] {
    std::array<std::uint8_t, 8> request = {2, 3, 1, 0, 0, 1};
    modbus::seal_rtu_frame(request, 6);
    return request;
  }();
};

TEST(Allocation, NothingIsAllocatedWhileAnRs485LineRuns) {
  Line line(test::settings_of(test::two_axes_and_rs485));
  line.run_until(std::chrono::milliseconds(10));
  Poller poller(line.find_serial_bus("rs")->line);
  const std::uint64_t before = allocations;
  for (int i = 0; i < 1000; ++i) {
    poller.ask();
    line.run_until(line.now() + std::chrono::milliseconds(5));
  }
  EXPECT_EQ(allocations - before, 0U);
  EXPECT_EQ(poller.received, 7000U);
}

}  // namespace
}  // namespace servodrome::line
