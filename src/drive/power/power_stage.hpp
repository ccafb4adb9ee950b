#pragma once

#include <cstdint>

namespace servodrome::drive {

// The power stage with the brake of the motor: what is switched on, and the waits for the brake. Times are cycles of
// the position loop.
class PowerStage {
 public:
  bool energised() const { return step_ != Step::off; }
  bool is_on() const { return step_ == Step::on; }  // energised, and the brake has opened
  bool brake_opens() const { return step_ == Step::brake_opens; }
  bool brake_closes() const { return step_ == Step::brake_closes; }
  bool brake_released() const { return brake_opens() || is_on() || coasting_cycles_ != 0; }
  std::uint32_t closed_cycles() const { return closed_cycles_; }  // since the brake got the command to close

  void switch_on(std::uint32_t opening_cycles) {
    step_ = Step::brake_opens;
    cycles_ = opening_cycles;
    coasting_cycles_ = 0;
  }
  void switch_off() { step_ = Step::off; }
  // After the power is off, the brake stays open until a fast axis is slow enough, but for at most `cycles`.
  void let_coast(std::uint32_t cycles) { coasting_cycles_ = cycles; }
  void close_brake(std::uint32_t closing_cycles) {
    step_ = Step::brake_closes;
    cycles_ = closing_cycles;
  }
  void reset() {
    step_ = Step::off;
    coasting_cycles_ = 0;
  }

  // One cycle. `is_fast`: too fast for the brake.
  void step(bool is_fast) {
    if (coasting_cycles_ != 0 && (--coasting_cycles_ == 0 || !is_fast)) coasting_cycles_ = 0;
    if (!brake_opens() || cycles_-- != 0) return;
    step_ = Step::on;
    cycles_ = 0;
  }
  // One cycle of a brake that closes. Returns true if it now holds the axis.
  bool step_closing() { return brake_closes() && cycles_-- == 0; }
  // What the brake's output commands in this cycle; the bus may control it directly.
  void note_brake(bool released) { closed_cycles_ = released ? 0 : closed_cycles_ + 1; }
  void forget_brake() { closed_cycles_ = 0; }

 private:
  enum class Step : std::uint8_t { off, brake_opens, on, brake_closes };

  Step step_ = Step::off;
  std::uint32_t cycles_ = 0;  // that the present step still needs
  std::uint32_t coasting_cycles_ = 0;
  std::uint32_t closed_cycles_ = 0;
};

}  // namespace servodrome::drive
