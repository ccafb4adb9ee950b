#pragma once

#include <array>
#include <deque>
#include <map>
#include <memory>

#include "host/sniff/modbus_words.hpp"
#include "links/serial/sender.hpp"

namespace servodrome::host {

// Modbus TCP in words. Sans-IO: Ethernet frames with TCP over IPv4 or IPv6, or the messages themselves, in; words out.
// Follows each connection, puts together what TCP has cut, and remembers requests by their transaction.
class ModbusTcpDecoder {
 public:
  static constexpr std::array<std::uint16_t, 2> usual_ports{502, 1502};

  ModbusTcpDecoder();
  // What a unit is (1..247), or every unit (0) that is not told apart.
  void set_model(unsigned unit, SerialModel model);
  // A port at which servers listen, beside the usual ones.
  void add_port(std::uint16_t port) { ports_.push_back(port); }

  // The frame is one from or to a server's port.
  bool takes(std::span<const std::uint8_t> ethernet_frame) const;
  // One for each message that ends in the frame.
  std::vector<Decoded> decode(std::span<const std::uint8_t> ethernet_frame, Time time);
  // One message (header and PDU) of a connection that is known by a number of the caller's.
  Decoded decode_message(std::span<const std::uint8_t> message, Time time, bool from_client, std::uint64_t connection);

 private:
  // Addresses and ports of both sides, the sender's first.
  using Flow = std::vector<std::uint8_t>;
  struct Stream {
    std::uint32_t next = 0;  // sequence number
    bool is_known = false;
    std::vector<std::uint8_t> bytes{};
  };
  struct Segment {
    bool from_client = false;
    bool begins = false;  // SYN
    Flow flow{};
    Flow connection{};  // the same for both directions
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

}  // namespace servodrome::host
