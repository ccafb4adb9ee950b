#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "modbus/profile.hpp"
#include "modbus/register_map.hpp"
#include "tools/sniff/decoded.hpp"

namespace servodrome::master {

// Model of a drive on a serial line: its objects and their registers.
struct SerialModel {
  ObjectCatalogue catalogue;
  std::vector<modbus::Register> registers{};  // sorted by address; empty: registers have no names
  modbus::WordOrder word_order = modbus::WordOrder::high_word_first;
  unsigned registers_per_object_at_least = 1;
  std::vector<modbus::ErrorFunction> error_functions{};

  // The objects of CiA 301 and CiA 402, without registers. All decoders share it.
  static const std::shared_ptr<const SerialModel>& standard();
  static SerialModel of(std::span<const dictionary::Entry> table, std::span<const modbus::Register> registers,
                        const modbus::Profile* profile, std::string_view product = {});
};

// Data of a request that its answer does not repeat.
struct ModbusRequest {
  std::uint8_t unit = 0;
  std::uint8_t function = 0;
  std::uint16_t read_address = 0;
  std::uint16_t read_count = 0;
  std::string what{};                    // for example "read 6041:00 Statusword"
  std::vector<ObjectAddress> objects{};  // objects that it refers to
};

// Describes a request PDU (function code first): sets kind, text, values and objects of `decoded`.
ModbusRequest describe_modbus_request(std::uint8_t unit, std::span<const std::uint8_t> pdu, const SerialModel& model,
                                      Decoded& decoded);
// Describes a response; `request` is nullptr if the request is unknown.
void describe_modbus_response(std::span<const std::uint8_t> pdu, const ModbusRequest* request, const SerialModel& model,
                              Decoded& decoded);

// The function code that a response answers: its own, or that of the request if it is an exception.
std::uint8_t answered_function(std::uint8_t function, const SerialModel& model);

}  // namespace servodrome::master
