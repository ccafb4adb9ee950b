#pragma once

#include <cmath>

#include "jmc_rig.hpp"

// A JMC EC drive in Operational with PDOs that contain the set-points and actual values of all modes.
namespace servodrome::test {

struct JmcBus : JmcRig {
  struct Out {
    static constexpr std::size_t controlword = 0, mode = 2, position = 3, velocity = 7, torque = 11;
  };
  struct In {
    static constexpr std::size_t statusword = 0, mode = 2, position = 3, velocity = 7, torque = 11, inputs = 13,
                                 error = 15;
  };

  explicit JmcBus(std::string_view rating = products::jmc_ec::default_rating) : JmcRig(rating) {}
  JmcBus(const plant::Parameters& parameters, const products::Settings& settings) : JmcRig(parameters, settings) {}

  void map(std::uint16_t pdo, std::initializer_list<std::uint32_t> entries) {
    ASSERT_EQ(download(pdo, 0, 0, 1), dictionary::AbortCode::none);
    std::uint8_t sub = 0;
    for (const std::uint32_t entry : entries) {
      ASSERT_EQ(download(pdo, ++sub, entry, 4), dictionary::AbortCode::none) << std::hex << entry;
    }
    ASSERT_EQ(download(pdo, 0, sub, 1), dictionary::AbortCode::none);
  }
  // `sync0_ns` 0: free run.
  void connect(std::uint32_t sync0_ns = 0) {
    to_pre_operational();
    map(0x1600, {0x60400010, 0x60600008, 0x607A0020, 0x60FF0020, 0x60710010});
    map(0x1A00, {0x60410010, 0x60610008, 0x60640020, 0x606C0020, 0x60770010, 0x60FD0010, 0x603F0010});
    if (sync0_ns != 0) {
      start_sync0(sync0_ns);
      period_ms = 1e-6 * sync0_ns;
    }
    set_process_data();
    ASSERT_EQ(request(4), good(4));
    cycles(20);
    write(ethercat::reg::al_control, little_endian(std::uint16_t{8}));
    cycles(20);
    ASSERT_EQ(al_status(), good(8));
  }
  void cycles(int count, const std::function<void(int)>& prepare = {}) { run_cycles(count, period_ms, prepare); }
  void word(std::uint16_t controlword, int for_cycles = 3) {
    put<std::uint16_t>(Out::controlword, controlword);
    cycles(for_cycles);
  }
  std::uint16_t status_in() const { return input<std::uint16_t>(In::statusword); }
  unsigned state() const { return status_in() & 0x6FU; }
  std::int32_t position() const { return input<std::int32_t>(In::position); }
  std::int32_t velocity() const { return input<std::int32_t>(In::velocity); }
  // Brings the drive to Operation enabled in `mode`, at its present position.
  void enable_in(std::int8_t mode) {
    put<std::int8_t>(Out::mode, mode);
    put<std::int32_t>(Out::position, position());
    word(0x06);
    ASSERT_EQ(state(), 0x21U);
    word(0x07, 110);  // the brake takes P01-30
    ASSERT_EQ(state(), 0x23U);
    word(0x0F);
    ASSERT_EQ(state(), 0x27U);
    ASSERT_EQ(input<std::int8_t>(In::mode), mode);
  }
  // Ticks until the condition holds, while the bus runs every millisecond; -1: not within the limit.
  std::int64_t run_bus_until(const std::function<bool()>& condition, double limit_ms) {
    const std::int64_t start = ticks();
    while (!condition()) {
      if (static_cast<double>(ticks() - start) >= 16.0 * limit_ms) return -1;
      if ((ticks() - start) % 16 == 0) exchange();
      tick();
    }
    return ticks() - start;
  }
  // Waits until the axis no longer moves at all.
  void settle() { cycles(600); }

  double period_ms = 1.0;
  bool bit(unsigned number) const { return (status_in() >> number & 1U) != 0; }
};

}  // namespace servodrome::test
