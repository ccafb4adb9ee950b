#pragma once

#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "axis/cyclic/can_cyclic_bus.hpp"
#include "studio/cycle_sampler.hpp"
#include "studio/heard_pdos.hpp"

namespace servodrome::studio {

class OpenBus;

// The TPDOs of drives on CAN that are set up for recordings: with SYNC, as the command `scope` does. Restores what the
// drives had before, also later if a drive does not answer at the end. Used by the thread of the bus.
class TpdoRecorder {
 public:
  struct Drive {
    std::size_t drive;  // of the bus
    master::CanDrive exchanged;
  };
  struct Wish {
    std::vector<Drive> drives{};
    master::Time period{};       // of SYNC
    std::weak_ptr<void> wanted;  // ends with the last recording
  };

  TpdoRecorder(CycleSampler& cycle, HeardPdos& pdos) : cycle_(cycle), pdos_(pdos) {}

  // Sets up the TPDOs; samples then get the inputs of each SYNC. `between` is called between two steps, also at the
  // end: others may use the bus. Throws MasterError after restoring what was changed.
  void begin(OpenBus& open, const Wish& wish, const std::function<void()>& between);
  // No recording wants the TPDOs any more, or a drive does not send them.
  bool is_over() const;
  bool has(std::size_t drive) const;
  bool runs() const { return running_ != nullptr; }
  // Restores the drives. A drive that does not answer is restored by restore() when it answers.
  void end();
  bool must_restore(std::size_t drive) const { return left_.contains(drive) && !has(drive); }
  // Restores those TPDOs of the drive that still are as a recording has left them. Throws MasterError.
  void restore(OpenBus& open, std::size_t drive, const std::function<void()>& between);

 private:
  struct Running {
    std::unique_ptr<master::CanCyclicBus> bus;
    std::vector<std::size_t> drives;
    std::weak_ptr<void> wanted;
  };
  struct Changed {
    master::PdoParameters before;
    master::PdoParameters during;
    bool is_begun = false;  // restore() has been interrupted
  };

  CycleSampler& cycle_;
  HeardPdos& pdos_;
  std::unique_ptr<Running> running_;
  std::map<std::size_t, std::vector<Changed>> left_;  // of each drive that is set up, or still must be restored
};

}  // namespace servodrome::studio
