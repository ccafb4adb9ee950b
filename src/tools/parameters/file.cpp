#include "tools/parameters/file.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>

#include "axis/object_catalogue.hpp"
#include "dictionary/dictionary.hpp"

namespace servodrome::master {
namespace {

using dictionary::Type;

constexpr std::string_view first_line = "# servodrome parameters 1";
constexpr std::string_view last_line = "end";
constexpr std::string_view node_id_prefix = "$NODEID+";
constexpr std::string_view blanks = " \t";

bool is_printable(char c) { return c >= 0x20 && c < 0x7F; }

std::string quoted(std::span<const std::byte> bytes) {
  std::string text = "\"";
  for (const std::byte byte : bytes) {
    const char c = static_cast<char>(byte);
    if (c == '"' || c == '\\') {
      text += fmt::format("\\{}", c);
    } else if (is_printable(c)) {
      text += c;
    } else {
      text += fmt::format("\\x{:02X}", std::to_integer<unsigned>(byte));
    }
  }
  return text + '"';
}

// True for numbers of the communication area that are identifiers, mappings or PDO indices rather than quantities.
bool is_hexadecimal(ObjectAddress address, Type type) {
  const bool is_time = address.index == 0x1006 || address.index == 0x1007;
  const bool is_assignment = address.index >= 0x1C00 && type == Type::unsigned16;
  return address.index < 0x2000 && !is_time && (type == Type::unsigned32 || is_assignment);
}

// Reads one line word by word.
class Reader {
 public:
  Reader(const std::string& file, std::string_view line, unsigned number) : file_(file), line_(line), number_(number) {}

  // Returns the next word; empty at the end of the line. Text in quotes is one word.
  std::string_view word() {
    skip_blanks();
    begin_ = at_;
    if (at_ < line_.size() && line_[at_] == '"') {
      for (++at_; at_ < line_.size() && line_[at_] != '"'; ++at_) {
        if (line_[at_] == '\\') ++at_;
      }
      if (at_ >= line_.size()) fail("the text has no closing quote", "end it with \"");
      ++at_;
    } else {
      at_ = std::min(line_.find_first_of(blanks, at_), line_.size());
    }
    return line_.substr(begin_, at_ - begin_);
  }
  std::string rest() {
    skip_blanks();
    return std::string(line_.substr(at_));
  }
  unsigned column() const { return static_cast<unsigned>(begin_) + 1; }  // column of the last word
  unsigned number() const { return number_; }
  [[noreturn]] void fail(const std::string& what, const std::string& remedy) const {
    throw MasterError(what, fmt::format("{}:{}:{}", file_, number_, column()), remedy);
  }

 private:
  void skip_blanks() { at_ = std::min(line_.find_first_not_of(blanks, at_), line_.size()); }

