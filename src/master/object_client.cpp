#include "master/object_client.hpp"

#include <fmt/format.h>

namespace servodrome::master {

std::vector<std::vector<std::size_t>> ObjectClient::read_together(std::span<const ObjectAddress> objects) const {
  std::vector<std::vector<std::size_t>> sets;
  for (std::size_t i = 0; i < objects.size(); ++i) sets.push_back({i});
  return sets;
}

std::vector<std::vector<std::byte>> ObjectClient::upload_together(std::span<const ObjectAddress> objects) {
  std::vector<std::vector<std::byte>> values;
  for (const ObjectAddress object : objects) values.push_back(upload(object));
  return values;
}

std::string ObjectClient::read_text(std::uint16_t index, std::uint8_t sub) {
  const std::vector<std::byte> bytes = upload({index, sub});
  std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  text.erase(text.find_last_not_of('\0') + 1);
  return text;
}

void ObjectClient::check_size(const std::vector<std::byte>& bytes, std::size_t at_most, ObjectAddress object) const {
  if (bytes.size() <= at_most) return;
  throw ObjectError(fmt::format("{} bytes were received, but at most {} fit", bytes.size(), at_most),
                    fmt::format("{}, {}", where(), text_of(object)),
                    "read it as text or as raw bytes, or with a wider type", false);
}

}  // namespace servodrome::master
