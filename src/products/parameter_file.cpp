#include "products/parameter_file.hpp"

#include <algorithm>
#include <charconv>
#include <cstring>

namespace servodrome::products {

using dictionary::AbortCode;
using dictionary::Entry;
using ethercat::FoeError;

namespace {

// Like substr, but without its exception, because portable code must not throw.
constexpr std::string_view part(std::string_view text, std::size_t from, std::size_t length) {
  text.remove_prefix(std::min(from, text.size()));
  return {text.data(), std::min(length, text.size())};
}

constexpr std::string_view first_line = "# servodrome parameters 1";
constexpr std::uint16_t identity = 0x1018;
constexpr std::uint8_t vendor = 1;
constexpr std::uint8_t product = 2;

bool is_stored(const Entry& entry) {
  return entry.saved && entry.writable() && entry.readable() &&
         (entry.fixed_size() || entry.offset != dictionary::Field::no_storage);
}

bool says_what_it_is(const Entry& entry) {
  return entry.index == identity && (entry.sub == vendor || entry.sub == product);
}

// All of `text` as a number of this type.
template <typename Number>
bool read_number(std::string_view text, int base, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, base);
  return error == std::errc{} && end == text.data() + text.size();
}

}  // namespace

// ---- Text ----

void ParameterFile::put(char letter) {
  if (length_ < text_.size()) text_[length_++] = letter;
}
void ParameterFile::put(std::string_view words) {
  for (const char letter : words) put(letter);
}
void ParameterFile::put_hex(std::uint32_t number, unsigned digits) {
  for (unsigned i = digits; i-- > 0;) put("0123456789ABCDEF"[number >> 4 * i & 15]);
}
void ParameterFile::put_decimal(std::int64_t number) {
  std::array<char, 24> digits{};
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), number);
  put({digits.data(), static_cast<std::size_t>(end - digits.data())});
}

void ParameterFile::compose_line(const Entry& entry) {
  dictionary::ReadValue value;
  if (dictionary_.read(entry, value) != AbortCode::none) return;
  put("0x");
  put_hex(entry.index, 4);
  put(':');
  put_hex(entry.sub, 2);
  put('=');
  if (says_what_it_is(entry) || entry.type == dictionary::Type::real32) {
    put("0x");
    put_hex(static_cast<std::uint32_t>(dictionary::decode_number(entry.type, value.bytes)), 8);
  } else if (entry.fixed_size()) {
    put_decimal(dictionary::decode_number(entry.type, value.bytes));
  } else {
    for (const std::byte byte : value.bytes) put_hex(static_cast<std::uint32_t>(byte), 2);
  }
  put('\n');
}

void ParameterFile::compose() {
  length_ = 0;
  put(first_line);
  put('\n');
  for (const Entry& entry : dictionary_.table()) {
    if (says_what_it_is(entry) || is_stored(entry)) compose_line(entry);
  }
}

FoeError ParameterFile::refuse(FoeError error, std::string_view words, unsigned line) {
  reason_length_ = 0;
  const auto add = [this](std::string_view text) {
    const std::size_t count = std::min(text.size(), reason_.size() - reason_length_);
    std::copy_n(text.begin(), count, reason_.begin() + static_cast<std::ptrdiff_t>(reason_length_));
    reason_length_ += count;
  };
  if (line != 0) {
    std::array<char, 8> digits{};
    const auto [end, ignored] = std::to_chars(digits.data(), digits.data() + digits.size(), line);
    add("line ");
    add({digits.data(), static_cast<std::size_t>(end - digits.data())});
    add(": ");
  }
  add(words);
  return error;
}

// ---- Lines ----

bool ParameterFile::parse_value(std::string_view text, Assignment& assignment) {
  const Entry& entry = *assignment.entry;
  if (!entry.fixed_size()) {
    if (text.size() % 2 != 0 || text.size() / 2 > value_.size()) return false;
    for (std::size_t i = 0; i < text.size(); i += 2) {
      std::uint8_t byte = 0;
      if (!read_number(part(text, i, 2), 16, byte)) return false;
      value_[i / 2] = std::byte{byte};
    }
    assignment.size = text.size() / 2;
    return true;
  }
  std::int64_t number = 0;
  const bool hexadecimal = text.starts_with("0x");
  std::uint64_t bits = 0;
  if (hexadecimal ? !read_number(part(text, 2, text.size()), 16, bits) : !read_number(text, 10, number)) return false;
  if (hexadecimal) number = static_cast<std::int64_t>(bits);
  // The limits of the type are checked here, because the dictionary gets the number only after it is cut to its size.
  if (entry.type != dictionary::Type::unsigned64 &&
      (number < dictionary::minimum_of(entry.type) || number > dictionary::maximum_of(entry.type))) {
    return false;
  }
  assignment.size = dictionary::size_of(entry.type);
  const auto bytes = dictionary::encode_number(number);
  std::copy_n(bytes.begin(), assignment.size, value_.begin());
  return true;
}

ParameterFile::Line ParameterFile::parse(std::string_view line, Assignment& assignment) {
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  if (line.empty() || line.front() == '#') return Line::comment;
  constexpr std::size_t head = 10;  // 0xIIII:SS=
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  if (line.size() < head || !line.starts_with("0x") || line[6] != ':' || line[9] != '=' ||
      !read_number(part(line, 2, 4), 16, index) || !read_number(part(line, 7, 2), 16, sub)) {
    return Line::wrong;
  }
  assignment.entry = dictionary_.find(index, sub);
  if (assignment.entry == nullptr) return Line::assignment;
  return parse_value(part(line, head, line.size()), assignment) ? Line::assignment : Line::wrong;
}

