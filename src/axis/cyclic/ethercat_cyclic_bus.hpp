#pragma once

#include <deque>
#include <vector>

#include "axis/cyclic/cyclic_bus.hpp"
#include "master/ethercat/operation.hpp"

namespace servodrome::master {

struct EthercatCyclicOptions {
  bool stops_drives = true;  // true: the destructor stops drives that are still enabled
  bool watches = false;      // true: on_cycle() is for a caller that only watches the inputs, beside another program
  Time brake_delay{};        // the longest of the drives (Axis402::brake_delay()): added to the 2 s of the destructor
};

// The slaves of an EtherCAT operation as a CyclicBus. If a working counter of a cycle is wrong, the cycle counts as
// missed for all slaves, because one counter covers several slaves.
class EthercatCyclicBus final : public CyclicBus {
 public:
  // Both must outlive this; the operation must be in OP. Without `stops_drives` the operation may end before this
  // object, if no other function than the destructor is called after that.
  EthercatCyclicBus(EthercatMaster& master, EthercatOperation& operation, const EthercatCyclicOptions& options = {});
  // Removes the program, commands a quick stop to drives that are still enabled, and runs cycles until these have
  // braked and closed their brakes, for at most 2 s and the brake delay. Only drives whose image() was called are
  // stopped, since others may belong to another part of the program. Ignores all exceptions. Without `stops_drives` it
  // does nothing.
  ~EthercatCyclicBus() override;
  EthercatCyclicBus(const EthercatCyclicBus&) = delete;
  EthercatCyclicBus& operator=(const EthercatCyclicBus&) = delete;

  Time period() const override { return exchange_.period(); }
  Time now() const override { return master_.now(); }
  void wait(Time span) override { master_.wait(span); }
  std::size_t size() const override { return images_.size(); }
  ProcessImage& image(std::size_t drive) override {
    is_used_[drive] = true;
    return images_[drive];
  }
  bool is_fresh(std::size_t) const override { return exchange_.inputs_are_fresh(); }
  void on_cycle(std::function<void()> action) override {
    options_.watches ? exchange_.on_inputs(std::move(action)) : exchange_.on_cycle(std::move(action));
  }
  void check() const override { exchange_.check(); }
  CycleCounters counters() const override;
  Time inputs_taken() const override { return exchange_.sent(); }

 private:
  void stop_drives();
  bool can_stop(std::size_t drive) const;

  EthercatMaster& master_;
  CyclicExchange& exchange_;
  EthercatCyclicOptions options_;
  std::deque<SlaveImage> images_;
  std::vector<bool> is_used_;  // image() was called
};

struct EthercatAxisSetUp {
  // Period to write to 60C2h, if the slave has that object: a drive that interpolates over another time does not run
  // smoothly.
  std::optional<Time> period{};
  bool touch_probe = false;  // 60B8h to 60BBh
};

// Maps the objects that a cyclic axis needs in any mode into 1600h and 1A00h, and assigns only these two PDOs:
// controlword, statusword, mode, position, velocity and torque in both directions, following error, error code and
// digital inputs. Objects that the slave does not have are left out. If 6007h is 0 (no reaction to the loss of the
// master), it becomes 1 (fault), because otherwise a drive stays enabled when the cycles cease. Call it in PREOP. A
// power cycle restores the slave's own mapping, assignment and 6007h. Throws EthercatError.
void set_up_cyclic_axis(EthercatSlave& slave, const EthercatAxisSetUp& set_up);

}  // namespace servodrome::master
