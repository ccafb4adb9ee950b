#include "describe/esi_document.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <fmt/format.h>

namespace servodrome::describe {

using dictionary::Type;

std::string text_of(const pugi::xml_node& node) {
  const std::string_view text = node.child_value();
  constexpr std::string_view blank = " \t\r\n";
  const std::size_t first = text.find_first_not_of(blank);
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(blank) - first + 1));
}

std::string english(const pugi::xml_node& parent, const char* child) {
  for (const pugi::xml_node& node : parent.children(child)) {
    if (std::string_view(node.attribute("LcId").value()) == "1033") return text_of(node);
  }
  return text_of(parent.child(child));
}

bool is_set(const pugi::xml_attribute& attribute) {
  const std::string_view value = attribute.value();
  return value == "1" || value == "true";
}

std::optional<std::int64_t> parse_xml_number(std::string_view text) {
  const bool negative = text.starts_with('-');
  if (negative) text.remove_prefix(1);
  int base = 10;
  if (text.size() > 2 && (text[0] == '#' || text[0] == '0') && (text[1] == 'x' || text[1] == 'X')) {
    text.remove_prefix(2);
    base = 16;
  }
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return static_cast<std::int64_t>(negative ? ~value + 1 : value);
}

Type type_of_name(std::string_view name, unsigned bits) {
  struct Named {
    std::string_view name;
    Type type;
  };
  constexpr auto names = std::to_array<Named>(
      {{"BOOL", Type::boolean},        {"BIT", Type::boolean},       {"SINT", Type::integer8},
       {"INT8", Type::integer8},       {"INT", Type::integer16},     {"INT16", Type::integer16},
       {"DINT", Type::integer32},      {"INT32", Type::integer32},   {"LINT", Type::integer64},
       {"INT64", Type::integer64},     {"USINT", Type::unsigned8},   {"BYTE", Type::unsigned8},
       {"UINT8", Type::unsigned8},     {"BITARR8", Type::unsigned8}, {"UINT", Type::unsigned16},
       {"WORD", Type::unsigned16},     {"UINT16", Type::unsigned16}, {"BITARR16", Type::unsigned16},
       {"UDINT", Type::unsigned32},    {"DWORD", Type::unsigned32},  {"UINT32", Type::unsigned32},
       {"BITARR32", Type::unsigned32}, {"ULINT", Type::unsigned64},  {"UINT64", Type::unsigned64},
       {"REAL", Type::real32}});
  for (const Named& known : names) {
    if (known.name == name) return known.type;
  }
  if (name.starts_with("STRING")) return Type::visible_string;
  if (name.starts_with("BIT") && bits <= 8) return Type::unsigned8;  // BIT2 .. BIT8
  if (name.empty()) {
    if (bits == 1) return Type::boolean;
    if (bits == 8) return Type::unsigned8;
    if (bits == 16) return Type::unsigned16;
    if (bits == 32) return Type::unsigned32;
  }
  return Type::octet_string;
}

EsiDocument::EsiDocument(const std::string& text, const std::string& file) : file_(file) {
  const pugi::xml_parse_result result = document_.load_buffer(text.data(), text.size());
  text_ = text;
  for (std::size_t i = 0; i < text_.size(); ++i) {
    if (text_[i] == '\n') line_ends_.push_back(i);
  }
  if (!result) {
    const auto offset = static_cast<std::ptrdiff_t>(
        std::clamp<std::ptrdiff_t>(result.offset, 0, static_cast<std::ptrdiff_t>(text.size())));
    throw DeviceFileError(file, static_cast<unsigned>(1 + std::count(text.begin(), text.begin() + offset, '\n')), "",
                          fmt::format("the XML cannot be read: {}", result.description()), "give a whole ESI file");
  }
  if (!root())
    throw DeviceFileError(file, 1, "EtherCATInfo", "there is no such element", "give an ESI file (ETG.2000)");
}

unsigned EsiDocument::line_of(const pugi::xml_node& node) const {
  const std::ptrdiff_t offset = node.offset_debug();
  if (offset < 0 || offset > static_cast<std::ptrdiff_t>(text_.size())) return 0;
  const auto end = std::lower_bound(line_ends_.begin(), line_ends_.end(), static_cast<std::size_t>(offset));
  return static_cast<unsigned>(1 + (end - line_ends_.begin()));
}

void EsiDocument::refuse(const pugi::xml_node& at, const std::string& key, const std::string& problem,
                         const std::string& remedy) const {
  throw DeviceFileError(file_, line_of(at), key, problem, remedy);
}

std::int64_t EsiDocument::number(const pugi::xml_node& node, const char* key) const {
  const auto value = parse_xml_number(text_of(node));
  if (value) return *value;
  refuse(node ? node : root(), key,
         node ? fmt::format("\"{}\" is not a number", text_of(node).substr(0, 40)) : "is missing",
         "write a decimal number, or #x and hexadecimal digits");
}

std::int64_t EsiDocument::number(const pugi::xml_attribute& attribute, const pugi::xml_node& of,
                                 const char* key) const {
  const auto value = parse_xml_number(attribute.value());
  if (value) return *value;
  refuse(of, key,
         attribute ? fmt::format("\"{}\" is not a number", std::string_view(attribute.value()).substr(0, 40))
                   : "is missing",
         "write a decimal number, or #x and hexadecimal digits");
}

}  // namespace servodrome::describe
