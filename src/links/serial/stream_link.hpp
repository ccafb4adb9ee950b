#pragma once

#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <memory>
#include <string>

#include "links/serial/link.hpp"
#include "links/serial_stream.hpp"

namespace servodrome::links {

// A station whose characters are the bytes of a stream: of a pty (`pty:PATH`), which programs open one after the other,
// or of a serial port with the line's format (`serial:DEVICE`), which is not opened again if it is lost. Bytes that are
// read are sent at the line's bit rate. Reading stops while `most_pending` characters wait (backpressure), so that a
// program is slowed down like by a real port. A program that does not read loses characters when more than 64 KiB wait
// for it.
class StreamLink final : public SerialLink, private SerialStation, private SerialStream::Owner {
 public:
  static constexpr std::size_t most_pending = SerialStream::most_at_once;
  static constexpr std::size_t most_waiting_bytes = 64 * 1024;
  using Open = std::function<std::unique_ptr<SerialStream>(SerialStream::Owner& owner)>;

  StreamLink(std::string name, const Open& open, SerialLine& line, boost::asio::io_context& io, LineHost& host);
  StreamLink(const StreamLink&) = delete;
  StreamLink& operator=(const StreamLink&) = delete;
  ~StreamLink() override;

  std::string name() const override { return name_; }
  const LinkCounters& counters() const override { return counters_; }
  bool settled() override { return stream_->settled(); }

 private:
  void receive(std::uint8_t character, bool intact, Time at) override;

  void on_open() override;
  void on_bytes(std::string_view bytes) override;
  void on_close() override;
  void read();

  std::string name_;
  std::unique_ptr<SerialStream> stream_;  // before the port: if it cannot be opened, nothing stays on the line
  SerialLine& line_;
  LineHost& host_;
  SerialPortId port_;
  boost::asio::steady_timer full_;
  LinkCounters counters_;
};

}  // namespace servodrome::links