  const std::string& file_;
  std::string_view line_;
  unsigned number_;
  std::size_t at_ = 0;
  std::size_t begin_ = 0;
};

int digit_of(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

// Decodes text in quotes, as written by quoted().
std::vector<std::byte> unquoted(const Reader& reader, std::string_view word) {
  if (word.size() < 2 || word.front() != '"') reader.fail("a string stands in quotes", "write \"TEXT\"");
  word = word.substr(1, word.size() - 2);
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i < word.size(); ++i) {
    if (word[i] != '\\') {
      bytes.push_back(static_cast<std::byte>(word[i]));
      continue;
    }
    const char escaped = word[++i];  // exists: the last character is a quote that is not escaped
    if (escaped == '"' || escaped == '\\') {
      bytes.push_back(static_cast<std::byte>(escaped));
      continue;
    }
    const int high = escaped == 'x' && i + 2 < word.size() ? digit_of(word[i + 1]) : -1;
    const int low = high >= 0 ? digit_of(word[i + 2]) : -1;
    if (low < 0) reader.fail("after \\ comes \", \\ or x and two hexadecimal digits", "write \\\\ for the letter \\");
    bytes.push_back(static_cast<std::byte>(high * 16 + low));
    i += 2;
  }
  return bytes;
}

ObjectAddress parse_address(const Reader& reader, std::string_view word) {
  const auto number = [](std::string_view digits) -> std::optional<unsigned> {
    unsigned value = 0;
    for (const char c : digits) {
      if (digit_of(c) < 0) return std::nullopt;
      value = value * 16 + static_cast<unsigned>(digit_of(c));
    }
    return value;
  };
  constexpr std::size_t index_digits = 4;
  constexpr std::size_t length = 7;
  const bool formed = word.size() == length && word[index_digits] == ':';
  const auto index = formed ? number(word.substr(0, index_digits)) : std::nullopt;
  const auto sub = formed ? number(word.substr(index_digits + 1)) : std::nullopt;
  if (!index || !sub) {
    reader.fail(fmt::format("\"{}\" is not an object", word), "write INDEX:SUB with four and two hexadecimal digits");
  }
  return {static_cast<std::uint16_t>(*index), static_cast<std::uint8_t>(*sub)};
}

std::vector<std::byte> parse_bytes(const Reader& reader, std::string_view word, Type type) {
  if (type == Type::visible_string) return unquoted(reader, word);
  if (dictionary::size_of(type) == 0 && word == "-") return {};
  std::vector<std::byte> bytes;
  try {
    bytes = parse_value(word, type);
  } catch (const MasterError& error) {
    reader.fail(fmt::format("\"{}\" is not a value of type {}: {}", word, short_word(type), error.happened()),
                "correct the value or remove the line");
  }
  if (type == Type::real32) {
    float number = 0;
    std::memcpy(&number, bytes.data(), sizeof number);
    if (!std::isfinite(number)) reader.fail(fmt::format("\"{}\" is not a finite number", word), "correct the value");
  }
  return bytes;
}

ParameterValue parse_parameter(Reader& reader, std::string_view first) {
  ParameterValue value{.address = parse_address(reader, first), .line = reader.number()};
  const std::string_view type_word = reader.word();
  const auto type = parse_type(type_word);
  if (!type) {
    reader.fail(fmt::format("\"{}\" is not a type", type_word),
                "write i8 .. i64, u8 .. u64, bool, f32, string or bytes behind the object");
  }
  value.type = *type;
  std::string_view word = reader.word();
  value.column = reader.column();
  if (word.empty()) reader.fail("there is no value", "write one behind the type");
  value.adds_node_id = word.starts_with(node_id_prefix);
  if (value.adds_node_id) {
    word.remove_prefix(node_id_prefix.size());
    if (dictionary::size_of(*type) == 0 || *type == Type::real32 || word.empty()) {
      reader.fail("only a whole number can be relative to the node-ID", "write $NODEID+NUMBER");
    }
  }
  value.bytes = parse_bytes(reader, word, *type);
  value.name = reader.rest();
  if (value.name.starts_with('[')) {
    const std::size_t end = value.name.find(']');
    value.unit = value.name.substr(1, end == std::string::npos ? end : end - 1);
    value.name.erase(0, end == std::string::npos ? end : value.name.find_first_not_of(" \t", end + 1));
  }
  return value;
}

std::uint32_t parse_identity(const Reader& reader, std::string_view word) {
  std::uint32_t number = 0;
  const auto bytes = parse_bytes(reader, word, Type::unsigned32);
  std::memcpy(&number, bytes.data(), sizeof number);
  return number;
}

// Parses a `KEY: VALUE` line. Unknown keys are ignored, because a later version of the format may define them.
void parse_key(Reader& reader, std::string_view key, ParameterFile& file) {
  const std::string_view word = reader.word();
  DriveIdentity& identity = file.identity;
  const auto text = [&] {
    const auto bytes = unquoted(reader, word);
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  if (key == "product:") {
    identity.product = word;
  } else if (key == "vendor:") {
    identity.vendor_id = parse_identity(reader, word);
  } else if (key == "product-code:") {
    identity.product_code = parse_identity(reader, word);
  } else if (key == "revision:") {
    identity.revision = parse_identity(reader, word);
  } else if (key == "device:") {
    identity.device_name = text();
  } else if (key == "software:") {
    identity.software_version = text();
  } else if (key == "date:") {
    file.date = word;
  }
}

}  // namespace

DriveIdentity DriveIdentity::read(ObjectClient& objects, std::string_view product) {
  const auto text_if_present = [&objects](std::uint16_t index) -> std::string {
    try {
      return objects.read_text(index);
    } catch (const ObjectError& error) {
      if (!error.answered()) throw;
      return {};
    }
  };
  DriveIdentity identity{.product = std::string(product)};
  identity.vendor_id = objects.read_if_present<std::uint32_t>(0x1018, 1);
  if (identity.vendor_id) {
    identity.product_code = objects.read_if_present<std::uint32_t>(0x1018, 2);
    identity.revision = objects.read_if_present<std::uint32_t>(0x1018, 3);
  }
  identity.device_name = text_if_present(0x1008);
  identity.software_version = text_if_present(0x100A);
  return identity;
}

std::optional<bool> DriveIdentity::is_same_product(const DriveIdentity& other) const {
  if (vendor_id && other.vendor_id) {
    return vendor_id == other.vendor_id && (!product_code || !other.product_code || product_code == other.product_code);
  }
  if (!product.empty() && !other.product.empty()) return product == other.product;
  return std::nullopt;
}

std::string DriveIdentity::text() const {
  std::string text = !product.empty() ? product : !device_name.empty() ? device_name : "a drive without name";
  if (!vendor_id) return text;
  text += fmt::format(" (vendor {:08X}h", *vendor_id);
  if (product_code) text += fmt::format(", product {:08X}h", *product_code);
  return text + ")";
}

const ParameterValue* ParameterFile::find(ObjectAddress address) const {
  const auto found = std::find_if(values.begin(), values.end(),
                                  [address](const ParameterValue& value) { return value.address == address; });
  return found != values.end() ? &*found : nullptr;
}

std::string text_of(const ParameterValue& value) {
  if (value.type == Type::visible_string) return quoted(value.bytes);
  const std::size_t size = dictionary::size_of(value.type);
  if (size == 0) {
    std::string text;
    for (const std::byte byte : value.bytes) text += fmt::format("{:02X}", std::to_integer<unsigned>(byte));
    return text.empty() ? "-" : text;
  }
  if (value.type == Type::real32) return text_of_value(value.bytes, value.type);
  const std::int64_t number = dictionary::decode_number(value.type, value.bytes);
  const char* prefix = value.adds_node_id ? "$NODEID+" : "";
  if (value.adds_node_id || is_hexadecimal(value.address, value.type)) {
    return fmt::format("{}{:0{}X}h", prefix, static_cast<std::uint64_t>(number), value.adds_node_id ? 1 : 2 * size);
  }
  if (value.type == Type::unsigned64) return fmt::format("{}", static_cast<std::uint64_t>(number));
  return fmt::format("{}", number);
}

std::string ParameterFile::text() const {
  std::string text = fmt::format("{}\n", first_line);
  const auto bytes_of = [](const std::string& words) { return std::as_bytes(std::span(words)); };
  if (!identity.product.empty()) text += fmt::format("product: {}\n", identity.product);
  if (identity.vendor_id) text += fmt::format("vendor: {:08X}h\n", *identity.vendor_id);
  if (identity.product_code) text += fmt::format("product-code: {:08X}h\n", *identity.product_code);
  if (identity.revision) text += fmt::format("revision: {:08X}h\n", *identity.revision);
  if (!identity.device_name.empty()) text += fmt::format("device: {}\n", quoted(bytes_of(identity.device_name)));
  if (!identity.software_version.empty()) {
    text += fmt::format("software: {}\n", quoted(bytes_of(identity.software_version)));
  }
  if (!date.empty()) text += fmt::format("date: {}\n", date);
  std::uint16_t index = 0;
  for (const ParameterValue& value : values) {
    if (value.address.index >> 12 != index >> 12) text += "\n";  // a blank line between two areas of the dictionary
    index = value.address.index;
    std::string line = fmt::format("{}  {:<6}  {:<14}", text_of(value.address), short_word(value.type), text_of(value));
    if (!value.unit.empty()) line += fmt::format("  [{}]", value.unit);
    if (!value.name.empty()) line += fmt::format("  {}", value.name);
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  return text + fmt::format("{}\n", last_line);
}

ParameterFile ParameterFile::read(std::istream& in, const std::string& name) {
  ParameterFile file;
  std::string line;
  unsigned number = 0;
  bool complete = false;
  std::map<ObjectAddress, unsigned> lines;
  while (std::getline(in, line)) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    Reader reader(name, line, number);
    if (number == 1 && line != first_line) {
      reader.fail("this is not a parameter file", fmt::format("its first line is \"{}\"", first_line));
    }
    if (line.find('\0') != std::string::npos) reader.fail("the line holds a zero byte", "the file is damaged");
    const std::string_view first = reader.word();
    if (first.empty() || first.front() == '#') continue;
    if (complete) reader.fail("something comes behind the line \"end\"", "remove it, or put it before that line");
    if (first == last_line) {
      complete = true;
    } else if (first.back() == ':') {
      parse_key(reader, first, file);
    } else {
      const unsigned column = reader.column();
      file.values.push_back(parse_parameter(reader, first));
      const auto [same, is_new] = lines.emplace(file.values.back().address, number);
      if (!is_new) {
        throw MasterError(fmt::format("{} is there already, in line {}", first, same->second),
                          fmt::format("{}:{}:{}", name, number, column), "remove one of them");
      }
    }
  }
  if (number == 0) throw MasterError("the file is empty", fmt::format("{}:1:1", name), "save the parameters again");
  if (!complete) {
    throw MasterError("the file ends without its line \"end\": it is not complete",
                      fmt::format("{}:{}:1", name, number), "save the parameters again");
  }
  std::stable_sort(file.values.begin(), file.values.end(),
                   [](const ParameterValue& a, const ParameterValue& b) { return a.address < b.address; });
  return file;
}

std::vector<std::byte> bytes_for(const ParameterValue& value, std::optional<std::uint8_t> node_id) {
  if (!value.adds_node_id) return value.bytes;
  if (!node_id) {
    throw MasterError("the value is relative to the node-ID, which only CANopen has", text_of(value.address),
                      "load the file over CAN, or write the number");
  }
  const std::int64_t number = dictionary::decode_number(value.type, value.bytes) + *node_id;
  const auto bytes = dictionary::encode_number(number);
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(dictionary::size_of(value.type))};
}

}  // namespace servodrome::master
