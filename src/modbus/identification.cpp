#include <cstring>

#include "modbus/server.hpp"

// Function 2Bh/0Eh, read device identification (Modbus Application Protocol V1.1b3, 6.21).
namespace servodrome::modbus {
namespace {

constexpr std::uint8_t last_basic_object = 0x02;
constexpr std::uint8_t last_regular_object = 0x7F;
constexpr std::uint8_t last_extended_object = 0xFF;
constexpr std::uint8_t individual_access = 0x80;  // bit in the conformity level: objects can be read one by one

// Read device ID codes: the first three read all objects of a category as a stream, the last reads a single object.
enum class Category : std::uint8_t { basic = 1, regular = 2, extended = 3, individual = 4 };

constexpr std::uint8_t last_object(Category category) {
  switch (category) {
    case Category::basic: return last_basic_object;
    case Category::regular: return last_regular_object;
    default: return last_extended_object;
  }
}

constexpr std::uint8_t conformity(std::uint8_t highest_object) {
  const unsigned level = highest_object <= last_basic_object ? 1U : highest_object <= last_regular_object ? 2U : 3U;
  return static_cast<std::uint8_t>(individual_access | level);
}

constexpr std::size_t header_bytes = 7;  // before the first object
constexpr std::size_t longest_text = longest_pdu - header_bytes - 2;

}  // namespace

Exception Server::identify(std::span<const std::uint8_t> request, Response response, std::size_t& length) const {
  const auto objects = profile_.identification;
  if (objects.empty() || request.size() < 2 || request[1] != read_device_identification) {
    return Exception::illegal_function;
  }
  if (request.size() != 4 || request[2] < 1 || request[2] > 4) return Exception::illegal_data_value;
  const auto category = static_cast<Category>(request[2]);
  const auto is_wanted = [&request](const Identification& row) { return row.object == request[3]; };
  auto row = std::find_if(objects.begin(), objects.end(), is_wanted);
  if (category == Category::individual && row == objects.end()) return Exception::illegal_data_address;
  // A stream that should start at a missing object, or one outside the category, starts at the beginning.
  if (row == objects.end() || row->object > last_object(category)) row = objects.begin();

  std::copy_n(request.begin(), 3, response.begin());
  response[3] = conformity(objects.back().object);
  response[4] = 0x00;  // 0: no more objects follow
  response[5] = 0x00;  // next object
  response[6] = 0;     // number of objects
  length = header_bytes;
  for (; row != objects.end() && row->object <= last_object(category); ++row) {
    const std::size_t size = std::min(std::strlen(row->text), longest_text);
    if (length + 2 + size > longest_pdu) {
      response[4] = 0xFF;
      response[5] = row->object;
      break;
    }
    response[length] = row->object;
    response[length + 1] = static_cast<std::uint8_t>(size);
    std::memcpy(&response[length + 2], row->text, size);
    length += 2 + size;
    ++response[6];
    if (category == Category::individual) break;
  }
  return Exception::none;
}

}  // namespace servodrome::modbus
