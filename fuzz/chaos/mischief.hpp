#pragma once

#include <deque>

#include "links/can/interposer.hpp"
#include "links/can/memory_port.hpp"
#include "links/ethercat/interposer.hpp"
#include "world.hpp"

namespace servodrome::chaos {

// Disturbs a line: drops, doubles, corrupts and delays frames, cuts the power of axes and pulls cables.
class Mischief {
 public:
  explicit Mischief(World& world);
  ~Mischief();
  Mischief(const Mischief&) = delete;
  Mischief& operator=(const Mischief&) = delete;

  // To be called before each tick.
  void tick();
  // Ends all disturbances: restores power and cables.
  void end();

  struct Counts {
    std::uint64_t frames = 0;
    std::uint64_t dropped = 0;
    std::uint64_t doubled = 0;
    std::uint64_t corrupted = 0;
    std::uint64_t delayed = 0;
  };
  Counts counts() const;

 private:
  // Doubles frames between a drive and its CAN bus; the bus itself makes the other disturbances.
  class CanDoubler final : public links::CanInterposer {
   public:
    CanDoubler(Mischief& mischief, Subject& subject) : mischief_(mischief), subject_(subject) {}
    bool lets_out(const canopen::Frame&, Time) override { return true; }
    void sent(const canopen::Frame& frame, Time at) override;
    bool lets_in(canopen::Frame& frame, Time at) override;
    void deliver(Time now);

   private:
    Mischief& mischief_;
    Subject& subject_;
    std::deque<canopen::Frame> again_;
  };
  // Drops, doubles and delays frames of the EtherCAT segment.
  class SegmentInterposer final : public links::EthercatInterposer {
   public:
    explicit SegmentInterposer(Mischief& mischief) : mischief_(mischief) {}
    Entry enters(std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at) override;
    Return returns(std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at) override;

   private:
    Mischief& mischief_;
  };
  // Power or cable of an axis: next change, and its present state.
  struct Switch {
    std::int64_t next = 0;  // tick
    bool off = false;
  };

  bool draws() { return !world_.quiet && random_.unit() < world_.options().share; }
  std::int64_t draw_ticks(double mean_s);
  void set_power(Subject& subject, bool on);
  void set_cable(Subject& subject, bool connected);
  // All axes that a disturbance of this axis also affects.
  template <typename Action>
  void for_all_struck(const Subject& subject, Action action);

  World& world_;
  Random random_;
  std::deque<CanDoubler> doublers_;
  std::deque<links::MemoryPort> ports_;  // one on each CAN bus, for doubled frames
  SegmentInterposer at_segment_{*this};
  std::vector<Switch> power_;
  std::vector<Switch> cable_;
  std::uint64_t doubled_ = 0;
};

}  // namespace servodrome::chaos
