#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "links/disturbance_generator.hpp"
#include "links/serial/interposer.hpp"
#include "links/serial/sender.hpp"
#include "links/time.hpp"
#include "modbus/character_format.hpp"

namespace servodrome::links {

// A station on a serial line. All calls come from SerialLine::advance(). They may transmit, but not attach or detach.
class SerialStation {
 public:
  virtual ~SerialStation() = default;
  // Receives a character from another port, at the end of its stop bit. `intact` is false after a framing error or a
  // collision.
  virtual void receive(std::uint8_t character, bool intact, Time at) = 0;
  virtual void poll(Time /*now*/) {}
  virtual Time next_deadline() const { return never; }
  // Returns the characters to send now, valid until the next call. The line calls it after each of the calls above.
  virtual std::span<const std::uint8_t> take() { return {}; }
};

// Makes the server of a protocol (modbus::RtuServer, serial10::Server) a station.
template <typename Server>
class StationOf final : public SerialStation {
 public:
  explicit StationOf(Server& server) : server_(server) {}

  void receive(std::uint8_t character, bool intact, Time at) override {
    if (intact) {
      server_.receive(character, at);
    } else {
      server_.receive_garbled(at);
    }
  }
  void poll(Time now) override { server_.poll(now); }
  Time next_deadline() const override { return server_.next_deadline(); }
  std::span<const std::uint8_t> take() override { return server_.take(); }

 private:
  Server& server_;
};

enum class SerialPortId : std::uint32_t {};

// Listens to a line, for logs and monitors. All calls come from SerialLine::advance() and passed_by().
class SerialObserver {
 public:
  virtual ~SerialObserver() = default;
  // A character that other stations receive, at the end of its stop bit.
  virtual void on_character(SerialSender side, SerialPortId port, std::uint8_t character, Time at) = 0;
  // A message of Modbus TCP (header and PDU) from or to the line's drives. It does not use the line's wires.
  virtual void on_tcp_message(SerialSender side, std::span<const std::uint8_t> message, Time at) = 0;
};

struct SerialLineCounters {
  std::uint64_t characters = 0;  // all characters sent
  std::uint64_t collisions = 0;  // characters that collided with another
  std::uint64_t disturbed = 0;   // characters that a disturbance dropped or changed
};

// The disturbances of a serial line. Each kind has a probability (0..1); equal seeds and equal traffic give equal
// disturbances.
struct SerialDisturbance {
  double drop = 0;     // no station receives the character
  double corrupt = 0;  // one of its bits is inverted; only a checksum can detect that
  bool cut = false;    // no station receives anything
  std::uint64_t seed = 1;
};

// A half-duplex line (RS485, two wires): all other stations receive a station's character when its last bit has passed.
// The line has no clock of its own: advance() handles all events up to a time in order, including the stations'
// deadlines.
class SerialLine {
 public:
  explicit SerialLine(const modbus::CharacterFormat& format) : format_(format) {}
  SerialLine(const SerialLine&) = delete;
  SerialLine& operator=(const SerialLine&) = delete;

  const modbus::CharacterFormat& format() const { return format_; }

  // The station must outlive its port. `side` is for observers.
  SerialPortId attach(SerialStation& station, SerialSender side = SerialSender::master);
  void detach(SerialPortId port);
  // Sets a station's format. Characters between stations with different formats arrive garbled.
  void set_format(SerialPortId port, const modbus::CharacterFormat& format);

  // Appends characters to the port's queue. If the queue is empty, the first one is sent at `at`, or at now() if that
  // is later. Characters are sent without gaps, even if another station is sending.
  void transmit(SerialPortId port, std::span<const std::uint8_t> characters, Time at);
  // Clears the port's queue, and the character in progress is not received: the station has lost its power.
  void discard(SerialPortId port);
  // The number of the port's characters that have not been received yet, pieces of an interposer included.
  std::size_t pending(SerialPortId port) const;

  void disturb(const SerialDisturbance& disturbance);
  const SerialDisturbance& disturbance() const { return disturbance_; }

  // The interposer sees what the port's station sends and receives from now on; nullptr: none. Pieces that wait are
  // still sent. The interposer must outlive the port or be removed.
  void interpose(SerialPortId port, SerialInterposer* interposer);
  // The same for the answers of the line's drives over Modbus TCP. The links call the interposer; nullptr: none.
  void interpose_tcp(ModbusTcpInterposer* interposer) { tcp_interposer_ = interposer; }
  ModbusTcpInterposer* tcp_interposer() const { return tcp_interposer_; }

  void add_observer(SerialObserver& observer) { observers_.push_back(&observer); }
  void remove_observer(SerialObserver& observer) { std::erase(observers_, &observer); }
  bool is_observed() const { return !observers_.empty(); }
  // Reports a message of Modbus TCP to the observers.
  void passed_by(SerialSender side, std::span<const std::uint8_t> message) {
    for (SerialObserver* observer : observers_) observer->on_tcp_message(side, message, now_);
  }

  // The time of the next event for advance(); never: there is none.
  Time next_event() const;
  void advance(Time until);
  Time now() const { return now_; }
  const SerialLineCounters& counters() const { return counters_; }

 private:
  struct Port {
    SerialStation* station = nullptr;  // nullptr: detached
    SerialSender side = SerialSender::unknown;
    modbus::CharacterFormat format;
    std::vector<std::uint8_t> queue;
    std::size_t sent = 0;  // number of characters of `queue` already sent
    bool is_sending = false;
    bool is_garbled = false;
    bool is_lost = false;
    std::uint8_t character = 0;
    Time begin{};
    Time end{};
    SerialInterposer* interposer = nullptr;
    std::vector<SerialPiece> pieces;  // of the interposer, to be sent behind `queue`
    Time piece_at = never;            // when the first piece is sent; never: not known yet, or no pieces
  };

  void begin_character(Port& port, Time at);
  void disturb_character(Port& port);
  void end_character(Port& port);
  void collect();
  void send_pieces(SerialPortId port);

  modbus::CharacterFormat format_;
  std::vector<Port> ports_;
  std::vector<SerialObserver*> observers_;
  ModbusTcpInterposer* tcp_interposer_ = nullptr;
  Time now_{};
  SerialLineCounters counters_;
  SerialDisturbance disturbance_;
  DisturbanceGenerator drops_{0};  // separate, so that changing one probability does not change the other's draws
  DisturbanceGenerator corruptions_{0};
};

}  // namespace servodrome::links
