#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "ethercat/segment.hpp"
#include "links/disturbance_generator.hpp"
#include "links/ethercat/disturbance.hpp"
#include "links/time.hpp"

namespace servodrome::links {

// A slave's view of the bus.
class EthercatStation {
 public:
  virtual ~EthercatStation() = default;
  // The controller that frames pass; the same as long as the station is attached.
  virtual ethercat::Esc& esc() = 0;
  // A frame passed that left something to do (Esc::calls). Called once per frame at most, with the frame's time.
  // Returns until when the station may be left alone with time, if no other frame comes.
  virtual Time frame_passed(Time at) = 0;
};

// What is between a station and the one before it, or the master: cable, PHYs, the way through the controller.
struct Hop {
  Time forward{};
  Time backward{};
};

// Sees the frames of a bus, for logs and monitors.
class EthercatObserver {
 public:
  enum class Direction : std::uint8_t { in, out };  // to the first slave, back to the master
  virtual ~EthercatObserver() = default;
  // `bytes` as the master sent them, or as they come back to it; a lost frame does not come back.
  virtual void on_frame(std::span<const std::uint8_t> bytes, ethercat::Segment::Encapsulation encapsulation,
                        Direction direction, Time at) = 0;
};

struct EthercatCounters {
  std::uint64_t frames = 0;     // that came from a master
  std::uint64_t lost = 0;       // of these, did not come back: dropped, corrupted, cut off, or destroyed by a slave
  std::uint64_t malformed = 0;  // EtherCAT frames whose datagrams do not fit into them
  std::uint64_t foreign = 0;    // of another protocol
  std::uint64_t dropped = 0;    // by a disturbance
  std::uint64_t delayed = 0;
  std::uint64_t corrupted = 0;
};

// The simulated bus: stations in line, the cables between them, and the master's one or two ports (ethercat::Segment).
// It has no clock and nothing happens on it by itself: time is what exchange() is told, and a frame passes all stations
// in that call. The same calls give the same frames and the same nanoseconds.
//
// Nothing is allocated after attach().
class EthercatBus {
 public:
  using Port = ethercat::Segment::Port;
  using Exit = ethercat::Segment::Exit;
  using Encapsulation = ethercat::Segment::Encapsulation;

  struct Passage : ethercat::Segment::Passage {
    Time delay{};  // what a disturbance added to `leaves`
  };

  EthercatBus() = default;
  EthercatBus(const EthercatBus&) = delete;
  EthercatBus& operator=(const EthercatBus&) = delete;

  // Behind those attached before, plugged in and with power. All are attached before the first frame; the station,
  // which powers its controller on, must outlive the bus or be detached. Returns its position, 0 for the first.
  std::size_t attach(EthercatStation& station, Hop hop = {});
  // It is gone as if without power; its place stays.
  void detach(std::size_t position);
  std::size_t size() const { return slaves_.size(); }

  // Lets a frame of at most ethercat::max_frame bytes pass, changed in place, and the stations do what it left to do.
  // `exit` says where it comes back, or that it is lost.
  Passage exchange(std::span<std::uint8_t> frame, Time at, Port entry = Port::primary,
                   Encapsulation encapsulation = Encapsulation::ethernet) {
    const Passage passage = pass(frame, at, entry, encapsulation);
    settle(at);
    return passage;
  }
  // The two halves of exchange(), for a link that sends the frame back in between. settle() comes before the next
  // frame. It returns until when the stations in which something changed may be left alone with time: `never` where
  // nothing did, Esc::unknown where a register was written.
  Passage pass(std::span<std::uint8_t> frame, Time at, Port entry, Encapsulation encapsulation);
  Time settle(Time at);

  // Off: no link to its neighbours. On: its controller starts anew.
  void set_powered(std::size_t position, bool powered, Time now) { segment_.set_powered(position, powered, now); }
  bool powered(std::size_t position) const { return slaves_[position].powered; }
  // Cable 0 joins the master and the first station, cable n the stations n - 1 and n; the cable size(), not there at
  // first, leads from the last station to the master's second port.
  void set_cable(std::size_t n, bool connected) { segment_.set_cable(n, connected); }
  bool cable(std::size_t n) const { return segment_.cable(n); }

  void disturb(const EthercatDisturbance& disturbance);  // replaces the one before
  void clear_disturbance() { disturbance_.reset(); }
  const std::optional<EthercatDisturbance>& disturbance() const { return disturbance_; }

  const EthercatCounters& counters() const { return counters_; }

  void add_observer(EthercatObserver& observer);
  void remove_observer(EthercatObserver& observer);

 private:
  // What a disturbance does to one frame.
  struct Blow {
    bool drop = false;
    bool drop_answer = false;
    Time delay{};
    std::optional<std::size_t> corrupts_at;
  };
  Blow draw();
  void count(const ethercat::Segment::Passage& passage);

  std::vector<EthercatStation*> stations_;
  std::vector<ethercat::Segment::Slave> slaves_;
  ethercat::Segment segment_{slaves_};
  ethercat::Esc absent_{{}};  // stands where a station was detached
  std::vector<EthercatObserver*> observers_;
  std::optional<EthercatDisturbance> disturbance_;
  std::uint32_t disturbed_frames_ = 0;
  DisturbanceGenerator drop_draws_{0};
  DisturbanceGenerator drop_answer_draws_{0};
  DisturbanceGenerator corrupt_draws_{0};
  DisturbanceGenerator delay_draws_{0};
  EthercatCounters counters_;
};

}  // namespace servodrome::links
