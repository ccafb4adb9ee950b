#pragma once

#include <array>
#include <deque>
#include <map>
#include <memory>

#include "links/serial/sender.hpp"
#include "tools/sniff/modbus_words.hpp"

namespace servodrome::master {

// Decodes Modbus TCP to text. A pure state machine without input or output: Ethernet frames with TCP over IPv4 or IPv6,
// or single messages, in; text out. Tracks each connection, reassembles messages from TCP segments, and matches answers
// to requests by their transaction identifier.
class ModbusTcpDecoder {
 public:
  static constexpr std::array<std::uint16_t, 2> usual_ports{502, 1502};

  ModbusTcpDecoder();
  // Sets the model of a unit (1..247), or of all units without a model of their own (0).
  void set_model(unsigned unit, SerialModel model);
  // Adds a server port to the usual ones.
  void add_port(std::uint16_t port) { ports_.push_back(port); }

  // True if the frame goes to or comes from a server's port.
  bool takes(std::span<const std::uint8_t> ethernet_frame) const;
  // One entry for each message that is complete with this frame.
  std::vector<Decoded> decode(std::span<const std::uint8_t> ethernet_frame, Time time);
  // Decodes one message (header and PDU). `connection`: a number that the caller assigns to the connection.
  Decoded decode_message(std::span<const std::uint8_t> message, Time time, bool from_client, std::uint64_t connection);

 private:
  // Addresses and ports of both ends, the sender first.
  using Flow = std::vector<std::uint8_t>;
  struct Stream {
    std::uint32_t next = 0;  // next sequence number
    bool is_known = false;
    std::vector<std::uint8_t> bytes{};
  };
  struct Segment {
    bool from_client = false;
    bool begins = false;  // SYN
    Flow flow{};
    Flow connection{};  // key that is the same for both directions
    std::uint32_t sequence = 0;
    std::span<const std::uint8_t> data{};
  };
  struct Pending {
    std::uint64_t connection;
    std::uint16_t transaction;
    ModbusRequest request;
  };

  bool parse(std::span<const std::uint8_t> frame, Segment& segment) const;
  const SerialModel& model_of(unsigned unit) const;

  std::shared_ptr<const SerialModel> standard_;
  std::map<unsigned, std::shared_ptr<const SerialModel>> models_;
  std::vector<std::uint16_t> ports_{usual_ports.begin(), usual_ports.end()};
  std::map<Flow, Stream> streams_;
  std::map<Flow, std::uint64_t> connections_;
  std::deque<Pending> pending_;
};

}  // namespace servodrome::master
