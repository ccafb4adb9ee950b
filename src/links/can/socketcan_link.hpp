#pragma once

#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <deque>
#include <memory>

#include "links/can/link.hpp"

namespace servodrome::links {

// `socketcan:INTERFACE`: connects the simulated bus to a CAN interface of this computer, usually a virtual one (vcan).
// Up to 1024 frames wait if the interface does not accept them at once; further ones are lost. When the interface goes
// down, the link uses it again after it is back.
class SocketcanLink final : public CanLink, private Receiver {
 public:
  static constexpr std::size_t most_waiting_frames = 1024;

  SocketcanLink(const SocketcanName& name, CanBus& bus, boost::asio::io_context& io, LineHost& host);
  ~SocketcanLink() override;
  SocketcanLink(const SocketcanLink&) = delete;
  SocketcanLink& operator=(const SocketcanLink&) = delete;

  PortId port() const override { return port_; }
  std::string name() const override { return to_string(name_); }
  const LinkCounters& counters() const override { return counters_; }
  bool settled() override;

 private:
  void on_frame(const canopen::Frame& frame, Time at) override;
  void on_sent(const canopen::Frame& frame, std::uint32_t tag, Time at) override;
  void on_error_state(ErrorState state, Time at) override;
  void wait_for_frames();
  void read();
  void resume();
  void write();

  SocketcanName name_;
  CanBus& bus_;
  LineHost& host_;
  boost::asio::posix::stream_descriptor socket_;
  PortId port_;
  boost::asio::steady_timer read_retry_;
  boost::asio::steady_timer write_retry_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::deque<canopen::Frame> waiting_;
  bool write_is_due_ = false;
  bool paused_ = false;
  LinkCounters counters_;
};

}  // namespace servodrome::links
