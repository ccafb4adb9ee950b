#include "describe/device_file.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>

#include "describe/description.hpp"

namespace servodrome::describe {
namespace {

std::string place(const std::string& file, unsigned line, const std::string& key) {
  std::string text = file;
  if (line != 0) text += fmt::format(":{}", line);
  if (!key.empty()) text += ", " + key;
  return text;
}

bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto code = static_cast<unsigned char>(text[i++]);
    unsigned more = code < 0x80 ? 0 : code >= 0xC2 && code < 0xE0 ? 1 : code >= 0xE0 && code < 0xF0 ? 2 : 3;
    if (code >= 0xF5 || (code >= 0x80 && code < 0xC2)) return false;
    for (; more > 0; --more, ++i) {
      if (i == text.size() || (static_cast<unsigned char>(text[i]) & 0xC0) != 0x80) return false;
    }
  }
  return true;
}

// Converts a text to UTF-8 for display. A text that is not UTF-8 is taken as Latin-1, usual in older files.
void make_utf8(std::string& text) {
  if (is_utf8(text)) return;
  std::string result;
  for (const char letter : text) {
    const auto code = static_cast<unsigned char>(letter);
    if (code >= 0x80) result += static_cast<char>(0xC0 | code >> 6);
    result += static_cast<char>(code < 0x80 ? code : 0x80 | (code & 0x3F));
  }
  text = std::move(result);
}

}  // namespace

DeviceFileError::DeviceFileError(std::string file, unsigned line, std::string key, std::string problem,
                                 std::string remedy)
    : DeviceFileError(place(file, line, key), std::move(problem), std::move(remedy)) {}

DeviceFileError::DeviceFileError(std::string where, std::string problem, std::string remedy)
    : std::runtime_error(where + ": " + problem + "; " + remedy),
      where_(std::move(where)),
      problem_(std::move(problem)),
      remedy_(std::move(remedy)) {}

FileEntry file_entry_of(const dictionary::Entry& entry, const std::string& object_name) {
  FileEntry made;
  made.index = entry.index;
  made.sub = entry.sub;
  made.code = entry.code;
  made.type = entry.type;
  made.access = entry.access;
  made.pdo = entry.pdo;
  made.object_name = object_name;
  made.name = entry.name;
  return made;
}

dictionary::Entry entry_of(const FileEntry& entry) {
  dictionary::Entry made;
  made.index = entry.index;
  made.sub = entry.sub;
  made.code = entry.code;
  made.type = entry.type;
  made.access = entry.access;
  made.pdo = entry.pdo;
  made.name = entry.sub == 0 && !entry.object_name.empty() ? entry.object_name.c_str() : entry.name.c_str();
  made.unit = entry.unit.c_str();
  return made;
}

Description description_of(const DeviceFile& device) {
  Description description;
  description.vendor_name = device.vendor_name;
  description.product_name = device.product_name;
  description.order_code = device.order_code;
  description.bit_rates_kbit = device.bit_rates_kbit;
  if (description.bit_rates_kbit.empty()) description.bit_rates_kbit = {10, 20, 50, 125, 250, 500, 800, 1000};
  description.lss_supported = device.lss_supported;
  description.dummy_usage = device.dummy_usage;
  return description;
}

FileEntry& EntryAdder::add(FileEntry&& entry) {
  constexpr std::size_t most_entries = 65536;
  constexpr std::size_t most_text_bytes = std::size_t{32} << 20;  // names and values of all entries together
  text_bytes_ += entry.object_name.size() + entry.name.size() + entry.content.size();
  const char* what = nullptr;
  if (device_.entries.size() == most_entries) what = "more than 65536 objects and sub-indices are described";
  if (text_bytes_ > most_text_bytes) what = "the names and values of its objects are more than 32 MiB";
  if (what != nullptr) throw DeviceFileError(device_.file, entry.line, "", what, "give the file of one device");
  return device_.entries.emplace_back(std::move(entry));
}

const FileEntry* DeviceFile::find(std::uint16_t index, std::uint8_t sub) const {
  const std::uint32_t key = static_cast<std::uint32_t>(index) << 8 | sub;
  const auto found =
      std::lower_bound(entries.begin(), entries.end(), key,
                       [](const FileEntry& entry, std::uint32_t wanted) { return entry.key() < wanted; });
  return found != entries.end() && found->key() == key ? &*found : nullptr;
}

