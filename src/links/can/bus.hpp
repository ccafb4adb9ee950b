#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "canopen/frame.hpp"
#include "links/can/disturbance.hpp"
#include "links/can/load_window.hpp"
#include "links/time.hpp"

namespace servodrome::links {

enum class PortId : std::uint16_t {};

// The fault confinement state of a CAN controller (ISO 11898-1, 12.1).
enum class ErrorState : std::uint8_t { active, passive, bus_off };

// The part that a controller takes in the traffic. `off`: it has no power or its channel is closed; it does not send,
// receive or acknowledge. `listen_only`: it receives, but never drives the wire (no acknowledge, transmit() refuses).
enum class Participation : std::uint8_t { off, listen_only, normal };

// A node on the bus, as the bus sees it. CanBus::advance() calls these functions in order of time. They may call
// transmit(), with the time that they got, but not advance(), attach() or detach().
class Receiver {
 public:
  virtual ~Receiver() = default;
  // Another port's frame is complete; `at` is the end of its last bit.
  virtual void on_frame(const canopen::Frame& frame, Time at) = 0;
  // This port's own frame has been acknowledged. `tag` is the value passed to transmit().
  virtual void on_sent(const canopen::Frame& /*frame*/, std::uint32_t /*tag*/, Time /*at*/) {}
  virtual void on_error_state(ErrorState /*state*/, Time /*at*/) {}
};

// An event on the wire, for logs and monitors.
struct BusEvent {
  enum class Kind : std::uint8_t {
    frame,    // complete and acknowledged
    dropped,  // complete and acknowledged, but withheld from the receivers by a disturbance
    error,    // broken by an error frame; `frame` is what was being sent
  };
  Kind kind = Kind::frame;
  PortId port{};  // the sender
  Time start{};   // of its first bit
  Time end{};     // of its last bit (of the error frame's last bit)
  canopen::Frame frame;
};

class BusObserver {
 public:
  virtual ~BusObserver() = default;
  virtual void on_bus_event(const BusEvent& event) = 0;
};

struct PortCounters {
  std::uint64_t sent = 0;
  std::uint64_t received = 0;
  std::uint64_t refused = 0;          // transmit() returned false
  std::uint64_t discarded = 0;        // queued frames lost by bus-off, Participation other than normal, or detach
  std::uint64_t errors = 0;           // error frames while this port was sending
  std::uint16_t transmit_errors = 0;  // TEC (transmit error counter), ISO 11898-1 12.1.4.2
  std::uint16_t receive_errors = 0;   // REC (receive error counter)
  std::uint32_t bus_off_count = 0;
};

struct BusCounters {
  std::uint64_t frames = 0;      // complete frames
  std::uint64_t bits = 0;        // bits during which the wire was busy, with interframe spaces and error frames
  std::uint64_t errors = 0;      // error frames
  std::uint64_t collisions = 0;  // of these: two ports sent different frames under one identifier
  std::uint64_t dropped = 0;     // because of a disturbance
  std::uint64_t delayed = 0;
  std::uint64_t corrupted = 0;
};

struct BusConfig {
  std::uint32_t bit_rate = 1'000'000;  // 10'000 .. 1'000'000 bit/s
  // Frames take no time, need no acknowledge, never collide and are never corrupted: for tests of the protocol only. If
  // two receivers answer each other without end, advance() never returns.
  bool ideal = false;
};

// The simulated bus: one wire, one thread, no clock of its own. The caller passes the time to transmit() and advance();
// the bus' own time, now(), never goes back. The same calls give the same frames at the same nanoseconds.
//
// Each port has a FIFO transmit queue, like a CANopen stack that has one transmit mailbox behind a software queue: only
// its oldest frame takes part in arbitration. A drive's port holds one frame, like its controller's mailbox (offer()).
// If two ports win with the same arbitration field and their frames are equal, they send one frame together; if not,
// they break each other's frame with an error frame, as on a real wire.
//
// A sender needs another port to acknowledge its frame. A sender without one (alone, cut off, or set to another bit
// rate) makes private attempts: its error counter rises to error passive but no further (ISO 11898-1, 12.1.4.2
// exception 1), its frame stays queued, and the shared wire is not affected. Simplification: a port with a wrong bit
// rate does not disturb the others.
//
// An error frame adds 1 to a receiver's error counter and 8 to the sender's. It has 20 bits (flag, echo, delimiter).
// Nothing is allocated after attach().
class CanBus {
 public:
  static constexpr std::size_t default_queue_depth = 64;

  explicit CanBus(const BusConfig& config = {});
  ~CanBus();
  CanBus(const CanBus&) = delete;
  CanBus& operator=(const CanBus&) = delete;

  // The receiver must outlive the bus or be detached. `queue_depth` is the maximum number of frames that wait to be
  // sent.
  PortId attach(Receiver& receiver, std::size_t queue_depth = default_queue_depth);
  void detach(PortId port);

