#pragma once

#include <span>

#include "ethercat/esc/esc.hpp"

namespace servodrome::ethercat {

// Slave controllers in series and the cables between them: the path of a frame, its delay, and the port at which it
// returns (ETG.1000.3 clause 4). A cable from the last slave to a second port of the master makes the segment a ring,
// which still works with one break.
class Segment {
 public:
  struct Slave {
    Esc* esc = nullptr;
    // Delays from the slave before it (or the master) to this slave, and back: cable, PHYs and the path through the
    // controller.
    Time forward{0};
    Time backward{0};
    bool cable = true;  // the cable in front of this slave is connected
    bool powered = true;
    bool corrupts_next = false;  // the next frame arrives at this slave with a wrong FCS
  };
  enum class Port : std::uint8_t { primary, secondary };  // ports of the master
  enum class Exit : std::uint8_t { lost, primary, secondary };
  enum class Encapsulation : std::uint8_t {
    ethernet,  // a whole frame without FCS
    payload,   // the content of a UDP packet
  };
  struct Passage {
    Time leaves{0};  // time at which the first bit is back at the master
    Exit exit = Exit::lost;
    FrameKind kind = FrameKind::ethercat;  // kind of the frame that entered
  };

  // Parses a frame of either encapsulation: parse_ethernet or parse_payload.
  static FrameKind parse(std::span<std::uint8_t> bytes, Encapsulation encapsulation, Frame& frame) {
    return encapsulation == Encapsulation::ethernet ? parse_ethernet(bytes, frame) : parse_payload(bytes, frame);
  }

  // Does not own the slaves; they must outlive the segment. Controllers need a power_on before their first frame.
  explicit Segment(std::span<Slave> slaves) : slaves_(slaves) { update_links(); }

  // Sends a frame into the segment at `now`; changes it in place. Exit `lost`: the frame does not return.
  Passage process(std::span<std::uint8_t> bytes, Time now, Port entry = Port::primary,
                  Encapsulation encapsulation = Encapsulation::ethernet);

  // Cable 0 joins the master and the first slave, cable n joins slaves n - 1 and n. The cable behind the last slave
  // goes to the master's second port; it is not connected at first.
  void set_cable(std::size_t cable, bool connected);
  bool cable(std::size_t n) const { return n < slaves_.size() ? slaves_[n].cable : ring_cable_; }
  // Off: its neighbours lose their link to it. On: its controller starts from power-on.
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
