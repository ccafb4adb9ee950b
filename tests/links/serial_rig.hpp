#pragma once

#include <boost/asio/io_context.hpp>
#include <map>
#include <memory>

#include "links/can_rig.hpp"
#include "links/serial/link.hpp"
#include "modbus/ismk_modbus.hpp"
#include "serial10/server.hpp"

namespace servodrome::links::test {

// A serial line with drives, and an io_context, which run in the test's own thread. Time on the line is virtual and
// advances as soon as something is due, so that nothing depends on the machine's speed.
class SerialRig : public LineHost, public modbus::Units {
 public:
  static constexpr modbus::CharacterFormat format = modbus::test::ismk_format;

  Time now() override { return time; }
  void wake() override { ++wakes; }
  modbus::Server* find(std::uint8_t unit) override {
    const auto place = drives.find(unit);
    return place == drives.end() ? nullptr : &place->second->server;
  }

  struct Drive {
    Drive(std::uint8_t station, const modbus::Profile& profile)
        : server(device.dictionary, modbus::test::ismk_map, profile),
          rtu(server, station, modbus::character_timing(format)),
          serial10(device.dictionary, station) {}
    servodrome::test::IsmkDevice device;
    modbus::Server server;
    modbus::RtuServer rtu;
    serial10::Server serial10;
    StationOf<modbus::RtuServer> rtu_station{rtu};
    StationOf<serial10::Server> serial10_station{serial10};
    SerialPortId port{};
  };

  Drive& add_rtu(std::uint8_t station, const modbus::Profile& profile = modbus::test::ismk_profile) {
    auto& drive = drives[station] = std::make_unique<Drive>(station, profile);
    drive->port = line.attach(drive->rtu_station);
    return *drive;
  }
  Drive& add_serial10(std::uint8_t id) {
    auto& drive = drives[id] = std::make_unique<Drive>(id, modbus::test::ismk_profile);
    drive->port = line.attach(drive->serial10_station);
    return *drive;
  }

  std::unique_ptr<SerialLink> open(const std::string& name) {
    return open_serial_link(parse_serial_link(name), line, *this, io, *this);
  }

  void run_line() {
    for (Time next = line.next_event(); next != never; next = line.next_event()) {
      time = std::max(time, next);
      line.advance(time);
    }
  }
  void step() {
    io.restart();
    io.run_one_for(std::chrono::milliseconds(5));
    run_line();
  }
  // Runs links and line: run_until().
  bool until(const std::function<bool()>& condition) {
    return run_until(io, condition, [this] { run_line(); });
  }

  boost::asio::io_context io;
  SerialLine line{format};
  std::map<std::uint8_t, std::unique_ptr<Drive>> drives;
  Time time{};
  int wakes = 0;
};

// Runs a rig in its own thread, for clients that block.
class SerialRigThread {
 public:
  explicit SerialRigThread(SerialRig& rig)
      : thread_([this, &rig] {
          while (!stop_) rig.step();
        }) {}
  ~SerialRigThread() {
    stop_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// Converts hexadecimal bytes to text, for streams that work with text.
inline std::string text_of(const std::string& hex) {
  const auto bytes = servodrome::test::bytes_of(hex);
  return {bytes.begin(), bytes.end()};
}
inline std::string hex_of_text(const std::string& text) {
  return servodrome::test::hex_of({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

}  // namespace servodrome::links::test
