#pragma once

#include <deque>
#include <functional>
#include <list>

#include "ethercat/sii/image.hpp"
#include "ethercat/slave_rig.hpp"
#include "master/ethercat/operation.hpp"
#include "master/problem_of.hpp"

// Complete slaves on one segment and a master, in virtual time.
namespace servodrome::master::test {

using namespace std::chrono_literals;
using ethercat::test::DeviceEvents;
using ethercat::test::DeviceObjects;

inline constexpr ethercat::DcMode sync0_mode{.name = "DC", .description = "SYNC0", .assign_activate = 0x0300};

struct EthercatDevice {
  EthercatDevice(std::uint32_t serial_number, const ethercat::Profile& its_profile, const ethercat::DcMode& dc_mode,
                 Time now)
      : profile(its_profile) {
    const ethercat::SiiDescription description{.vendor_id = 0x66668888,
                                               .product_code = 0x1234,
                                               .revision_number = 0x00010002,
                                               .serial_number = serial_number,
                                               .station_alias = static_cast<std::uint16_t>(100 + serial_number),
                                               .group = "Tests",
                                               .order = "TD-1",
                                               .name = "Test device",
                                               .dc_modes = std::span(&dc_mode, 1)};
    EXPECT_NE(ethercat::write_sii_image(description, profile, ethercat::test::device_table, sii), 0U);
    dictionary.set_listener(dictionary::Owner::drive, &events);
    dictionary.load_defaults(dictionary::Area::all, 0);
    esc.power_on(now);
    slave.start(now);
  }

  ethercat::Profile profile;
  std::array<std::uint8_t, 4096> sii{};
  ethercat::Esc esc{sii};
  DeviceObjects objects;
  dictionary::Dictionary dictionary{ethercat::test::device_table, std::as_writable_bytes(std::span(&objects, 1))};
  DeviceEvents events{objects};
  ethercat::SlaveStorage<64, 256, 4096> storage;
  ethercat::Slave slave{esc, dictionary, profile, events, storage.memory()};
};

class EthercatLine {
 public:
  struct Settings {
    std::size_t slaves = 1;
    Time hop{400};
    ethercat::Profile profile{};
    EthercatOptions master{.timeout = 5ms};
    ethercat::DcMode dc_mode = sync0_mode;
  };

  EthercatLine() : EthercatLine(Settings{}) {}
  explicit EthercatLine(const Settings& settings) {
    for (std::size_t i = 0; i < settings.slaves; ++i) {
      devices.emplace_back(static_cast<std::uint32_t>(i + 1), settings.profile, settings.dc_mode, now);
      cables_.push_back({.esc = &devices.back().esc, .forward = settings.hop, .backward = settings.hop});
    }
    segment = std::make_unique<ethercat::Segment>(cables_);
    master = std::make_unique<EthercatMaster>(std::make_unique<Client>(*this), settings.master);
  }

  EthercatDevice& device(std::size_t i) { return *std::next(devices.begin(), static_cast<std::ptrdiff_t>(i)); }

  // Scans the segment and returns the slaves with their services.
  std::vector<EthercatSlave*> open() {
    found = scan_slaves(*master);
    std::vector<EthercatSlave*> all;
    for (const FoundSlave& one : found) all.push_back(&slaves.emplace_back(*master, one));
    return all;
  }

  void advance(Time to) {
    for (EthercatDevice& device : devices) {
      for (Time at = device.slave.next_deadline(now); at <= to; at = device.slave.next_deadline(at)) {
        device.slave.poll(std::max(at, now));
        if (on_poll) on_poll(device, std::max(at, now));
      }
    }
    now = std::max(now, to);
  }

  Time now{1s};
  std::list<EthercatDevice> devices;
  std::unique_ptr<ethercat::Segment> segment;
  std::unique_ptr<EthercatMaster> master;
  std::vector<FoundSlave> found;
  std::list<EthercatSlave> slaves;
  unsigned frames = 0;
  // True: the next frame is lost on its way to the slaves, or on its way back.
  std::function<bool()> lost_out = [] { return false; };
  std::function<bool()> lost_back = [] { return false; };
  // True: the next frame reaches the slaves together with the frame after it, as from the socket of a program that the
  // system has not run for a while.
  std::function<bool()> queued_out = [] { return false; };
  // Additional delay of the next frame on its way back.
  std::function<Time()> delay_back = [] { return Time{}; };
  std::function<void(EthercatDevice&, Time)> on_poll;

 private:
  // 84 bytes at 100 Mbit/s, the shortest frame.
  static constexpr Time frame_time{6720};

  class Client final : public links::EthercatClient {
   public:
    explicit Client(EthercatLine& line) : line_(line) {}

    void send(std::span<const std::uint8_t> content) override {
      ++line_.frames;
      if (line_.lost_out()) return;
      queue_.emplace_back(content.begin(), content.end());
      if (line_.queued_out()) return;
      for (std::vector<std::uint8_t>& bytes : std::exchange(queue_, {})) pass(std::move(bytes));
    }
    std::size_t receive(std::span<std::uint8_t> into, Time timeout) override {
      const Time end = line_.now + timeout;
      if (coming_.empty() || coming_.front().at > end) {
        line_.advance(end);
        return 0;
      }
      line_.advance(std::max(line_.now, coming_.front().at));
      const std::vector<std::uint8_t> bytes = std::move(coming_.front().bytes);
      coming_.pop_front();
      std::copy(bytes.begin(), bytes.end(), into.begin());
      return bytes.size();
    }
    Time now() const override { return line_.now; }
    void wait(Time span) override { line_.advance(line_.now + span); }
    std::string name() const override { return "mem:"; }

   private:
    struct Coming {
      Time at;
      std::vector<std::uint8_t> bytes;
    };
    void pass(std::vector<std::uint8_t> bytes) {
      line_.advance(line_.now);
      const auto passage = line_.segment->process(bytes, line_.now, ethercat::Segment::Port::primary,
                                                  ethercat::Segment::Encapsulation::payload);
      for (EthercatDevice& device : line_.devices) {
        if (device.slave.wants_poll(line_.now)) device.slave.poll(line_.now);
      }
      if (passage.exit != ethercat::Segment::Exit::primary || line_.lost_back()) return;
      const Time at = passage.leaves + frame_time + line_.delay_back();
      const auto later = std::find_if(coming_.begin(), coming_.end(), [at](const Coming& one) { return one.at > at; });
      coming_.insert(later, {at, std::move(bytes)});
    }
    EthercatLine& line_;
    std::vector<std::vector<std::uint8_t>> queue_;
    std::deque<Coming> coming_;
  };

  std::vector<ethercat::Segment::Slave> cables_;
};

}  // namespace servodrome::master::test
