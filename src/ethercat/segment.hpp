#pragma once

#include <span>

#include "ethercat/esc/esc.hpp"

namespace servodrome::ethercat {

// Slave controllers in line, and the cables between them: where a frame goes, what time it takes, where it comes back
// (ETG.1000.3 clause 4). With a cable from the last slave to a second port of the master the line is a ring that bears
// one break.
class Segment {
 public:
  struct Slave {
    Esc* esc = nullptr;
    // From the slave before (or the master) to this one and back: cable, PHYs, and the way through the controller.
    Time forward{0};
    Time backward{0};
    bool cable = true;  // in front of it
    bool powered = true;
    bool corrupts_next = false;  // the next frame to it arrives with a wrong FCS
  };
  enum class Port : std::uint8_t { primary, secondary };  // of the master
  enum class Exit : std::uint8_t { lost, primary, secondary };
  enum class Encapsulation : std::uint8_t {
    ethernet,  // a whole frame without FCS
    payload,   // the content of a UDP packet
  };
  struct Passage {
    Time leaves{0};  // when the first bit is back at the master
    Exit exit = Exit::lost;
    FrameKind kind = FrameKind::ethercat;  // what came
  };

  // Does not own the slaves, which must outlive it. Controllers need a power_on before their first frame.
  explicit Segment(std::span<Slave> slaves) : slaves_(slaves) { update_links(); }

  // A frame enters at `now`; it is changed in place. `lost`: nothing comes back.
  Passage process(std::span<std::uint8_t> bytes, Time now, Port entry = Port::primary,
                  Encapsulation encapsulation = Encapsulation::ethernet);

  // Cable 0 joins the master and the first slave, cable n the slaves n - 1 and n; the cable behind the last slave goes
  // to the master's second port and is not there at first.
  void set_cable(std::size_t cable, bool connected);
  bool cable(std::size_t n) const { return n < slaves_.size() ? slaves_[n].cable : ring_cable_; }
  // Off: no link to its neighbours. On: its controller starts anew.
  void set_powered(std::size_t slave, bool powered, Time now);

  std::span<Slave> slaves() const { return slaves_; }

 private:
  enum class Way : std::uint8_t { open, turns, ends };
  enum class Health : std::uint8_t;
  struct Travel;

  Way way_behind(const Esc& esc, const Esc* next) const;
  Way way_before(std::size_t slave) const;
  Passage enter_front(Frame& frame, FrameKind kind, Time now);
  Passage enter_back(Frame& frame, FrameKind kind, Time now);
  Travel run_forward(Frame& frame, FrameKind kind, std::size_t first, Time time);
  void run_executed(Frame& frame, Travel& travel);
  Travel run_damaged(FrameKind kind, Travel travel);
  static Health pass_damaged(Slave& slave, FrameKind kind, Health health);
  void latch_returning(const Slave* slave, Time time);
  void count_returning_error(const Slave* slave);
  void update_links();

  std::span<Slave> slaves_;
  bool ring_cable_ = false;
};

}  // namespace servodrome::ethercat
