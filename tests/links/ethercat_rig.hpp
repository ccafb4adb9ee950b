#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "ethercat/frame/frame_writer.hpp"
#include "links/ethercat/link.hpp"

namespace servodrome::links::test {

using namespace std::chrono_literals;
using ethercat::Command;
using Bytes = std::vector<std::uint8_t>;

// A controller without an application. It records the calls after frames.
class PlainStation final : public EthercatStation {
 public:
  PlainStation() : esc_(sii_) { esc_.power_on(Time{}); }
  ethercat::Esc& esc() override { return esc_; }
  Time frame_passed(Time at) override {
    passed.push_back(at);
    if ((esc_.attention() & ethercat::reg::al_event::al_control) != 0) esc_.set_al_status(esc_.take_al_control(), 0);
    esc_.settle(esc_.attention());
    return at + 10us;
  }

  std::vector<Time> passed;

 private:
  std::array<std::uint8_t, 64> sii_{};
  ethercat::Esc esc_;
};

// A frame with one datagram, and access to its content after it has passed.
struct OneDatagram {
  std::array<std::uint8_t, ethercat::max_frame> memory{};
  std::span<std::uint8_t> bytes;
  ethercat::Frame frame;

  OneDatagram(const OneDatagram&) = delete;
  OneDatagram& operator=(const OneDatagram&) = delete;
  OneDatagram(Command command, std::uint32_t address, const Bytes& data, bool payload = false) {
    auto writer = payload ? ethercat::FrameWriter::payload(memory) : ethercat::FrameWriter::ethernet(memory);
    const auto place = writer.add(command, 0x55, address, data.size());
    std::copy(data.begin(), data.end(), place.begin());
    bytes = writer.bytes();
    if (payload) {
      ethercat::parse_payload(bytes, frame);
    } else {
      ethercat::parse_ethernet(bytes, frame);
    }
  }

  unsigned counter() { return frame.datagrams()[0].working_counter(); }
  Bytes data() {
    const auto& datagram = frame.datagrams()[0];
    return Bytes(datagram.data(), datagram.data() + datagram.length);
  }
};

// `count` stations on a bus, and an io_context for links. Either the test's own thread or a RigThread runs them.
class EthercatRig : public LineHost {
 public:
  explicit EthercatRig(std::size_t count = 2, Hop hop = {100ns, 50ns}) {
    for (std::size_t i = 0; i < count; ++i) {
      stations.push_back(std::make_unique<PlainStation>());
      bus.attach(*stations.back(), hop);
    }
  }

  Time now() override { return time; }
  Time frame_time() override { return time += 1us; }
  void wake() override {}
  void report(const std::string& message) override { reports.push_back(message); }

  EthercatBus::Passage send(OneDatagram& frame, EthercatBus::Port entry = EthercatBus::Port::primary) {
    return bus.exchange(frame.bytes, frame_time(), entry, EthercatBus::Encapsulation::ethernet);
  }
  // Returns how many slaves answer a broadcast; nothing: the frame is lost.
  std::optional<unsigned> broadcast() {
    OneDatagram frame(Command::brd, 0, Bytes(2));
    if (send(frame).exit == EthercatBus::Exit::lost) return std::nullopt;
    return frame.counter();
  }

  std::vector<std::unique_ptr<PlainStation>> stations;
  EthercatBus bus;
  boost::asio::io_context io;
  DescriptorWatch watch;
  Time time{};
  std::vector<std::string> reports;
};

// Runs a rig's links in its own thread, for clients that block.
class EthercatRigThread {
 public:
  explicit EthercatRigThread(EthercatRig& rig, EthercatLink* polled = nullptr)
      : thread_([this, &rig, polled] {
          while (!stop_) {
            rig.io.restart();
            if (polled == nullptr) {
              rig.watch.wait(1ms);
              rig.io.run_one_for(1ms);
            } else if (!polled->poll()) {
              rig.io.poll();
              std::this_thread::yield();
            }
          }
        }) {}
  ~EthercatRigThread() {
    stop_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace servodrome::links::test
