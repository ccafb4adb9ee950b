#pragma once

#include "master/ethercat/slave.hpp"

namespace servodrome::master {

// If 6007h (abort connection option code) of the slave is 0, no action, writes 1, malfunction: without it an axis
// continues its last command when the cycles cease. Returns true if it wrote. A drive that refuses the value, or does
// not have the object, keeps its own. Throws EthercatError.
bool react_to_lost_master(EthercatSlave& slave);

// The same as long as this object exists. Create it before the slave operates, and end it after that.
class LostMasterReaction {
 public:
  // `slave` must outlive this. Throws EthercatError.
  explicit LostMasterReaction(EthercatSlave& slave) : slave_(slave) { begin(); }
  ~LostMasterReaction() { end(); }
  LostMasterReaction(const LostMasterReaction&) = delete;
  LostMasterReaction& operator=(const LostMasterReaction&) = delete;

  // Writes 6007h again, for a drive that has come back from a reset or after end(). Throws EthercatError.
  void begin();
  // Restores 6007h, for example before the drive stores its objects. A drive keeps 1 until its next reset if its motor
  // is on, so that the axis stops when the cycles cease, or if it does not answer: then returns false.
  bool end() noexcept;

 private:
  EthercatSlave& slave_;
  bool changed_ = false;
};

}  // namespace servodrome::master