std::string read_text(std::istream& in, const std::string& file) {
  std::string text;
  std::array<char, 65536> part{};
  while (in.read(part.data(), part.size()) || in.gcount() > 0) {
    const std::string_view read(part.data(), static_cast<std::size_t>(in.gcount()));
    if (const std::size_t zero = read.find('\0'); zero != std::string_view::npos) {
      throw DeviceFileError(file, 0, "", fmt::format("byte {} is zero: this is not a text file", text.size() + zero),
                            "give an EDS, DCF or ESI file");
    }
    text += read;
    if (text.size() > most_file_bytes) {
      throw DeviceFileError(file, 0, "", fmt::format("it is longer than {} MiB", most_file_bytes >> 20),
                            "give an EDS, DCF or ESI file");
    }
  }
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  if (text.starts_with(byte_order_mark)) text.erase(0, byte_order_mark.size());
  return text;
}

std::string read_file(const std::string& path) {
  const char* remedy = "give the name of a readable device description";
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) throw DeviceFileError(path, 0, "", "it is a folder", remedy);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw DeviceFileError(path, 0, "", fmt::format("cannot be read: {}", std::strerror(errno)), remedy);
  std::string bytes;
  std::array<char, 65536> part{};
  while (file.read(part.data(), part.size()) || file.gcount() > 0) {
    bytes.append(part.data(), static_cast<std::size_t>(file.gcount()));
    if (bytes.size() > most_file_bytes) {
      throw DeviceFileError(path, 0, "", fmt::format("it is longer than {} MiB", most_file_bytes >> 20), remedy);
    }
  }
  return bytes;
}

std::optional<std::int64_t> parse_file_number(std::string_view text) {
  const bool negative = text.starts_with('-');
  if (negative || text.starts_with('+')) text.remove_prefix(1);
  int base = 10;
  if (text.size() > 2 && text[0] == '0' && (text[1] == 'x' || text[1] == 'X')) {
    text.remove_prefix(2);
    base = 16;
  } else if (text.size() > 1 && text[0] == '0' && text.find_first_not_of("01234567") == std::string_view::npos) {
    base = 8;
  }
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return static_cast<std::int64_t>(negative ? ~value + 1 : value);
}

void settle(DeviceFile& device) {
  for (std::string* text : {&device.vendor_name, &device.product_name, &device.order_code}) make_utf8(*text);
  for (FileEntry& entry : device.entries) make_utf8(entry.name), make_utf8(entry.object_name);
  std::stable_sort(device.entries.begin(), device.entries.end(),
                   [](const FileEntry& a, const FileEntry& b) { return a.key() < b.key(); });
  std::vector<FileEntry> settled;
  const auto note = [&device](const FileEntry& entry, std::string_view what) {
    device.notes.push_back(
        fmt::format("{}:{}: {:04X}:{:02X}: {}", device.file, entry.line, entry.index, entry.sub, what));
  };
  for (FileEntry& entry : device.entries) {
    if (!settled.empty() && settled.back().key() == entry.key()) {
      note(entry, "described twice; the last description is used");
      settled.back() = std::move(entry);
      continue;
    }
    const bool first = settled.empty() || settled.back().index != entry.index;
    if (first && entry.sub != 0) {
      note(entry, "the object has no sub-index 0; one was added");
      FileEntry count;
      count.index = entry.index;
      count.code = entry.code;
      count.type = dictionary::Type::unsigned8;
      count.access = dictionary::Access::ro;
      count.object_name = entry.object_name;
      count.name = "Highest sub-index supported";
      settled.push_back(std::move(count));
    }
    settled.push_back(std::move(entry));
  }
  // All entries of an object get the same object code. A missing count is set to the highest sub-index.
  for (std::size_t begin = 0; begin < settled.size();) {
    std::size_t end = begin + 1;
    while (end < settled.size() && settled[end].index == settled[begin].index) ++end;
    const bool has_subs = end - begin > 1;
    FileEntry& head = settled[begin];
    if (has_subs && head.code == dictionary::ObjectCode::var) head.code = dictionary::ObjectCode::record;
    for (std::size_t i = begin; i < end; ++i) settled[i].code = head.code;
    if (has_subs && !head.default_value && head.type == dictionary::Type::unsigned8) {
      head.default_value = settled[end - 1].sub;
    }
    begin = end;
  }
  device.entries = std::move(settled);
}

}  // namespace servodrome::describe
