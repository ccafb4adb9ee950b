#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "ethercat/segment.hpp"
#include "links/disturbance_generator.hpp"
#include "links/ethercat/disturbance.hpp"
#include "links/ethercat/interposer.hpp"
#include "links/time.hpp"

namespace servodrome::links {

// A slave on the bus, as the bus sees it.
class EthercatStation {
 public:
  virtual ~EthercatStation() = default;
  // The slave controller that frames pass. It must not change while the station is attached.
  virtual ethercat::Esc& esc() = 0;
  // Called after a frame that gives the slave's application work (Esc::calls), at most once per frame, with the frame's
  // time. Returns the time until which the station need not run if no other frame comes.
  virtual Time frame_passed(Time at) = 0;
};

// The delay between a station and the one before it, or the master: cable, PHYs and slave controller.
struct Hop {
  Time forward{};
  Time backward{};
};

// The sender of a frame: a link or client, and the hash of the sender's address at a link with several senders.
struct EthercatSender {
  const void* link = nullptr;
  std::size_t address = 0;

  static EthercatSender at(const void* link, const void* address, std::size_t size) {
    return {link, std::hash<std::string_view>{}({static_cast<const char*>(address), size})};
  }
  bool operator==(const EthercatSender&) const = default;
};

// Receives a copy of each frame of a bus, for logs and monitors.
class EthercatObserver {
 public:
  enum class Direction : std::uint8_t { in, out };  // in: to the first slave; out: back to the master
  virtual ~EthercatObserver() = default;
  // `bytes` is the frame as the master sent it, or as the master gets it back. A lost frame does not come back.
  virtual void on_frame(std::span<const std::uint8_t> bytes, ethercat::Segment::Encapsulation encapsulation,
                        Direction direction, Time at) = 0;
};

struct EthercatCounters {
  std::uint64_t frames = 0;     // sent by a master
  std::uint64_t lost = 0;       // of these, did not come back: dropped, corrupted, cut off, or destroyed by a slave
  std::uint64_t malformed = 0;  // EtherCAT frames whose datagrams do not fit into them
  std::uint64_t foreign = 0;    // frames of another protocol
  std::uint64_t dropped = 0;    // lost because of a disturbance or an interposer
  std::uint64_t delayed = 0;
  std::uint64_t corrupted = 0;
};

// The simulated bus: stations connected in series, their cables, and the master's one or two ports (ethercat::Segment).
// It has no clock, and nothing happens on it by itself. The caller of exchange() passes the time, and the frame passes
// all stations within that call. The same calls give the same frames and the same times, to the nanosecond. Nothing is
// allocated after attach().
class EthercatBus {
 public:
  using Port = ethercat::Segment::Port;
  using Exit = ethercat::Segment::Exit;
  using Encapsulation = ethercat::Segment::Encapsulation;

  struct Passage : ethercat::Segment::Passage {
    Time delay{};            // added to `leaves` by a disturbance or an interposer
    std::size_t length = 0;  // bytes that come back
    // Other frames that come back behind this one, also if it is lost. They stay in place until the next frame.
    std::span<const std::vector<std::uint8_t>> behind{};
  };

  EthercatBus() = default;
  EthercatBus(const EthercatBus&) = delete;
  EthercatBus& operator=(const EthercatBus&) = delete;

  // Adds a station behind those attached before, connected and with power. All stations must be attached before the
  // first frame. The station, which powers its controller on, must outlive the bus or be detached. Returns its
  // position, 0 for the first.
  std::size_t attach(EthercatStation& station, Hop hop = {});
  // Treats the station as without power from now on; its position stays in use.
  void detach(std::size_t position);
  std::size_t size() const { return slaves_.size(); }

