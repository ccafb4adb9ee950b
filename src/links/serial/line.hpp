#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "links/disturbance_generator.hpp"
#include "links/serial/sender.hpp"
#include "links/time.hpp"
#include "modbus/character_format.hpp"

namespace servodrome::links {

// A station on a serial line. All calls come from SerialLine::advance(); they may transmit, but neither attach nor
// detach.
class SerialStation {
 public:
  virtual ~SerialStation() = default;
  // A character from another port, at the end of its stop bit. Not `intact`: a framing error, or two sent at once.
  virtual void receive(std::uint8_t character, bool intact, Time at) = 0;
  virtual void poll(Time /*now*/) {}
  virtual Time next_deadline() const { return never; }
  // What it wants to send now; asked after each of the above. Valid until the next call.
  virtual std::span<const std::uint8_t> take() { return {}; }
};

// The server of a protocol (modbus::RtuServer, serial10::Server) as a station.
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

// Hears a line, for logs and monitors. All calls come from SerialLine::advance() and passed_by().
class SerialObserver {
 public:
  virtual ~SerialObserver() = default;
  // A character that others receive, at the end of its stop bit.
  virtual void on_character(SerialSender side, SerialPortId port, std::uint8_t character, Time at) = 0;
  // A message of Modbus TCP (header and PDU) from or to the line's drives, which goes past the wires.
  virtual void on_tcp_message(SerialSender side, std::span<const std::uint8_t> message, Time at) = 0;
};

struct SerialLineCounters {
  std::uint64_t characters = 0;  // all that were sent
  std::uint64_t collisions = 0;  // of them, those that met another
  std::uint64_t disturbed = 0;   // and those that were lost or changed by a disturbance
};

// What is wrong with a line, by probability (0..1 each) and seed: equal seeds and equal traffic give equal disturbance.
struct SerialDisturbance {
  double drop = 0;     // no station receives the character
  double corrupt = 0;  // one of its bits is turned over, which only a checksum can find out
  bool cut = false;    // no station receives anything
  std::uint64_t seed = 1;
};

// A half-duplex line (RS485, two wires): whatever a station sends, all others receive when its last bit has passed. No
// clock of its own: advance() does in order of time what is due, stations' deadlines included.
class SerialLine {
 public:
  explicit SerialLine(const modbus::CharacterFormat& format) : format_(format) {}
  SerialLine(const SerialLine&) = delete;
  SerialLine& operator=(const SerialLine&) = delete;

  const modbus::CharacterFormat& format() const { return format_; }

  // The station outlives its port. `side` is for observers.
  SerialPortId attach(SerialStation& station, SerialSender side = SerialSender::master);
  void detach(SerialPortId port);
  // A station that is set to another format than those it talks to hears, and is heard, garbled.
  void set_format(SerialPortId port, const modbus::CharacterFormat& format);

  // Puts characters behind those the port has still to send; the first goes out at `at`, or when the line's time has
  // come that far. They are sent back to back, whether or not the line is free.
  void transmit(SerialPortId port, std::span<const std::uint8_t> characters, Time at);
  // What the port has still to send is not sent, and the character under way is not received: its station
  // lost its power.
  void discard(SerialPortId port);
  // Characters of the port that have not yet been received.
  std::size_t pending(SerialPortId port) const;

  void disturb(const SerialDisturbance& disturbance);
  const SerialDisturbance& disturbance() const { return disturbance_; }

  void add_observer(SerialObserver& observer) { observers_.push_back(&observer); }
  void remove_observer(SerialObserver& observer) { std::erase(observers_, &observer); }
  bool is_observed() const { return !observers_.empty(); }
  // Tells observers of a message of Modbus TCP.
  void passed_by(SerialSender side, std::span<const std::uint8_t> message) {
    for (SerialObserver* observer : observers_) observer->on_tcp_message(side, message, now_);
  }

  // When advance() has something to do; never: nothing is planned.
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
    std::size_t sent = 0;  // of the queue
    bool is_sending = false;
    bool is_garbled = false;
    bool is_lost = false;
    std::uint8_t character = 0;
    Time begin{};
    Time end{};
  };

  void begin_character(Port& port, Time at);
  void disturb_character(Port& port);
  void end_character(Port& port);
  void collect();

  modbus::CharacterFormat format_;
  std::vector<Port> ports_;
  std::vector<SerialObserver*> observers_;
  Time now_{};
  SerialLineCounters counters_;
  SerialDisturbance disturbance_;
  DisturbanceGenerator drops_{0};  // one each, so that changing one probability leaves the other's choices alone
  DisturbanceGenerator corruptions_{0};
};

}  // namespace servodrome::links