// The reason why the drive refuses the assignment; nullptr if it accepts it.
const char* ParameterFile::objection(const Assignment& assignment) const {
  if (assignment.entry == nullptr) return "no such object";
  const std::span<const std::byte> value = std::span(value_).first(assignment.size);
  if (says_what_it_is(*assignment.entry)) {
    const bool same = dictionary_.number(*assignment.entry) == dictionary::decode_number(assignment.entry->type, value);
    return same ? nullptr : "of another product";
  }
  if (!is_stored(*assignment.entry)) return "not a stored object";
  const AbortCode abort = dictionary_.check(*assignment.entry, value);
  return abort == AbortCode::none ? nullptr : dictionary::text(abort);
}

template <typename Visit>
FoeError ParameterFile::for_each_line(Visit visit) {
  std::string_view rest(text_.data(), length_);
  for (unsigned number = 1; !rest.empty(); ++number) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    if (const FoeError error = visit(number, part(rest, 0, end)); error != FoeError::none) return error;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return FoeError::none;
}

FoeError ParameterFile::take() {
  unsigned identified = 0;
  FoeError error = for_each_line([&](unsigned number, std::string_view line) {
    if (number == 1 && !line.starts_with(first_line)) {
      return refuse(FoeError::illegal, "not a parameter file", number);
    }
    Assignment assignment;
    const Line kind = parse(line, assignment);
    if (kind == Line::wrong) return refuse(FoeError::illegal, "not INDEX:SUB=VALUE of this object", number);
    if (kind == Line::comment) return FoeError::none;
    if (const char* words = objection(assignment)) return refuse(FoeError::illegal, words, number);
    if (says_what_it_is(*assignment.entry)) ++identified;
    return FoeError::none;
  });
  if (error != FoeError::none) return error;
  if (identified < 2) return refuse(FoeError::illegal, "does not say of which vendor and product it is");
  old_length_ = 0;
  error = apply();
  if (error != FoeError::none) undo();
  return error;
}

FoeError ParameterFile::apply() {
  const FoeError error = for_each_line([this](unsigned number, std::string_view line) { return assign(number, line); });
  if (error != FoeError::none) return error;
  if (dictionary::Store(*medium_).save(dictionary_, dictionary::Area::all) != AbortCode::none) {
    return refuse(FoeError::program_error, "the memory does not take the parameters");
  }
  return FoeError::none;
}

FoeError ParameterFile::assign(unsigned number, std::string_view line) {
  Assignment assignment;
  if (parse(line, assignment) != Line::assignment || says_what_it_is(*assignment.entry)) return FoeError::none;
  if (!remember(*assignment.entry)) return refuse(FoeError::disk_full, "too many old values to keep", number);
  // All lines were checked before, so a refusal here means that an earlier line of the file conflicts with this one.
  const AbortCode abort = dictionary_.write(*assignment.entry, std::span(value_).first(assignment.size));
  return abort == AbortCode::none ? FoeError::none : refuse(FoeError::illegal, dictionary::text(abort), number);
}

// Pushes the present value of an object. Returns false if there is no room.
bool ParameterFile::remember(const Entry& entry) {
  const std::byte* place = dictionary_.storage(entry);
  if (place == nullptr) return true;
  std::uint32_t size = dictionary::size_of(entry.type);
  if (size == 0) {
    std::memcpy(&size, place, sizeof size);
    place += sizeof size;
  }
  const OldValue old{static_cast<std::uint16_t>(size), static_cast<std::uint16_t>(&entry - dictionary_.table().data())};
  if (size > longest_value || size + sizeof old > old_values_.size() - old_length_) return false;
  std::copy_n(place, size, old_values_.begin() + static_cast<std::ptrdiff_t>(old_length_));
  old_length_ += size;
  std::memcpy(&old_values_[old_length_], &old, sizeof old);
  old_length_ += sizeof old;
  return true;
}

// Writes the old values back, the last one first: so each is written to the state in which it was valid before.
void ParameterFile::undo() {
  while (old_length_ > 0) {
    OldValue old;
    old_length_ -= sizeof old;
    std::memcpy(&old, &old_values_[old_length_], sizeof old);
    old_length_ -= old.size;
    dictionary_.write(dictionary_.table()[old.place], std::span(old_values_).subspan(old_length_, old.size));
  }
}

// ---- FoE ----

FoeError ParameterFile::open(std::string_view file, std::uint32_t, bool writes) {
  reason_length_ = 0;
  if (file != name) return refuse(FoeError::not_found, "the only file is parameters.txt");
  if (!writes) {
    compose();
    if (length_ == text_.size()) return refuse(FoeError::disk_full, "more parameters than a file holds");
    return FoeError::none;
  }
  length_ = 0;
  if (drive_.energised()) return refuse(FoeError::access_denied, "the motor has power");
  if (medium_ == nullptr) return refuse(FoeError::access_denied, "there is no memory for parameters");
  return FoeError::none;
}

FoeError ParameterFile::read(std::uint32_t position, std::span<std::uint8_t> into, std::size_t& count) {
  count = position < length_ ? std::min(into.size(), length_ - position) : 0;
  std::copy_n(text_.begin() + position, count, into.begin());
  return FoeError::none;
}

FoeError ParameterFile::write(std::uint32_t, std::span<const std::uint8_t> data, bool last) {
  if (data.size() > text_.size() - length_) return refuse(FoeError::disk_full, "the file is too long");
  std::copy(data.begin(), data.end(), text_.begin() + static_cast<std::ptrdiff_t>(length_));
  length_ += data.size();
  if (!last) return FoeError::none;
  if (drive_.energised()) return refuse(FoeError::access_denied, "the motor has power");
  return take();
}

}  // namespace servodrome::products
