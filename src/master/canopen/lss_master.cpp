#include "master/canopen/lss_master.hpp"

#include <fmt/format.h>

#include "canopen/305/lss_slave.hpp"
#include "master/error.hpp"

namespace servodrome::master {
namespace {

// Command specifiers (CiA 305 table 2).
constexpr std::uint8_t switch_state_global = 0x04;
constexpr std::uint8_t configure_node_id = 0x11;
constexpr std::uint8_t configure_bit_timing = 0x13;
constexpr std::uint8_t activate_bit_timing_parameters = 0x15;
constexpr std::uint8_t store_configuration = 0x17;
constexpr std::uint8_t switch_selective_vendor_id = 0x40;
constexpr std::uint8_t switch_selective_response = 0x44;
constexpr std::uint8_t identify_vendor_id = 0x46;
constexpr std::uint8_t identify_non_configured = 0x4C;
constexpr std::uint8_t identify_slave = 0x4F;
constexpr std::uint8_t identify_non_configured_slave = 0x50;
constexpr std::uint8_t fast_scan = 0x51;
constexpr std::uint8_t inquire_vendor_id = 0x5A;
constexpr std::uint8_t inquire_node_id_command = 0x5E;

constexpr std::uint8_t mode_waiting = 0;
constexpr std::uint8_t mode_configuration = 1;
constexpr std::uint8_t confirm_scan = 0x80;

std::array<std::uint8_t, 8> message(std::uint8_t command, std::uint32_t number) {
  return {command, static_cast<std::uint8_t>(number), static_cast<std::uint8_t>(number >> 8),
          static_cast<std::uint8_t>(number >> 16), static_cast<std::uint8_t>(number >> 24)};
}

std::uint32_t number_in(const Frame& frame) {
  return static_cast<std::uint32_t>(frame.data[1]) | static_cast<std::uint32_t>(frame.data[2]) << 8 |
         static_cast<std::uint32_t>(frame.data[3]) << 16 | static_cast<std::uint32_t>(frame.data[4]) << 24;
}

Frame frame_of(const std::array<std::uint8_t, 8>& data) {
  Frame frame;
  frame.id = canopen::LssSlave::request_can_id;
  frame.length = 8;
  frame.data = data;
  return frame;
}

}  // namespace

std::optional<Frame> LssMaster::ask(const Data& request, std::uint8_t expected) {
  bus_.drain();
  std::optional<Frame> answer;
  const Bus::Subscription listening = bus_.listen([&](const Frame& frame) {
    const bool is_answer = frame.id == canopen::LssSlave::response_can_id && !frame.extended && !frame.remote;
    if (is_answer && frame.length == 8 && frame.data[0] == expected) answer = frame;
  });
  bus_.send(frame_of(request));
  bus_.run_until(bus_.now() + timeout_, [&] { return answer.has_value(); });
  return answer;
}

Frame LssMaster::demand(const Data& request, const char* what) {
  const auto answer = ask(request, request[0]);
  if (answer) return *answer;
  throw MasterError(fmt::format("no node answered to \"{}\"", what), bus_.name() + ", LSS",
                    "select a node first, and check that it supports LSS");
}

void LssMaster::configure(const Data& request, const char* what) {
  const Frame answer = demand(request, what);
  if (answer.data[1] == 0) return;
  throw MasterError(
      fmt::format("the node refused \"{}\" with error {}, specific error {}", what, answer.data[1], answer.data[2]),
      bus_.name() + ", LSS", "give a value the node supports");
}

bool LssMaster::any_unconfigured() {
  return ask(message(identify_non_configured, 0), identify_non_configured_slave).has_value();
}

bool LssMaster::identify(const LssAddress& lowest, std::uint32_t highest_revision, std::uint32_t highest_serial) {
  const std::array numbers{lowest.vendor_id, lowest.product_code,  lowest.revision_number,
                           highest_revision, lowest.serial_number, highest_serial};
  std::uint8_t command = identify_vendor_id;
  for (std::size_t i = 0; i + 1 < numbers.size(); ++i) bus_.send(frame_of(message(command++, numbers[i])));
  return ask(message(command, numbers.back()), identify_slave).has_value();
}

bool LssMaster::select(const LssAddress& address) {
  switch_all_to_waiting();
  const std::array numbers{address.vendor_id, address.product_code, address.revision_number};
  std::uint8_t command = switch_selective_vendor_id;
  for (const std::uint32_t number : numbers) bus_.send(frame_of(message(command++, number)));
  return ask(message(command, address.serial_number), switch_selective_response).has_value();
}

bool LssMaster::scan_step(std::uint32_t number, std::uint8_t bit_check, std::uint8_t sub, std::uint8_t next) {
  Data request = message(fast_scan, number);
  request[5] = bit_check;
  request[6] = sub;
  request[7] = next;
  return ask(request, identify_slave).has_value();
}

// Finds each part of the address bit by bit, from the highest bit down. If a node answers, the bit is 0; without an
// answer the bit is 1.
std::optional<LssAddress> LssMaster::fastscan() {
  switch_all_to_waiting();
  if (!scan_step(0, confirm_scan, 0, 0)) return std::nullopt;
  std::array<std::uint32_t, 4> parts{};
  for (std::uint8_t sub = 0; sub < 4; ++sub) {
    for (std::uint8_t bit = 32; bit-- > 0;) {
      if (!scan_step(parts[sub], bit, sub, sub)) parts[sub] |= std::uint32_t{1} << bit;
    }
    const auto next = static_cast<std::uint8_t>((sub + 1) % 4);
    if (!scan_step(parts[sub], 0, sub, next)) return std::nullopt;  // the node has left the bus, or an answer was lost
  }
  return LssAddress{parts[0], parts[1], parts[2], parts[3]};
}

void LssMaster::switch_all_to_configuration() { bus_.send(frame_of(message(switch_state_global, mode_configuration))); }
void LssMaster::switch_all_to_waiting() { bus_.send(frame_of(message(switch_state_global, mode_waiting))); }

void LssMaster::set_node_id(std::uint8_t node_id) {
  configure(message(configure_node_id, node_id), "configure node-ID");
}
void LssMaster::set_bit_timing(std::uint8_t index) {
  configure({configure_bit_timing, 0, index}, "configure bit timing");
}
void LssMaster::activate_bit_timing(std::chrono::milliseconds delay) {
  bus_.send(frame_of(message(activate_bit_timing_parameters, static_cast<std::uint16_t>(delay.count()))));
}
void LssMaster::store() { configure(message(store_configuration, 0), "store configuration"); }

std::uint8_t LssMaster::inquire_node_id() {
  return demand(message(inquire_node_id_command, 0), "inquire node-ID").data[1];
}

LssAddress LssMaster::inquire_address() {
  std::array<std::uint32_t, 4> parts{};
  std::uint8_t command = inquire_vendor_id;
  for (std::uint32_t& part : parts) part = number_in(demand(message(command++, 0), "inquire identity"));
  return {parts[0], parts[1], parts[2], parts[3]};
}

}  // namespace servodrome::master
