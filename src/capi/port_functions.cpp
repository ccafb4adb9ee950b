#include <algorithm>
#include <fmt/format.h>
#include <string_view>

#include "capi/call.hpp"
#include "capi/ports.hpp"
#include "capi/servodrome.h"
#include "links/nearest_name.hpp"

// The functions of servodrome.h for the ports of a master.
namespace servodrome::capi {
namespace {

constexpr std::size_t smallest_frame = 14;  // the header of Ethernet

// Finds a bus by name. Throws Failure if there is no such bus of this kind.
template <typename Buses>
auto& bus_named(const Buses& buses, const char* name, const char* kind) {
  require(name, "bus");
  std::vector<std::string_view> names;
  for (const auto& bus : buses) {
    if (bus->settings.name == name) return *bus;
    names.push_back(bus->settings.name);
  }
  throw failure(SERVODROME_UNKNOWN, fmt::format("there is no {} \"{}\"", kind, std::string_view(name).substr(0, 40)),
                "bus", names.empty() ? fmt::format("the line has no {}", kind) : links::suggestion(name, names));
}

// Runs the line until the port has something, at the latest for `timeout_ns`. Returns false if nothing came.
bool wait_for(OpenLine& line, Port& port, std::int64_t timeout_ns) {
  const Time end = line.line.now() + Time(within(timeout_ns, 0, longest_advance_ns, "timeout_ns"));
  return line.run_until_ready(end, {&port}) == 0;
}

}  // namespace
}  // namespace servodrome::capi

using namespace servodrome;        // NOLINT(google-build-using-namespace)
using namespace servodrome::capi;  // NOLINT(google-build-using-namespace)

int servodrome_port_close(servodrome_handle port) { return close_item<Port>(port); }

int servodrome_can_open(servodrome_handle handle, const char* bus, servodrome_handle* port) {
  return guarded([&] {
    require(port, "port");
    const LockedLine line(handle);
    *port = line.add(std::make_unique<CanPort>(bus_named(line.itself()->line.buses(), bus, "CAN bus").bus));
    return SERVODROME_OK;
  });
}

int servodrome_can_send(servodrome_handle handle, const servodrome_can_frame* frame) {
  return guarded([&] {
    require(frame, "frame");
    within(frame->id, 0, frame->extended != 0 ? 0x1FFFFFFF : 0x7FF, "id");
    within(frame->length, 0, 8, "length");
    canopen::Frame sent;
    sent.id = frame->id;
    sent.extended = frame->extended != 0;
    sent.remote = frame->remote != 0;
    sent.length = frame->length;
    if (!sent.remote) std::copy_n(frame->data, frame->length, sent.data.begin());
    const LockedLine line(handle);
    if (line.item<CanPort>().send(sent, line->line.now())) return SERVODROME_OK;
    throw failure(SERVODROME_REFUSED, "the bus takes no more frames of this port", "CAN port",
                  "let line time pass; if that does not help, the port is bus-off");
  });
}

int servodrome_can_receive(servodrome_handle handle, int64_t timeout_ns, servodrome_can_frame* frame) {
  return guarded([&] {
    require(frame, "frame");
    const LockedLine line(handle);
    auto& port = line.item<CanPort>();
    if (!wait_for(*line, port, timeout_ns)) return SERVODROME_NOTHING;
    bool lost = false;
    const links::TimedFrame received = port.take(lost);
    *frame = {};
    frame->time_ns = received.at.count();
    frame->id = received.frame.id;
    frame->extended = received.frame.extended ? 1 : 0;
    frame->remote = received.frame.remote ? 1 : 0;
    frame->length = received.frame.length;
    frame->lost = lost ? 1 : 0;
    std::copy_n(received.frame.data.begin(), std::min<std::size_t>(received.frame.length, 8), frame->data);
    return SERVODROME_OK;
  });
}

int servodrome_can_state(servodrome_handle handle, unsigned* state) {
  return guarded([&] {
    require(state, "state");
    const LockedLine line(handle);
    *state = static_cast<unsigned>(line.item<CanPort>().state());
    return SERVODROME_OK;
  });
}

int servodrome_serial_open(servodrome_handle handle, const char* bus, servodrome_handle* port) {
  return guarded([&] {
    require(port, "port");
    const LockedLine line(handle);
    *port = line.add(std::make_unique<BytePort>(bus_named(line.itself()->line.serial_buses(), bus, "RS485 line").line));
    return SERVODROME_OK;
  });
}

