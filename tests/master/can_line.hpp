#pragma once

#include <deque>
#include <gtest/gtest.h>

#include "canopen/test_device.hpp"
#include "master/canopen/bus.hpp"

// Devices and a master on one simulated CAN bus, in virtual time.
namespace servodrome::master::test {

using canopen::test::frame_of;
using canopen::test::TestDevice;
using canopen::test::text_of;
using namespace std::chrono_literals;

class CanLine final : public links::VirtualClock {
 public:
  using Device = TestDevice<>;

  // Returns true for frames that are lost between bus and device, in either direction.
  std::function<bool(const Frame&)> lost = [](const Frame&) { return false; };

  Device& add(std::uint8_t node_id, const canopen::Profile& profile = {}) {
    Station& station = stations_.emplace_back(*this, node_id, profile);
    station.flush();
    return *station.device;
  }

  Time now() const override { return now_; }
  // Advances to the next event, by at most 100 us.
  void step(Time latest = links::never) override {
    Time next = std::min(std::min<Time>(latest, now_ + 100us), std::max(now_ + 1us, wire.next_event()));
    for (Station& station : stations_)
      next = std::min(next, std::max(now_ + 1us, station.device->node.next_deadline()));
    now_ = next;
    wire.advance(now_);
    for (Station& station : stations_) {
      station.device->node.poll(now_);
      station.flush();
    }
  }

  // Puts a frame on the bus that no device of this line has sent.
  void intrude(const Frame& frame) { intruder_.send(frame, now_); }

  links::CanBus wire;
  Bus bus{std::make_unique<links::MemoryCanClient>(wire, *this), "mem:", this};

 private:
  struct Station final : links::Receiver {
    Station(CanLine& its_line, std::uint8_t node_id, const canopen::Profile& profile)
        : line(its_line),
          port(its_line.wire.attach(*this, 256)),
          device(canopen::test::make_device<>(profile, node_id == 255 ? std::uint8_t{1} : node_id)) {
      device->node.start(node_id, line.now_);
    }
    void on_frame(const Frame& frame, links::Time at) override {
      if (line.lost(frame)) return;
      device->node.receive(frame, at);
      flush();
    }
    void on_sent(const Frame&, std::uint32_t, links::Time) override { flush(); }
    void flush() {
      Frame frame;
      // Segments of a block stay in the node until the controller accepts them.
      while (line.wire.queue_space(port) > 0 && device->node.take(frame)) {
        if (!line.lost(frame)) line.wire.transmit(port, frame, line.wire.now());
      }
    }

    CanLine& line;
    links::PortId port;
    std::unique_ptr<Device> device;
  };

  Time now_{1s};
  links::MemoryPort intruder_{wire};
  std::deque<Station> stations_;
};

}  // namespace servodrome::master::test
