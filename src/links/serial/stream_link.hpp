#pragma once

#include <array>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <string>

#include "links/file_descriptor.hpp"
#include "links/serial/link.hpp"
#include "links/serial_stream.hpp"

namespace servodrome::links {

// A station whose characters are the bytes of a file descriptor. Bytes that are read are sent at the line's bit rate.
// Reading stops while `most_pending` characters wait (backpressure), so that a program is slowed down like by a real
// port. A program that does not read loses characters when more than 64 KiB wait for it.
class StreamLink : public SerialLink, private SerialStation {
 public:
  static constexpr std::size_t most_pending = 1024;
  static constexpr std::size_t most_waiting_bytes = 64 * 1024;

  StreamLink(const StreamLink&) = delete;
  StreamLink& operator=(const StreamLink&) = delete;
  ~StreamLink() override;

  const LinkCounters& counters() const final { return counters_; }
  bool settled() final;

 protected:
  // The link takes ownership of `descriptor`.
  StreamLink(Descriptor descriptor, SerialLine& line, boost::asio::io_context& io, LineHost& host);

  void open();
  bool is_open() const { return counters_.clients > 0; }
  // Called when the other end is gone and the stream is inactive.
  virtual void lost() = 0;
  // Opens the stream if a client has opened the other end.
  virtual void look_for_client() {}
  boost::asio::steady_timer& timer() { return timer_; }
  const std::shared_ptr<bool>& alive() const { return alive_; }

 private:
  void receive(std::uint8_t character, bool intact, Time at) override;

  void read();
  void watch_input();
  void write();

  SerialLine& line_;
  LineHost& host_;
  SerialPortId port_;
  SerialStream stream_;
  boost::asio::steady_timer timer_;
  boost::asio::steady_timer watch_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::array<std::uint8_t, most_pending> input_{};
  std::vector<std::uint8_t> writing_;
  std::vector<std::uint8_t> waiting_;
  bool is_reading_ = false;
  bool is_writing_ = false;
  LinkCounters counters_;
};

// `serial:DEVICE`: a serial port of this computer, with the line's format. If it is lost (unplugged), it is not opened
// again: `counters().clients` stays 0.
class TtyLink final : public StreamLink {
 public:
  TtyLink(const TtyName& name, SerialLine& line, boost::asio::io_context& io, LineHost& host);

  std::string name() const override { return to_string(name_); }

 private:
  void lost() override {}

  TtyName name_;
};

}  // namespace servodrome::links