  // Passes a frame of at most ethercat::max_frame bytes through the segment and changes it in place. Then the stations
  // do the work that the frame has caused. `exit` of the result tells at which port the frame comes back, or that it is
  // lost.
  Passage exchange(std::span<std::uint8_t> frame, Time at, Port entry = Port::primary,
                   Encapsulation encapsulation = Encapsulation::ethernet, EthercatSender sender = {}) {
    const Passage passage = pass(frame, at, entry, encapsulation, sender);
    settle(at);
    return passage;
  }
  // The two halves of exchange(), for a link that sends the frame back before the stations do their work. settle() must
  // be called before the next frame.
  Passage pass(std::span<std::uint8_t> frame, Time at, Port entry, Encapsulation encapsulation,
               EthercatSender sender = {});
  void settle(Time at);
  // Returns the time until which the stations that frames have changed since forget_events() need not run: `never` if
  // there are no such stations, Esc::unknown if a frame wrote a register.
  Time next_event() const { return next_event_; }
  void forget_events() { next_event_ = never; }

  // Without power the station has no link to its neighbours. When power returns, its controller restarts.
  void set_powered(std::size_t position, bool powered, Time now) { segment_.set_powered(position, powered, now); }
  bool powered(std::size_t position) const { return slaves_[position].powered; }
  // Cable 0 connects the master and the first station, cable n the stations n - 1 and n. Cable size() connects the last
  // station to the master's second port; it is unplugged at first.
  void set_cable(std::size_t n, bool connected) { segment_.set_cable(n, connected); }
  bool cable(std::size_t n) const { return segment_.cable(n); }

  void disturb(const EthercatDisturbance& disturbance);  // replaces the previous one
  void clear_disturbance() { disturbance_.reset(); }
  const std::optional<EthercatDisturbance>& disturbance() const { return disturbance_; }

  // The interposer sees every frame from now on; nullptr: none. It must outlive the bus or be removed.
  void interpose(EthercatInterposer* interposer) { interposer_ = interposer; }
  // The sender of the frame that passes now, for an interposer that keeps the frame.
  const EthercatSender& sender() const { return sender_; }
  // Lets a frame that an interposer has kept come back behind the next frame of its sender; within
  // EthercatInterposer::returns() also behind the frame that passes now.
  void bring_back(EthercatSender sender, std::vector<std::uint8_t> frame);

  const EthercatCounters& counters() const { return counters_; }

  void add_observer(EthercatObserver& observer);
  void remove_observer(EthercatObserver& observer);

 private:
  // The effect of a disturbance or an interposer on one frame.
  struct Blow {
    bool drop = false;
    bool drop_answer = false;
    Time delay{};
    std::optional<std::size_t> corrupts_at;
    unsigned passes = 1;
  };
  Passage pass_disturbed(std::span<std::uint8_t> frame, Time at, Port entry, Encapsulation encapsulation);
  Blow draw();
  void enter_interposed(Blow& blow, std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at);
  void return_interposed(Passage& passage, std::span<std::uint8_t> frame, Encapsulation encapsulation);
  void return_kept(Passage& passage, Time at);
  void count(const ethercat::Segment::Passage& passage);

  std::vector<EthercatStation*> stations_;
  std::vector<ethercat::Segment::Slave> slaves_;
  ethercat::Segment segment_{slaves_};
  ethercat::Esc absent_{{}};  // in place of a detached station's controller
  std::vector<EthercatObserver*> observers_;
  EthercatInterposer* interposer_ = nullptr;
  // A frame that an interposer has kept, until its sender sends the next one.
  struct Kept {
    EthercatSender sender;
    std::vector<std::uint8_t> bytes;
  };
  static constexpr std::size_t most_kept = 1024;  // then the oldest one is lost
  EthercatSender sender_;
  std::vector<Kept> kept_;
  std::vector<std::vector<std::uint8_t>> behind_;  // of the last frame, if some were kept
  std::optional<EthercatDisturbance> disturbance_;
  std::uint32_t disturbed_frames_ = 0;
  DisturbanceGenerator drop_draws_{0};
  DisturbanceGenerator drop_answer_draws_{0};
  DisturbanceGenerator corrupt_draws_{0};
  DisturbanceGenerator delay_draws_{0};
  EthercatCounters counters_;
  Time next_event_ = never;
};

}  // namespace servodrome::links
