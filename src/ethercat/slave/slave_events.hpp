#pragma once

#include "dictionary/abort_code.hpp"
#include "dictionary/entry.hpp"
#include "ethercat/slave/al_status.hpp"
#include "ethercat/time.hpp"

namespace servodrome::ethercat {

// Effects of the bus on a device. All calls come from within Slave::start and Slave::poll.
class SlaveEvents {
 public:
  // Called when the checks of the stack have passed. A code other than `none` refuses the change.
  virtual AlStatusCode may_change(AlState /*from*/, AlState /*to*/) { return AlStatusCode::none; }
  // The state has changed; `cause` is the reason if the master did not request it. Leaving Operational ends the
  // exchange of outputs.
  virtual void state_changed(AlState /*from*/, AlState /*to*/, AlStatusCode /*cause*/, Time /*now*/) {}
  // Called after the outputs of a cycle were copied into the objects. A slave without outputs is called in every cycle;
  // others are not called in a cycle without new outputs. Values that the device writes into its objects now are sent
  // with the inputs of this cycle.
  virtual void process_data(Time /*now*/) {}
  // 1010h and 1011h, for devices that have them (`storage_section`). Returns hardware_error on failure.
  virtual dictionary::AbortCode store(dictionary::Area) { return dictionary::AbortCode::hardware_error; }
  virtual dictionary::AbortCode restore_defaults(dictionary::Area) { return dictionary::AbortCode::hardware_error; }
  // SYNC0 came. Called after the outputs were copied and `process_data` ran.
  virtual void sync0(Time /*now*/) {}

 protected:
  ~SlaveEvents() = default;
};

}  // namespace servodrome::ethercat
