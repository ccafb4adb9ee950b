#include "ethercat/slave/indicators.hpp"
#include "slave_rig.hpp"

// RUN and ERR (ETG.1300).
namespace servodrome::ethercat::test {
namespace ethercat_indicators_test {
namespace {

// One character per 50 ms: # is on.
std::string pattern(Blink blink, int steps) {
  std::string text;
  for (int i = 0; i < steps; ++i) text += is_lit(blink, i * 50ms) ? '#' : '.';
  return text;
}

TEST(Indicators, Patterns) {
  EXPECT_EQ(pattern(Blink::off, 8), "........");
  EXPECT_EQ(pattern(Blink::on, 8), "########");
  EXPECT_EQ(pattern(Blink::flickering, 8), "#.#.#.#.");
  EXPECT_EQ(pattern(Blink::blinking, 16), "####....####....");
  EXPECT_EQ(pattern(Blink::single_flash, 28), "####....................####");
  EXPECT_EQ(pattern(Blink::double_flash, 36), "####....####....................####");
}

class IndicatorsOfASlave : public SlaveRig {
 protected:
  Blink run() const { return run_indicator(slave.state()); }
  Blink error() const { return error_indicator(slave.error(), slave.status_code()); }
};

TEST_F(IndicatorsOfASlave, FollowStatesAndErrors) {
  EXPECT_EQ(run(), Blink::off);
  EXPECT_EQ(error(), Blink::off);
  request(4);  // not allowed from Init
  EXPECT_EQ(error(), Blink::blinking);
  request(0x11);
  EXPECT_EQ(error(), Blink::off);
  to_pre_operational();
  EXPECT_EQ(run(), Blink::blinking);
  set_process_data(7, 7);
  request(4);
  EXPECT_EQ(run(), Blink::single_flash);
  cycle();
  request(8);
  EXPECT_EQ(run(), Blink::on);
  slave.fall_back(AlState::safe_operational, AlStatusCode::synchronization_error, line.now);
  EXPECT_EQ(run(), Blink::single_flash);
  EXPECT_EQ(error(), Blink::single_flash);
  request(0x18);
  cycle();
  request(8);
  slave.fall_back(AlState::safe_operational, AlStatusCode::sync_manager_watchdog, line.now);
  EXPECT_EQ(error(), Blink::double_flash);
}

TEST(Indicators, BootstrapFlickers) { EXPECT_EQ(run_indicator(AlState::bootstrap), Blink::flickering); }

}  // namespace
}  // namespace ethercat_indicators_test
}  // namespace servodrome::ethercat::test
