#pragma once

#include <memory>
#include <string>

#include "links/can/link.hpp"
#include "links/can/slcan_protocol.hpp"
#include "links/serial_stream.hpp"

namespace servodrome::links {

// `slcan:PATH`: a serial CAN adapter with the LAWICEL protocol, on a pty at PATH, or on Windows on a COM port. The
// adapter takes part in the bus while its channel is open. The commands S and s set its bit rate. If that differs from
// the bus, the adapter neither sends nor receives, like a real one. A host that opens the channel without S gets the
// bus' bit rate. When the client closes the port, the channel closes and the client's settings are lost. A client that
// does not read loses frames when more than 64 KiB wait for it.
class SlcanLink final : public CanLink, private Receiver, private slcan::Controller, private SerialStream::Owner {
 public:
  static constexpr std::size_t most_waiting_bytes = 64 * 1024;

  SlcanLink(const SlcanName& name, CanBus& bus, boost::asio::io_context& io, LineHost& host);
  ~SlcanLink() override;
  SlcanLink(const SlcanLink&) = delete;
  SlcanLink& operator=(const SlcanLink&) = delete;

  PortId port() const override { return port_; }
  std::string name() const override { return to_string(name_); }
  const LinkCounters& counters() const override { return counters_; }
  bool settled() override { return stream_->settled(); }

 private:
  void on_frame(const canopen::Frame& frame, Time at) override;
  void on_sent(const canopen::Frame& frame, std::uint32_t tag, Time at) override;
  void on_error_state(ErrorState state, Time at) override;

  void open(bool listen_only) override;
  void close() override;
  void set_bit_rate(std::uint32_t bit_rate) override;
  bool transmit(const canopen::Frame& frame) override;
  std::uint8_t status_flags() override;

  void on_open() override;
  void on_bytes(std::string_view bytes) override;
  void on_written() override { work(); }
  void on_close() override;

  void work();
  void resume();
  void write();

  SlcanName name_;
  std::unique_ptr<SerialStream> stream_;  // before the port: if it cannot be opened, nothing stays on the bus
  CanBus& bus_;
  boost::asio::io_context& io_;
  LineHost& host_;
  PortId port_;
  slcan::Adapter adapter_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::string unread_;
  std::string answers_;
  bool closing_ = false;  // the channel closes when all queued frames have been sent
  bool reading_ = false;
  bool paused_ = false;
  bool lost_frames_ = false;
  LinkCounters counters_;
};

}  // namespace servodrome::links
