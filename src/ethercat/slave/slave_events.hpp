#pragma once

#include "dictionary/abort_code.hpp"
#include "dictionary/entry.hpp"
#include "ethercat/slave/al_status.hpp"
#include "ethercat/time.hpp"

namespace servodrome::ethercat {

// What the bus does to a device. All calls come from inside Slave::start and Slave::poll.
class SlaveEvents {
 public:
  // The checks of the stack were passed; anything but `none` refuses the change with that code.
  virtual AlStatusCode may_change(AlState /*from*/, AlState /*to*/) { return AlStatusCode::none; }
  // The state is another one; `cause` is why, if the master did not ask for it. Leaving Operational ends the exchange
  // of outputs.
  virtual void state_changed(AlState /*from*/, AlState /*to*/, AlStatusCode /*cause*/, Time /*now*/) {}
  // The outputs of a cycle (if there are any) are in the objects, not called for one without them; what the device puts
  // into its objects now goes out with the inputs.
  virtual void process_data(Time /*now*/) {}
  // 1010h and 1011h, for devices that have them (`storage_section`). Errors: hardware_error.
  virtual dictionary::AbortCode store(dictionary::Area) { return dictionary::AbortCode::hardware_error; }
  virtual dictionary::AbortCode restore_defaults(dictionary::Area) { return dictionary::AbortCode::hardware_error; }
  // SYNC0, after the outputs were taken over and `process_data` ran.
  virtual void sync0(Time /*now*/) {}

 protected:
  ~SlaveEvents() = default;
};

}  // namespace servodrome::ethercat
