#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dictionary/entry.hpp"
#include "line/bench/api_names.hpp"
#include "products/device.hpp"

// The objects of a drive in the form of the API.
namespace servodrome::line::bench {

struct ObjectName {
  std::uint16_t index;
  std::uint8_t sub;
};
// Reads an object's address in hexadecimal, with or without 0x. Throws ApiError 400.
ObjectName object_address(std::string_view index, std::string_view sub);
// Reads a list such as "6040:00,6041:00". Returns each address with its text. Throws ApiError 400.
std::vector<std::pair<std::string, ObjectName>> object_list(std::string_view text);

// Throws the drive's refusal as an ApiError: 422 for a wrong value, 409 for all other reasons.
[[noreturn]] void refuse_access(dictionary::AbortCode abort, std::string where);

// The entry of the object list, with texts for people. `device` must be a device of the product.
Json listed(const dictionary::Entry& entry, products::Device& device, std::string_view product);
// The response to reading an object.
Json shown(const dictionary::Entry& entry, std::span<const std::byte> bytes);
// Returns the bytes to write for a value. Throws ApiError if the value does not fit the object's type.
std::vector<std::byte> bytes_of(const dictionary::Entry& entry, const Json& value, const std::string& where);

}  // namespace servodrome::line::bench
