#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <fcntl.h>
#include <functional>
#include <memory>
#include <netinet/in.h>
#include <string>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include "links/can/link.hpp"
#include "links/file_descriptor.hpp"
#include "links/until.hpp"

namespace servodrome::links::test {

// A bus with one echoing node and an io_context, which run in the test's own thread. Time on the bus is virtual and
// advances as soon as something is queued, so that nothing depends on the machine's speed.
class Rig : public LineHost, public Receiver {
 public:
  explicit Rig(const BusConfig& config = {}) : bus(config), node(bus.attach(*this, 4096)) {}

  Time now() override { return time; }
  void wake() override { ++wakes; }
  Time epoch() const override { return std::chrono::seconds(1000); }

  // Answers identifier 0x600 + n with 0x580 + n and the same data, and records all frames.
  void on_frame(const canopen::Frame& frame, Time at) override {
    received.push_back(frame);
    if (frame.id >= 0x601 && frame.id <= 0x67F && !frame.extended && !frame.remote) {
      canopen::Frame answer = frame;
      answer.id = frame.id - 0x80;
      bus.transmit(node, answer, at);
    }
  }

  void run_bus() {
    if (frozen) return;
    for (Time next = bus.next_event(); next != never; next = bus.next_event()) {
      time = std::max(time, next);
      bus.advance(time);
    }
  }

  // Runs links and bus: run_until().
  bool until(const std::function<bool()>& condition) {
    return run_until(io, condition, [this] { run_bus(); });
  }

  boost::asio::io_context io;
  CanBus bus;
  PortId node;
  Time time{};
  bool frozen = false;  // stops the bus
  int wakes = 0;
  std::vector<canopen::Frame> received;
};

// Runs a rig in its own thread, for clients that block.
class RigThread {
 public:
  explicit RigThread(Rig& rig)
      : thread_([this, &rig] {
          while (!stop_) {
            rig.io.restart();
            rig.io.run_one_for(std::chrono::milliseconds(5));
            rig.run_bus();
          }
        }) {}
  ~RigThread() {
    stop_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// A nonblocking byte stream that collects the received bytes.
class RawClient {
 public:
  RawClient() = default;
  explicit RawClient(FileDescriptor descriptor) : descriptor_(std::move(descriptor)) {}

  static RawClient tcp(std::uint16_t port) {
    FileDescriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return {};
    ::fcntl(socket.get(), F_SETFL, O_NONBLOCK);
    return RawClient(std::move(socket));
  }

  bool is_open() const { return descriptor_.is_open(); }
  int descriptor() const { return descriptor_.get(); }
  void write(std::string_view text) const {
    if (::write(descriptor_.get(), text.data(), text.size()) < 0) ended_ = true;
  }
  // All text received so far.
  const std::string& text() const {
    char buffer[4096];
    for (;;) {
      const ssize_t size = ::read(descriptor_.get(), buffer, sizeof buffer);
      if (size == 0) ended_ = true;
      if (size <= 0) return text_;
      text_.append(buffer, static_cast<std::size_t>(size));
    }
  }
  bool has(std::string_view part) const { return text().find(part) != std::string::npos; }
  bool ended() const {
    text();
    return ended_;
  }
  void clear() { text_.clear(); }
  void close() { descriptor_.reset(); }

 private:
  FileDescriptor descriptor_;
  mutable std::string text_;
  mutable bool ended_ = false;
};

}  // namespace servodrome::links::test
