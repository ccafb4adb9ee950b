#include "master/modbus/objects.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <numeric>

namespace servodrome::master {
namespace {

// Runs `access`; errors refer to `object`.
template <typename Access>
auto on_object(ObjectAddress object, const Access& access) {
  try {
    return access();
  } catch (const ModbusError& error) {
    const bool absent =
        error.kind() == ModbusError::Kind::refused && error.exception() == modbus::Exception::illegal_data_address;
    throw ObjectError(error.happened(), fmt::format("{}, {}", error.where(), text_of(object)), error.remedy(), absent,
                      error.kind() == ModbusError::Kind::refused);
  }
}

}  // namespace

std::string ModbusObjects::where() const { return fmt::format("{}, unit {}", client_.name(), unit_); }

ModbusObjects::Place ModbusObjects::find(ObjectAddress object) const {
  const auto is_object = [object](const auto& row) { return row.index == object.index && row.sub == object.sub; };
  const auto row = std::find_if(list_.registers.begin(), list_.registers.end(), is_object);
  const auto entry = std::find_if(list_.table.begin(), list_.table.end(), is_object);
  if (row == list_.registers.end() || entry == list_.table.end()) {
    throw ObjectError("there is no register for the object", fmt::format("{}, {}", where(), text_of(object)),
                      "`servodrome export modbus PRODUCT` lists all registers", true);
  }
  return {&*row, &*entry};
}

std::size_t ModbusObjects::significance(std::size_t word, std::size_t words) const {
  return list_.word_order == modbus::WordOrder::low_word_first ? word : words - 1 - word;
}

std::vector<std::byte> ModbusObjects::upload(ObjectAddress object) { return upload_together({&object, 1}).front(); }

std::vector<std::vector<std::size_t>> ModbusObjects::read_together(std::span<const ObjectAddress> objects) const {
  std::vector<std::size_t> order(objects.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto row = [&](std::size_t i) -> const modbus::Register& { return *find(objects[i]).row; };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return row(a).address < row(b).address; });
  std::vector<std::vector<std::size_t>> sets;
  for (const std::size_t i : order) {
    if (!sets.empty()) {
      const modbus::Register& first = row(sets.back().front());
      const modbus::Register& last = row(sets.back().back());
      const unsigned end = row(i).address + row(i).words;
      if (last.address + last.words == row(i).address && end - first.address <= modbus::most_registers_read) {
        sets.back().push_back(i);
        continue;
      }
    }
    sets.push_back({i});
  }
  return sets;
}

std::vector<std::vector<std::byte>> ModbusObjects::upload_together(std::span<const ObjectAddress> objects) {
  std::vector<Place> places;
  std::size_t words = 0;
  for (const ObjectAddress object : objects) {
    places.push_back(find(object));
    words += places.back().row->words;
  }
  const auto registers = on_object(objects.front(), [&] {
    return client_.read_holding_registers(unit_, places.front().row->address, static_cast<std::uint16_t>(words));
  });
  std::vector<std::vector<std::byte>> values;
  for (const Place& place : places) {
    const auto first = static_cast<std::size_t>(place.row->address - places.front().row->address);
    values.push_back(bytes_of(place, std::span(registers).subspan(first, place.row->words)));
  }
  return values;
}

std::vector<std::byte> ModbusObjects::bytes_of(const Place& place, std::span<const std::uint16_t> registers) const {
  const std::size_t words = place.row->words;
  std::vector<std::byte> bytes(2 * words);
  for (std::size_t word = 0; word < words; ++word) {
    const std::size_t at = 2 * significance(word, words);
    bytes[at] = static_cast<std::byte>(registers[word] & 0xFF);
    bytes[at + 1] = static_cast<std::byte>(registers[word] >> 8);
  }
  bytes.resize(dictionary::size_of(place.entry->type));
  return bytes;
}

void ModbusObjects::download(ObjectAddress object, std::span<const std::byte> data) {
  const Place place = find(object);
  if (data.size() != dictionary::size_of(place.entry->type)) {
    throw ObjectError(
        fmt::format("the object has {} bytes, not {}", dictionary::size_of(place.entry->type), data.size()),
        fmt::format("{}, {}", where(), text_of(object)), "give the object's own data type", false);
  }
  const std::size_t words = place.row->words;
  const bool negative = dictionary::is_signed(place.entry->type) && (data.back() & std::byte{0x80}) != std::byte{0};
  std::vector<std::byte> bytes(data.begin(), data.end());
  bytes.resize(2 * words, negative ? std::byte{0xFF} : std::byte{0});
  std::vector<std::uint16_t> registers(words);
  for (std::size_t word = 0; word < words; ++word) {
    const std::size_t at = 2 * significance(word, words);
    registers[word] = static_cast<std::uint16_t>(std::to_integer<unsigned>(bytes[at + 1]) << 8 |
                                                 std::to_integer<unsigned>(bytes[at]));
  }
  on_object(object, [&] {
    if (words == 1) {
      client_.write_single_register(unit_, place.row->address, registers[0]);
    } else {
      client_.write_multiple_registers(unit_, place.row->address, registers);
    }
  });
}

}  // namespace servodrome::master