int servodrome_serial_configure(servodrome_handle handle, uint32_t bit_rate, unsigned data_bits, char parity,
                                unsigned stop_bits) {
  return guarded([&] {
    within(bit_rate, 300, 10'000'000, "bit_rate");
    within(data_bits, 5, 8, "data_bits");
    within(stop_bits, 1, 2, "stop_bits");
    const std::size_t place = std::string_view("NEO").find(parity);
    if (place == std::string_view::npos) refuse_argument("unknown parity", "parity", "give 'N', 'E' or 'O'");
    const LockedLine line(handle);
    line.item<BytePort>().configure({.bit_rate = bit_rate,
                                     .data_bits = static_cast<std::uint8_t>(data_bits),
                                     .parity = static_cast<modbus::Parity>(place),
                                     .stop_bits = static_cast<std::uint8_t>(stop_bits)});
    return SERVODROME_OK;
  });
}

int servodrome_serial_send(servodrome_handle handle, const uint8_t* bytes, size_t size) {
  return guarded([&] {
    constexpr std::size_t most = 65536;
    if (size > 0) require(bytes, "bytes");
    size_within(size, 0, most, "size");
    const LockedLine line(handle);
    line.item<BytePort>().send({bytes, size}, line->line.now());
    return SERVODROME_OK;
  });
}

int servodrome_serial_receive(servodrome_handle handle, int64_t timeout_ns, uint8_t* bytes, size_t capacity,
                              size_t* size) {
  return guarded([&] {
    require(bytes, "bytes");
    require(size, "size");
    if (capacity == 0) refuse_argument("no room for a byte", "capacity", "give at least 1");
    const LockedLine line(handle);
    auto& port = line.item<BytePort>();
    if (!wait_for(*line, port, timeout_ns)) return SERVODROME_NOTHING;
    *size = port.take_into({bytes, capacity});
    return SERVODROME_OK;
  });
}

namespace {

// The open port of a side of an EtherCAT segment, or nullptr.
EthernetPort* port_at(OpenLine& line, const links::EthercatBus& bus, links::EthercatBus::Port side) {
  for (const auto& item : line.items) {
    auto* port = dynamic_cast<EthernetPort*>(item.second.get());
    if (port != nullptr && &port->bus() == &bus && port->side() == side) return port;
  }
  return nullptr;
}

links::EthercatBus::Port other_side(links::EthercatBus::Port side) {
  using Side = links::EthercatBus::Port;
  return side == Side::primary ? Side::secondary : Side::primary;
}

}  // namespace

int servodrome_ethercat_open(servodrome_handle handle, const char* bus, int second, servodrome_handle* port) {
  return guarded([&] {
    require(port, "port");
    const LockedLine line(handle);
    links::EthercatBus& segment = bus_named(line.itself()->line.ethercat_buses(), bus, "EtherCAT segment").bus;
    const auto side = second != 0 ? links::EthercatBus::Port::secondary : links::EthercatBus::Port::primary;
    if (port_at(*line, segment, side) != nullptr) {
      throw failure(SERVODROME_REFUSED, "this side of the segment is already open", "EtherCAT port",
                    "close the other port first");
    }
    *port = line.add(std::make_unique<EthernetPort>(segment, side));
    return SERVODROME_OK;
  });
}

int servodrome_ethercat_send(servodrome_handle handle, const uint8_t* frame, size_t size) {
  return guarded([&] {
    require(frame, "frame");
    size_within(size, smallest_frame, ethercat::max_frame, "size");
    const LockedLine line(handle);
    auto& port = line.item<EthernetPort>();
    port.send({frame, size}, line->line.now(), port_at(*line, port.bus(), other_side(port.side())));
    return SERVODROME_OK;
  });
}

int servodrome_ethercat_receive(servodrome_handle handle, int64_t timeout_ns, uint8_t* frame, size_t capacity,
                                size_t* size) {
  return guarded([&] {
    require(frame, "frame");
    require(size, "size");
    const LockedLine line(handle);
    auto& port = line.item<EthernetPort>();
    if (!wait_for(*line, port, timeout_ns)) return SERVODROME_NOTHING;
    const std::span<const std::uint8_t> bytes = port.front();
    *size = bytes.size();
    if (bytes.size() > capacity) {
      refuse_argument(fmt::format("the frame has {} bytes", bytes.size()), "capacity",
                      "give a larger buffer; the frame waits");
    }
    std::copy(bytes.begin(), bytes.end(), frame);
    port.pop();
    return SERVODROME_OK;
  });
}
