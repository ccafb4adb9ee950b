#pragma once

#include <cstdint>

namespace servodrome::drive {

// The voltage of the DC link, and for how long it has been connected.
class DcLinkWatch {
 public:
  // One cycle.
  void sample(float voltage_v) {
    rise_v_ = voltage_v - voltage_v_;
    voltage_v_ = voltage_v;
  }
  void note_connected(bool connected) { cycles_ = connected ? cycles_ + 1 : 0; }
  void forget_connection() { cycles_ = 0; }

  float voltage_v() const { return voltage_v_; }
  std::uint32_t connected_cycles() const { return cycles_; }

  // A DC link is charged if it is above its under-voltage and rises by no more than a small fraction of its voltage in
  // a millisecond. The precharge resistor, through which a motor could not be supplied, is bridged by then.
  bool charged(float under_voltage_v, double cycles_per_ms) const {
    constexpr double greatest_rise_per_ms = 0.001;
    constexpr std::uint32_t least_cycles = 2;  // until the rise is valid for a connected link
    const double greatest_rise_v = greatest_rise_per_ms / cycles_per_ms * static_cast<double>(voltage_v_);
    return cycles_ >= least_cycles && voltage_v_ >= under_voltage_v && static_cast<double>(rise_v_) <= greatest_rise_v;
  }

 private:
  std::uint32_t cycles_ = 0;  // since it was connected
  float voltage_v_ = 0.0F;
  float rise_v_ = 0.0F;  // in the last cycle
};

}  // namespace servodrome::drive
