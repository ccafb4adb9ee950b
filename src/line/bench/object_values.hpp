#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dictionary/entry.hpp"
#include "line/bench/error.hpp"
#include "products/device.hpp"

// Objects of a drive as the API writes them.
namespace servodrome::line::bench {

struct ObjectName {
  std::uint16_t index;
  std::uint8_t sub;
};
// Of an address: hexadecimal, with or without 0x. Throws ApiError 400.
ObjectName object_address(std::string_view index, std::string_view sub);
// What "6040:00,6041:00" lists, with the text of each. Throws ApiError 400.
std::vector<std::pair<std::string, ObjectName>> object_list(std::string_view text);

// The drive's refusal: 422 for the value, 409 for everything else.
[[noreturn]] void refuse_access(dictionary::AbortCode abort, std::string where);

// The row of the object list, with what people need beside it. `device` is one of the product.
Json listed(const dictionary::Entry& entry, products::Device& device, std::string_view product);
// The answer to a read.
Json shown(const dictionary::Entry& entry, std::span<const std::byte> bytes);
// What is to be written for a value. Throws ApiError when it is none of the object's type.
std::vector<std::byte> bytes_of(const dictionary::Entry& entry, const Json& value, const std::string& where);

}  // namespace servodrome::line::bench
