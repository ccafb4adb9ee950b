#include "tools/sniff/modbus_words.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <fmt/format.h>

#include "modbus/pdu.hpp"

namespace servodrome::master {
namespace {

using modbus::read_u16;
using modbus::Register;

constexpr std::size_t most_named = 8;  // maximum of registers named for a message; the rest is only counted

struct FunctionName {
  std::uint8_t code;
  const char* words;
};
// Public function codes (Modbus Application Protocol V1.1b3, 5.1) that are not described in detail below.
constexpr auto modbus_function_names = std::to_array<FunctionName>({
    {0x01, "read coils"},
    {0x02, "read discrete inputs"},
    {0x05, "write coil"},
    {0x07, "read exception status"},
    {0x08, "diagnostics"},
    {0x0B, "read event counter"},
    {0x0C, "read event log"},
    {0x0F, "write coils"},
    {0x11, "report server ID"},
    {0x14, "read file record"},
    {0x15, "write file record"},
    {0x16, "mask write register"},
    {0x18, "read FIFO queue"},
    {0x2B, "encapsulated interface"},
});

std::string function_text(std::uint8_t function) {
  for (const FunctionName& one : modbus_function_names) {
    if (one.code == function) return one.words;
  }
  return fmt::format("function {:02X}h", function);
}

const Register* row_at(const SerialModel& model, unsigned address) {
  for (const Register& row : model.registers) {
    if (row.address <= address && address < row.address + std::max<unsigned>(row.words, 1)) return &row;
  }
  return nullptr;
}

// The object's bytes, least significant first, from all registers that hold it. `at`: data of the first register.
std::vector<std::byte> object_bytes(const Register& row, const std::uint8_t* at, const SerialModel& model) {
  std::vector<std::byte> bytes;
  const NamedObject* known = model.catalogue.find({row.index, row.sub});
  const bool is_number = known == nullptr || !known->type || dictionary::size_of(*known->type) != 0;
  for (unsigned word = 0; word < row.words; ++word) {
    if (!is_number) {
      bytes.push_back(std::byte{at[2 * word]});
      bytes.push_back(std::byte{at[2 * word + 1]});
      continue;
    }
    const unsigned place = model.word_order == modbus::WordOrder::low_word_first ? word : row.words - 1U - word;
    bytes.push_back(std::byte{at[2 * place + 1]});
    bytes.push_back(std::byte{at[2 * place]});
  }
  if (known != nullptr && known->type && is_number) {
    bytes.resize(std::min<std::size_t>(bytes.size(), dictionary::size_of(*known->type)));
  } else if (!is_number) {
    while (!bytes.empty() && bytes.back() == std::byte{0}) bytes.pop_back();
  }
  return bytes;
}

// Splits a range of registers into objects. `each` receives the row (nullptr: an unnamed register), the first register,
// and the number of registers of the object within the range.
template <typename Each>
void for_each_object(unsigned address, unsigned count, const SerialModel& model, const Each& each) {
  const unsigned end = address + count;
  while (address < end) {
    const Register* row = row_at(model, address);
    unsigned taken = row != nullptr ? row->address + row->words - address : 1;
    taken = std::min(taken, end - address);
    each(row, address, taken);
    address += taken;
    if (row == nullptr) continue;
    // Skips padding registers after an object (Profile::registers_per_object_at_least).
    while (address < end && address < row->address + model.registers_per_object_at_least &&
           row_at(model, address) == nullptr) {
      ++address;
    }
  }
}

std::string stretch_text(unsigned address, unsigned count) {
  return count == 1 ? fmt::format("register {:04X}h", address)
                    : fmt::format("{} registers from {:04X}h", count, address);
}

// Names of the objects that a request reads.
std::string names_text(unsigned address, unsigned count, const SerialModel& model,
                       std::vector<ObjectAddress>& objects) {
  std::string text;
  std::size_t named = 0;
  std::size_t more = 0;
  bool any_unnamed = false;
  for_each_object(address, count, model, [&](const Register* row, unsigned, unsigned) {
    if (row == nullptr) {
      any_unnamed = true;
      return;
    }
    objects.push_back({row->index, row->sub});
    if (++named > most_named) {
      ++more;
    } else {
      text += (text.empty() ? "" : ", ") + model.catalogue.title(objects.back());
    }
  });
  if (named == 0) return stretch_text(address, count);
  if (more != 0) text += fmt::format(" and {} more", more);
  if (any_unnamed || named > 1) text += ", " + stretch_text(address, count);
  return text;
}

// Adds the values that a message has for the registers.
void add_values(unsigned address, std::span<const std::uint8_t> data, const char* joint, const SerialModel& model,
                Decoded& decoded) {
  std::size_t shown = 0;
  std::size_t more = 0;
  std::string text;
  const auto say = [&](const std::string& name, const std::string& value) {
    if (++shown > most_named) {
      ++more;
    } else {
      text += fmt::format("{}{} {} {}", text.empty() ? "" : ", ", name, joint, value);
    }
  };
  const auto count = static_cast<unsigned>(data.size() / 2);
  for_each_object(address, count, model, [&](const Register* row, unsigned first, unsigned words) {
    const std::uint8_t* at = &data[2 * (first - address)];
    if (row == nullptr) {
      say(fmt::format("register {:04X}h", first), fmt::format("{0} ({0:04X}h)", read_u16(at)));
      return;
    }
    const ObjectAddress object{row->index, row->sub};
    decoded.objects.push_back(object);
    if (words < row->words) {
      say(fmt::format("{} ({} of {} registers)", model.catalogue.title(object), words, row->words),
          hex_text({at, 2U * words}));
      return;
    }
    decoded.values.push_back(decoded_value(object, object_bytes(*row, at, model), model.catalogue));
    say(decoded.values.back().name, decoded.values.back().text);
  });
  if (more != 0) text += fmt::format(" and {} more", more);
  decoded.text += text;
}

std::string identification_text(std::span<const std::uint8_t> pdu) {
  std::string text;
  std::size_t at = 7;  // after function, MEI type, code, conformity, more follows, next object, number of objects
  for (unsigned i = 0; pdu.size() > 6 && i < pdu[6] && at + 2 <= pdu.size(); ++i) {
    const std::size_t length = std::min<std::size_t>(pdu[at + 1], pdu.size() - at - 2);
    std::string value;
    for (const std::uint8_t c : pdu.subspan(at + 2, length)) value += c >= ' ' && c <= '~' ? static_cast<char>(c) : '?';
    text += fmt::format("{}{:02X}h \"{}\"", text.empty() ? "" : ", ", pdu[at], value);
    at += 2 + length;
  }
  return text;
}

std::uint16_t number_at(std::span<const std::uint8_t> pdu, std::size_t at) {
  return at + 2 <= pdu.size() ? read_u16(&pdu[at]) : std::uint16_t{0};
}

void of_wrong_length(Decoded& decoded) {
  decoded.text = "Modbus " + decoded.text + ": of wrong length";
  decoded.error = true;
}

}  // namespace

const std::shared_ptr<const SerialModel>& SerialModel::standard() {
  static const auto model = std::make_shared<const SerialModel>(SerialModel{.catalogue = ObjectCatalogue::standard()});
  return model;
}

SerialModel SerialModel::of(std::span<const dictionary::Entry> table, std::span<const Register> registers,
                            const modbus::Profile* profile, std::string_view product) {
  SerialModel model;
  model.catalogue = ObjectCatalogue::of(table, product);
  model.registers.assign(registers.begin(), registers.end());
  if (profile != nullptr) {
    model.word_order = profile->word_order;
    model.registers_per_object_at_least = profile->registers_per_object_at_least;
    model.error_functions.assign(profile->error_functions.begin(), profile->error_functions.end());
  }
  return model;
}

std::uint8_t answered_function(std::uint8_t function, const SerialModel& model) {
  for (const modbus::ErrorFunction& row : model.error_functions) {
    if (row.error == function) return row.function;
  }
  return static_cast<std::uint8_t>(function & ~modbus::error_bit);
}

ModbusRequest describe_modbus_request(std::uint8_t unit, std::span<const std::uint8_t> pdu, const SerialModel& model,
                                      Decoded& decoded) {
  decoded.kind = FrameKind::modbus;
  ModbusRequest request;
  request.unit = unit;
  if (pdu.empty()) {
    of_wrong_length(decoded);
    return request;
  }
  request.function = pdu[0];
  const std::uint16_t address = number_at(pdu, 1);
  const auto read_part = [&](std::uint16_t from, std::uint16_t count, const char* verb) {
    request.read_address = from;
    request.read_count = count;
    decoded.text += verb + names_text(from, count, model, decoded.objects);
  };
  switch (static_cast<modbus::Function>(pdu[0])) {
    case modbus::Function::read_holding_registers:
    case modbus::Function::read_input_registers: {
      const bool inputs = pdu[0] == static_cast<std::uint8_t>(modbus::Function::read_input_registers);
      if (pdu.size() != 5) {
        of_wrong_length(decoded);
        return request;
      }
      read_part(address, number_at(pdu, 3), inputs ? "read (input registers) " : "read ");
      break;
    }
    case modbus::Function::write_single_register:
      if (pdu.size() != 5) {
        of_wrong_length(decoded);
        return request;
      }
      request.what = "write " + names_text(address, 1, model, request.objects);
      decoded.text = "write ";
      add_values(address, pdu.subspan(3, 2), "=", model, decoded);
      break;
    case modbus::Function::write_multiple_registers: {
      if (pdu.size() < 6 || pdu.size() != 6U + pdu[5] || pdu[5] % 2 != 0) {
        of_wrong_length(decoded);
        return request;
      }
      request.what = "write " + names_text(address, pdu[5] / 2U, model, request.objects);
      decoded.text = "write ";
      add_values(address, pdu.subspan(6), "=", model, decoded);
      break;
    }
    case modbus::Function::read_write_multiple_registers:
      if (pdu.size() < 10 || pdu.size() != 10U + pdu[9] || pdu[9] % 2 != 0) {
        of_wrong_length(decoded);
        return request;
      }
      decoded.text = "write ";
      add_values(number_at(pdu, 5), pdu.subspan(10), "=", model, decoded);
      read_part(address, number_at(pdu, 3), " and read ");
      break;
    case modbus::Function::encapsulated_interface_transport:
      if (pdu.size() == 4 && pdu[1] == modbus::read_device_identification) {
        decoded.text = fmt::format("read device identification from object {:02X}h, code {}", pdu[3], pdu[2]);
        break;
      }
      [[fallthrough]];
    default:
      decoded.text = function_text(pdu[0]);
      if (pdu.size() > 1) decoded.text += " " + hex_text(pdu.subspan(1));
      break;
  }
  if (request.what.empty()) request.what = decoded.text;
  if (request.objects.empty()) request.objects = decoded.objects;
  decoded.text = "Modbus " + decoded.text;
  return request;
}

void describe_modbus_response(std::span<const std::uint8_t> pdu, const ModbusRequest* request, const SerialModel& model,
                              Decoded& decoded) {
  decoded.kind = FrameKind::modbus;
  if (pdu.empty()) return of_wrong_length(decoded);
  if (request != nullptr) decoded.objects = request->objects;
  if (pdu.size() == 2 && (pdu[0] & modbus::error_bit) != 0) {
    decoded.error = true;
    decoded.text =
        fmt::format("Modbus exception {:02X}h {}", pdu[1], modbus::text(static_cast<modbus::Exception>(pdu[1])));
    decoded.text +=
        request != nullptr ? ": " + request->what : " to " + function_text(answered_function(pdu[0], model));
    return;
  }
  const std::uint16_t address = number_at(pdu, 1);
  switch (static_cast<modbus::Function>(pdu[0])) {
    case modbus::Function::read_holding_registers:
    case modbus::Function::read_input_registers:
    case modbus::Function::read_write_multiple_registers: {
      if (pdu.size() < 2 || pdu.size() != 2U + pdu[1] || pdu[1] % 2 != 0) return of_wrong_length(decoded);
      const std::span<const std::uint8_t> data = pdu.subspan(2);
      decoded.text = "Modbus ";
      if (request == nullptr) {
        decoded.text += fmt::format("answer {}", hex_text(data));
        return;
      }
      decoded.objects.clear();
      add_values(request->read_address, data, "is", model, decoded);
      if (data.size() != 2U * request->read_count) {
        decoded.error = true;
        decoded.text += fmt::format(", {} registers instead of {}", data.size() / 2, request->read_count);
      }
      return;
    }
    case modbus::Function::write_single_register:
    case modbus::Function::write_multiple_registers: {
      if (pdu.size() != 5) return of_wrong_length(decoded);
      const bool one = pdu[0] == static_cast<std::uint8_t>(modbus::Function::write_single_register);
      decoded.objects.clear();
      decoded.text = "Modbus written " + names_text(address, one ? 1U : number_at(pdu, 3), model, decoded.objects);
      return;
    }
    case modbus::Function::encapsulated_interface_transport:
      if (pdu.size() >= 7 && pdu[1] == modbus::read_device_identification) {
        decoded.text = "Modbus device identification " + identification_text(pdu);
        return;
      }
      break;
    default: break;
  }
  decoded.text = fmt::format("Modbus answer to {} {}", function_text(pdu[0]), hex_text(pdu.subspan(1)));
}

}  // namespace servodrome::master
