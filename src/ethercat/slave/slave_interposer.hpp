#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "ethercat/slave/al_status.hpp"
#include "ethercat/time.hpp"

namespace servodrome::ethercat {

// Makes a slave misbehave on purpose, to test how a master handles that. There is a function for each event that can be
// changed; by default it changes nothing. All calls come from within the functions of Slave that the device calls, and
// from Slave::release_mail. In a call the interposer may use Slave::post, but no other function that changes the slave.
class SlaveInterposer {
 public:
  // A master requests another state, and all checks of the stack and the device have passed. A code refuses the change,
  // even a change to Init: the slave keeps its state and shows the code with the error bit (ETG.1000.6 clause 6.4).
  virtual std::optional<AlStatusCode> refuses(AlState /*from*/, AlState /*to*/) { return std::nullopt; }

  // A master acknowledges an error in the state in which the slave is. False: the error and its code stay.
  virtual bool acknowledges() { return true; }

  // A message of the slave to the master with its header: length, address, channel, type and counter (ETG.1000.4 clause
  // 5.6). The first `length` bytes are put into the mailbox as they are. `mailbox` has the mailbox's whole length, so a
  // message can become longer, and its header can contradict its length.
  struct Mail {
    std::span<std::uint8_t> mailbox;
    std::size_t length = 0;  // bytes with the header, at most mailbox.size()
  };
  enum class Sending : std::uint8_t {
    pass,      // the message goes into the mailbox
    withhold,  // the master never gets it; the slave believes that it was sent, and its counter goes on
    hold,      // it stays in the slave until Slave::release_mail or Init; later answers wait behind it
  };
  struct Dispatch {
    Sending how = Sending::pass;
    unsigned copies = 0;  // how often the same bytes are put into the mailbox again after the master has read them
  };
  virtual Dispatch sends(Mail& /*mail*/) { return {}; }

  enum class Receipt : std::uint8_t {
    serve,    // the slave handles the message with the changes of the interposer
    discard,  // the slave does not handle the message, but empties the mailbox and stores the counter
    keep,     // the mailbox stays full. The slave calls again at its next mailbox event and in Slave::release_mail
  };
  // A message of the master; `mailbox` are all bytes of the mailbox, header included.
  virtual Receipt receives(std::span<std::uint8_t> /*mailbox*/) { return Receipt::serve; }

  // How the slave's application sees a SYNC0 pulse.
  struct Pulse {
    unsigned times = 1;  // 0: it does not see the pulse
    Time delay{};        // delay of the pulse; a delayed pulse is lost while an earlier one still waits
  };
  // Called at each SYNC0 in Safe-Operational and Operational, if SYNC0 times the exchange of process data. If the
  // application sees no pulse for two SYNC0 cycles, at least 1 ms, the slave reports 002Ch at the next frame.
  virtual Pulse sync0(Time /*now*/) { return {}; }

  // True: the slave does not copy its objects into the inputs now. The master reads the inputs of the cycle before,
  // with a correct working counter.
  virtual bool keeps_inputs(Time /*now*/) { return false; }

 protected:
  ~SlaveInterposer() = default;
};

}  // namespace servodrome::ethercat