  // Queues a frame to be sent from `now` on. `now` may be in the past, if the frame waited elsewhere before. Returns
  // false, and counts the frame as refused, if the queue is full, if the port is off, listen-only or bus-off, or if the
  // frame is invalid (length above 8, identifier too wide).
  bool transmit(PortId port, const canopen::Frame& frame, Time now, std::uint32_t tag = 0);
  // For a port with a queue of one frame, the transmit mailbox of a controller. `frame` is the frame that the
  // controller has to send now, waiting since `since`; nullptr: none. It replaces or removes the waiting frame, but not
  // one that is on the wire: that one ends with Receiver::on_sent() or is repeated.
  void offer(PortId port, const canopen::Frame* frame, Time since);
  std::size_t pending(PortId port) const;      // frames queued or being sent
  bool sending(PortId port) const;             // its oldest frame is on the wire
  std::size_t queue_space(PortId port) const;  // frames that transmit() would still accept

  // The earliest time at which advance() has something to do; `never` if nothing is in progress.
  Time next_event() const;
  // Simulates the wire up to and including `now` and calls receivers and observers in order of time.
  void advance(Time now);
  Time now() const { return now_; }

  // A frame in progress ends at the old bit rate. Throws std::invalid_argument outside 10 kbit/s .. 1 Mbit/s.
  void set_bit_rate(std::uint32_t bit_rate);
  std::uint32_t bit_rate() const { return config_.bit_rate; }
  // The bit rate to which a port's controller is set; 0 (default): that of the bus.
  void set_port_bit_rate(PortId port, std::uint32_t bit_rate);

  // `off` and `listen_only` empty the queue. `off` also resets the error counters, as a controller's reset does.
  void set_participation(PortId port, Participation participation);
  Participation participation(PortId port) const;

  // Recovery from bus-off: automatically after 128 x 11 bit times (default), or only when recover() is called. Frames
  // queued at bus-off are lost (`discarded`).
  void set_automatic_recovery(PortId port, bool automatic);
  void recover(PortId port, Time now);
  ErrorState error_state(PortId port) const;
  // Sets a port's error counters to those with which its controller enters `state`, as after a series of errors. The
  // controller stays in this state, or a worse one, until the next call.
  void force_error_state(PortId port, ErrorState state, Time now);
  // The state of the last call of force_error_state(); `active`: none is forced.
  ErrorState forced_error_state(PortId port) const;

  void disturb(const Disturbance& disturbance);  // replaces the previous one
  void clear_disturbance();                      // also ends the delay of frames that wait
  const std::optional<Disturbance>& disturbance() const { return disturbance_; }
  void cut(PortId port, bool is_cut);  // the port's stub is unplugged
  void cut_bus(bool is_cut);           // every port is alone on the bus
  bool is_cut(PortId port) const;
  bool is_bus_cut() const { return bus_cut_; }

  const BusCounters& counters() const { return counters_; }
  const PortCounters& counters(PortId port) const;
  // The load in percent, 0..100: how much of the second before `now` the wire was busy. It changes in steps of 10 ms.
  double load_percent(Time now) const;

  void add_observer(BusObserver& observer);
  void remove_observer(BusObserver& observer);

 private:
  struct Port;

  struct Transmission {
    enum class Outcome : std::uint8_t { complete, withheld, broken };
    Outcome outcome = Outcome::complete;
    canopen::Frame frame;
    PortId sender{};  // the first one, if several ports send the same frame
    Time start{};
    Time end{};
    unsigned bits = 0;
  };

  Port& at(PortId port) const;
  Time duration(std::uint64_t bits) const;
  bool rate_matches(const Port& port) const;
  bool on_wire(const Port& port) const;
  bool acknowledged() const;
  bool may_send(const Port& port) const;
  Time earliest_start(const Port& port) const;
  Time next_start() const;
  void start_transmission();
  void end_transmission();
  void deliver(const Transmission& done);
  void break_off(const Transmission& done);
  unsigned draw_corruption(const Port& sender, const canopen::Frame& frame, unsigned bits);
  bool matches(const Port& sender, const canopen::Frame& frame) const;

  // Fault confinement (bus_errors.cpp)
  void count_transmit_error(Port& port, Time when);
  void count_receive_error(Port& port, Time when);
  void count_success(Port& port, bool sent, Time when);
  void update_error_state(Port& port, Time when);
  void recover_ports(Time when);
  void run_private_attempts(Time when);
  void review_private_attempts();
  void discard_queue(Port& port);

  BusConfig config_;
  Time now_{};
  Time idle_at_{};  // earliest time of the next start of frame
  std::vector<std::unique_ptr<Port>> ports_;
  std::vector<BusObserver*> observers_;
  std::optional<Transmission> transmission_;
  std::optional<Disturbance> disturbance_;
  std::uint32_t disturbed_frames_ = 0;
  DisturbanceGenerator drop_draws_{0};
  DisturbanceGenerator delay_draws_{0};
  DisturbanceGenerator corrupt_draws_{0};
  bool bus_cut_ = false;
  bool advancing_ = false;
  BusCounters counters_;
  LoadWindow load_;
};

}  // namespace servodrome::links
