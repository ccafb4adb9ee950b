#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "host/sniff/decoded.hpp"
#include "modbus/profile.hpp"
#include "modbus/register_map.hpp"

namespace servodrome::host {

// What is known of a drive on a serial line: its objects, and at which registers they are.
struct SerialModel {
  ObjectCatalogue catalogue = ObjectCatalogue::standard();
  std::vector<modbus::Register> registers{};  // in order of address; empty: registers have no names
  modbus::WordOrder word_order = modbus::WordOrder::high_word_first;
  unsigned registers_per_object_at_least = 1;
  std::vector<modbus::ErrorFunction> error_functions{};

  static SerialModel of(std::span<const dictionary::Entry> table, std::span<const modbus::Register> registers,
                        const modbus::Profile* profile);
};

// What of a request its answer does not repeat.
struct ModbusRequest {
  std::uint8_t unit = 0;
  std::uint8_t function = 0;
  std::uint16_t read_address = 0;
  std::uint16_t read_count = 0;
  std::string what{};                    // "read 6041:00 Statusword"
  std::vector<ObjectAddress> objects{};  // that it names
};

// A request PDU (function code first) in words: kind, text, values and objects of `decoded` are set.
ModbusRequest describe_modbus_request(std::uint8_t unit, std::span<const std::uint8_t> pdu, const SerialModel& model,
                                      Decoded& decoded);
// A response; `request` is nullptr if it was not heard.
void describe_modbus_response(std::span<const std::uint8_t> pdu, const ModbusRequest* request, const SerialModel& model,
                              Decoded& decoded);

// The function that a response is the answer to: itself, or that of an exception.
std::uint8_t answered_function(std::uint8_t function, const SerialModel& model);

}  // namespace servodrome::host
