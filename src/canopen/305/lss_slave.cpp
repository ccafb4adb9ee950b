#include "canopen/305/lss_slave.hpp"

#include <cstring>

#include "canopen/object_access.hpp"

namespace servodrome::canopen {

namespace {

// Command specifiers (CiA 305 table 2).
enum Command : std::uint8_t {
  switch_state_global = 4,
  configure_node_id = 17,
  configure_bit_timing = 19,
  activate_bit_timing = 21,
  store_configuration = 23,
  selective_vendor_id = 64,
  selective_serial_number = 67,
  selective_response = 68,
  identify_vendor_id = 70,
  identify_serial_number_high = 75,
  identify_non_configured = 76,
  identify_slave = 79,
  non_configured_slave = 80,
  fast_scan = 81,
  inquire_vendor_id = 90,
  inquire_serial_number = 93,
  inquire_node_id = 94,
};

constexpr std::uint8_t no_error = 0;
constexpr std::uint8_t out_of_range = 1;
constexpr std::uint8_t confirm_scan = 0x80;

std::uint32_t number_at(const Frame& frame, std::size_t byte) {
  std::uint32_t number = 0;
  std::memcpy(&number, &frame.data[byte], sizeof number);
  return number;
}

}  // namespace

void LssSlave::start(std::uint8_t node_id) {
  mode_ = Mode::waiting;
  active_node_id_ = node_id;
  pending_node_id_ = node_id;
  bit_timing_index_ = no_bit_timing;
  selected_ = 0;
  identified_ = 0;
  scanned_ = 0;
}

LssSlave::Address LssSlave::address() const {
  Address address{};
  for (std::size_t i = 0; i < address.size(); ++i) {
    address[i] = value_of<std::uint32_t>(dictionary_, 0x1018, static_cast<std::uint8_t>(i + 1), 0);
  }
  return address;
}

void LssSlave::respond(std::uint8_t command, std::uint8_t first, std::uint8_t second) {
  Frame frame;
  frame.id = response_can_id;
  frame.length = 8;
  frame.data[0] = command;
  frame.data[1] = first;
  frame.data[2] = second;
  link_.transmit(frame);
}

void LssSlave::respond(std::uint8_t command, std::uint32_t value) {
  Frame frame;
  frame.id = response_can_id;
  frame.length = 8;
  frame.data[0] = command;
  std::memcpy(&frame.data[1], &value, sizeof value);
  link_.transmit(frame);
}

bool LssSlave::receive(const Frame& request) {
  if (request.length != 8) return false;
  const std::uint8_t command = request.data[0];
  if (command == switch_state_global) return switch_global(request.data[1]);
  if (command >= selective_vendor_id && command <= selective_serial_number) {
    switch_selective(static_cast<std::uint8_t>(command - selective_vendor_id), number_at(request, 1));
  } else if (command >= identify_vendor_id && command <= identify_serial_number_high) {
    identify_remote(static_cast<std::uint8_t>(command - identify_vendor_id), number_at(request, 1));
  } else if (command == identify_non_configured) {
    if (active_node_id_ == unconfigured_node_id && pending_node_id_ == unconfigured_node_id) {
      respond(non_configured_slave);
    }
  } else if (command == fast_scan) {
    fastscan(request);
  } else if (mode_ == Mode::configuration) {
    if (command >= inquire_vendor_id && command <= inquire_node_id) {
      inquire(command);
    } else {
      configure(request);
    }
  }
  return false;
}

bool LssSlave::switch_global(std::uint8_t mode) {
  if (mode > 1) return false;
  const bool leaves_configuration = mode_ == Mode::configuration && mode == 0;
  mode_ = mode == 0 ? Mode::waiting : Mode::configuration;
  selected_ = 0;
  return leaves_configuration && active_node_id_ == unconfigured_node_id && pending_node_id_ != unconfigured_node_id;
}

// Vendor-ID, product code, revision and serial number arrive in this order; all must match.
void LssSlave::switch_selective(std::uint8_t part, std::uint32_t number) {
  if (mode_ != Mode::waiting) return;
  if (part == 0) selected_ = 0;
  if (part != selected_ || address()[part] != number) {
    selected_ = 0;
    return;
  }
  if (++selected_ < 4) return;
  selected_ = 0;
  mode_ = Mode::configuration;
  respond(selective_response);
}

// Order: vendor-ID, product code, revision low, high, serial number low, high.
void LssSlave::identify_remote(std::uint8_t part, std::uint32_t number) {
  const Address own = address();
  bool matches = false;
  switch (part) {
    case 0: matches = own[0] == number; break;
    case 1: matches = own[1] == number; break;
    case 2: matches = own[2] >= number; break;
    case 3: matches = own[2] <= number; break;
    case 4: matches = own[3] >= number; break;
    default: matches = own[3] <= number; break;
  }
  if (part == 0) identified_ = 0;
  if (part != identified_ || !matches) {
    identified_ = 0;
    return;
  }
  if (++identified_ < 6) return;
  respond(identify_slave);
}

// The master finds the address of a slave without node-ID bit by bit. A slave answers if its bits from BitCheck upwards
// equal those of the request.
void LssSlave::fastscan(const Frame& request) {
  if (mode_ != Mode::waiting || active_node_id_ != unconfigured_node_id || pending_node_id_ != unconfigured_node_id) {
    return;
  }
  const std::uint8_t bit_check = request.data[5];
  const std::uint8_t sub = request.data[6];
  const std::uint8_t next = request.data[7];
  if (bit_check == confirm_scan) {
    scanned_ = 0;
    respond(identify_slave);
    return;
  }
  if (bit_check > 31 || sub > 3 || next > 3 || sub != scanned_) return;
  const std::uint32_t mask = ~std::uint32_t{0} << bit_check;
  if (((address()[sub] ^ number_at(request, 1)) & mask) != 0) return;
  if (bit_check == 0) {
    scanned_ = next;
    if (next < sub) mode_ = Mode::configuration;  // all four parts are known
  }
  respond(identify_slave);
}

void LssSlave::configure(const Frame& request) {
  const std::uint8_t command = request.data[0];
  const std::uint8_t first = request.data[1];
  switch (command) {
    case configure_node_id:
      if ((first >= 1 && first <= 127) || first == unconfigured_node_id) {
        pending_node_id_ = first;
        respond(command, no_error);
      } else {
        respond(command, out_of_range);
      }
      break;
    case configure_bit_timing:
      // Table selector 0 is the standard table of bit rates.
      if (first == 0 && events_.lss_bit_timing_supported(request.data[2])) {
        bit_timing_index_ = request.data[2];
        respond(command, no_error);
      } else {
        respond(command, out_of_range);
      }
      break;
    case activate_bit_timing:
      if (bit_timing_index_ != no_bit_timing) {
        const Time delay = std::chrono::milliseconds(first | request.data[2] << 8);
        link_.mute_until(link_.now() + 2 * delay);
        events_.lss_activate_bit_timing(bit_timing_index_, delay, link_.now());
      }
      break;
    case store_configuration:
      respond(command, static_cast<std::uint8_t>(events_.lss_store(pending_node_id_, bit_timing_index_)));
      break;
    default: break;
  }
}

void LssSlave::inquire(std::uint8_t command) {
  if (command == inquire_node_id) {
    respond(command, active_node_id_);
  } else {
    respond(command, address()[static_cast<std::size_t>(command - inquire_vendor_id)]);
  }
}

}  // namespace servodrome::canopen
