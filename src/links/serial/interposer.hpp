#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "links/time.hpp"

namespace servodrome::links {

// A part of what a station sends, without a pause in it.
struct SerialPiece {
  Time pause{};  // from the end of the piece before, or from the time at which the station would send
  std::vector<std::uint8_t> characters;
};

// Changes what a station of a line sends and receives, to test how a master handles that. SerialLine::advance() makes
// all calls; they must not transmit, attach or detach.
class SerialInterposer {
 public:
  // A complete answer of the station, which it sends at `at`. Returns the pieces to send instead: an empty list
  // withholds the answer, a pause before the first piece delays it, two equal pieces repeat it, one piece for each
  // character puts pauses between them. Answers keep their order: the next one waits until the pieces of this one are
  // sent, and its pause begins then.
  virtual std::vector<SerialPiece> answers(std::span<const std::uint8_t> answer, Time /*at*/) {
    return {{Time{}, {answer.begin(), answer.end()}}};
  }
  // A character that the station receives from the line, at the end of its stop bit. May change it, and whether the
  // station sees a framing error (`intact` false). Returns false if the station does not receive it at all.
  virtual bool receives(std::uint8_t& /*character*/, bool& /*intact*/, Time /*at*/) { return true; }

 protected:
  ~SerialInterposer() = default;
};

// What a server of Modbus TCP does after a request.
struct TcpReply {
  std::vector<std::uint8_t> bytes;  // sent to the client; empty: nothing
  Time delay{};                     // of bytes and close, in real time; later requests of the client wait behind it
  bool closes = false;              // the server closes the connection when everything is sent
  std::vector<SerialPiece> then{};  // sent behind `bytes`, each after its pause, in real time
};

// Changes how a line's drives answer over Modbus TCP, to test how a master handles that. The links make all calls.
class ModbusTcpInterposer {
 public:
  enum class Admission : std::uint8_t {
    serve,
    close,   // the server closes the connection at once
    reset,   // the same with a TCP reset
    ignore,  // the connection stays open, and the server reads nothing from it
  };
  // A client connects. To refuse the connection itself, destroy the link: its port is then closed.
  virtual Admission connects() { return Admission::serve; }
  // The answer of a unit to a request, both with their headers (modbus::Mbap), at the line's time `at`.
  virtual TcpReply answers(std::span<const std::uint8_t> /*request*/, std::span<const std::uint8_t> answer,
                           Time /*at*/) {
    return {{answer.begin(), answer.end()}};
  }

 protected:
  ~ModbusTcpInterposer() = default;
};

}  // namespace servodrome::links
