#pragma once

#include "master/ethercat/slave.hpp"

namespace servodrome::master {

// If 6007h (abort connection option code) of the slave is 0 (no action), writes 1 (malfunction), because otherwise an
// axis continues its last command when the cycles cease. Returns true if it wrote. Does nothing if the drive refuses
// the value or does not have the object. Throws EthercatError.
bool react_to_lost_master(EthercatSlave& slave);

// Keeps 6007h changed in this way as long as this object exists. Create it before the slave goes to OP, and destroy it
// after the slave has left OP.
class LostMasterReaction {
 public:
  // `slave` must outlive this. Throws EthercatError.
  explicit LostMasterReaction(EthercatSlave& slave) : slave_(slave) { begin(); }
  ~LostMasterReaction() { end(); }
  LostMasterReaction(const LostMasterReaction&) = delete;
  LostMasterReaction& operator=(const LostMasterReaction&) = delete;

  // Writes 6007h again, for a drive that has come back from a reset or after end(). Throws EthercatError.
  void begin();
  // Restores 6007h, for example before the drive stores its objects. Returns false if 6007h stays 1 until the drive's
  // next reset: its motor is on, so that the axis must stop when the cycles cease, or the drive does not answer.
  bool end() noexcept;

 private:
  EthercatSlave& slave_;
  bool changed_ = false;
};

}  // namespace servodrome::master
