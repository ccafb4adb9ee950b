#pragma once

#include "canopen/frame.hpp"
#include "links/time.hpp"

namespace servodrome::links {

// Stands between a drive and its CAN controller, and changes the frames that pass, for tests of masters.
class CanInterposer {
 public:
  // The drive wants to send `frame` next. Returns true if the frame goes to the bus unchanged. Otherwise the interposer
  // has taken it, and the drive believes that it was sent. Called for each frame once or more often, but not while it
  // is on the wire.
  virtual bool lets_out(const canopen::Frame& frame, Time now) = 0;
  // A frame that lets_out() passed is complete on the wire.
  virtual void sent(const canopen::Frame& frame, Time at) = 0;
  // The drive is about to receive `frame`. Returns true if the drive gets the frame, which may be changed.
  virtual bool lets_in(canopen::Frame& frame, Time at) = 0;

 protected:
  ~CanInterposer() = default;
};

}  // namespace servodrome::links
