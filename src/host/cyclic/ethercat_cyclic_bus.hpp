#pragma once

#include <deque>

#include "host/cyclic/cyclic_bus.hpp"
#include "host/ethercat/operation.hpp"

namespace servodrome::host {

// The slaves of an EtherCAT operation. A cycle whose working counters are not all right is missed by all of them: one
// counter is for many.
class EthercatCyclicBus final : public CyclicBus {
 public:
  // Both outlive this; the operation is in OP.
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
  // 60C2h is set to it, where there is one: a drive that interpolates over another time does not run smoothly.
  std::optional<Time> period{};
  bool touch_probe = false;  // 60B8h to 60BBh
};

// Maps what a cyclic axis of any mode exchanges into 1600h and 1A00h, and assigns these alone: control- and statusword,
// mode, position, velocity, torque each way, following error, error code, digital inputs. What the slave does not have
// is left out. In PREOP; mappings and assignments are the slave's own again after its power was off. Throws
// EthercatError.
void set_up_cyclic_axis(EthercatSlave& slave, const EthercatAxisSetUp& set_up);

}  // namespace servodrome::host
