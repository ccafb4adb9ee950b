#pragma once

#include <deque>

#include "axis/cyclic/cyclic_bus.hpp"
#include "master/ethercat/operation.hpp"

namespace servodrome::master {

// The slaves of an EtherCAT operation as a CyclicBus. If a working counter of a cycle is wrong, the cycle counts as
// missed for all slaves, because one counter covers several slaves.
class EthercatCyclicBus final : public CyclicBus {
 public:
  // Both must outlive this; the operation must be in OP.
  EthercatCyclicBus(EthercatMaster& master, EthercatOperation& operation);

  Time period() const override { return exchange_.period(); }
  Time now() const override { return master_.now(); }
  void wait(Time span) override { master_.wait(span); }
  std::size_t size() const override { return images_.size(); }
  ProcessImage& image(std::size_t drive) override { return images_[drive]; }
  bool is_fresh(std::size_t) const override { return exchange_.inputs_are_fresh(); }
  void on_cycle(std::function<void()> action) override { exchange_.on_cycle(std::move(action)); }
  void check() const override { exchange_.check(); }
  CycleCounters counters() const override;
  Time inputs_taken() const override { return exchange_.sent(); }

 private:
  EthercatMaster& master_;
  CyclicExchange& exchange_;
  std::deque<SlaveImage> images_;
};

struct EthercatAxisSetUp {
  // Period to write to 60C2h, if the slave has that object: a drive that interpolates over another time does not run
  // smoothly.
  std::optional<Time> period{};
  bool touch_probe = false;  // 60B8h to 60BBh
};

// Maps the objects that a cyclic axis needs in any mode into 1600h and 1A00h, and assigns only these two PDOs:
// controlword, statusword, mode, position, velocity and torque in both directions, following error, error code and
// digital inputs. Objects that the slave does not have are left out. Call it in PREOP. A power cycle restores the
// slave's own mapping and assignment. Throws EthercatError.
void set_up_cyclic_axis(EthercatSlave& slave, const EthercatAxisSetUp& set_up);

}  // namespace servodrome::master
