#include "dictionary/store.hpp"

#include <algorithm>
#include <optional>

namespace servodrome::dictionary {
namespace {

constexpr std::size_t chunk_size = 64;  // bytes moved at a time; on the stack
using Chunk = std::array<std::byte, chunk_size>;

constexpr auto crc_of_nibble = [] {
  std::array<std::uint32_t, 16> table{};
  for (std::uint32_t nibble = 0; nibble < 16; ++nibble) {
    std::uint32_t crc = nibble;
    for (int bit = 0; bit < 4; ++bit) crc = (crc & 1) != 0 ? crc >> 1 ^ 0xEDB88320 : crc >> 1;
    table[nibble] = crc;
  }
  return table;
}();

template <typename T>
std::span<const std::byte> bytes_of(const T& value) {
  return std::as_bytes(std::span(&value, 1));
}

std::uint32_t crc_of_header(const StoreHeader& header) {
  return crc32(bytes_of(header).first(offsetof(StoreHeader, crc)));
}

// A valid bank: its address and its header.
struct Image {
  std::uint32_t bank;  // address
  StoreHeader header;
};

// The content of a bank. A bank that cannot be read is distinguished from an empty one, because it may hold the newest
// values and must not be overwritten.
struct Inspection {
  bool readable = false;
  std::optional<Image> image;
};

Inspection inspect(Medium& medium, std::uint32_t bank, std::uint32_t capacity) {
  StoreHeader header;
  if (!medium.read(bank, std::as_writable_bytes(std::span(&header, 1)))) return {};
  const std::uint32_t room = capacity - static_cast<std::uint32_t>(sizeof header);
  if (header.mark != StoreHeader::valid_mark || header.version != StoreHeader::current_version ||
      header.payload_length > room) {
    return {.readable = true, .image = {}};
  }
  std::uint32_t crc = crc_of_header(header);
  Chunk chunk;
  for (std::uint32_t done = 0; done < header.payload_length;) {
    const auto part = std::span(chunk).first(std::min<std::size_t>(chunk_size, header.payload_length - done));
    if (!medium.read(bank + static_cast<std::uint32_t>(sizeof header) + done, part)) return {};
    crc = crc32(part, crc);
    done += static_cast<std::uint32_t>(part.size());
  }
  if (crc != header.crc) return {.readable = true, .image = {}};
  return {.readable = true, .image = Image{bank, header}};
}

struct Banks {
  std::uint32_t capacity;
  bool readable;  // both banks are readable
  std::optional<Image> newest;
};

// Serial number arithmetic, so that the order is right after the sequence number wraps.
bool is_newer(std::uint32_t a, std::uint32_t b) { return static_cast<std::int32_t>(a - b) > 0; }

Banks inspect(Medium& medium) {
  const std::uint32_t capacity = medium.size() / 2;
  if (capacity < sizeof(StoreHeader)) return {capacity, false, {}};
  const Inspection first = inspect(medium, 0, capacity);
  const Inspection second = inspect(medium, capacity, capacity);
  const bool second_is_newer =
      second.image && (!first.image || is_newer(second.image->header.sequence, first.image->header.sequence));
  return {capacity, first.readable && second.readable, second_is_newer ? second.image : first.image};
}

// Returns true if the medium is as manufactured from this address on, so that no save has ever begun there. Returns
// false if it does not respond.
bool is_erased(Medium& medium, std::uint32_t from = 0) {
  Chunk chunk;
  std::byte first{};
  for (std::uint32_t done = from; done < medium.size();) {
    const auto part = std::span(chunk).first(std::min<std::size_t>(chunk_size, medium.size() - done));
    if (!medium.read(done, part)) return false;
    if (done == from) first = part.front();
    if (!std::all_of(part.begin(), part.end(), [first](std::byte byte) { return byte == first; })) return false;
    done += static_cast<std::uint32_t>(part.size());
  }
  return first == std::byte{0x00} || first == std::byte{0xFF};
}

// Returns true if no save has ever been completed: the medium is erased, or its very first save was interrupted.
bool is_without_save(Medium& medium) {
  StoreHeader header;
  if (!medium.read(0, std::as_writable_bytes(std::span(&header, 1)))) return false;
  return is_erased(medium, header.mark == StoreHeader::begun_mark ? medium.size() / 2 : 0);
}

struct Record {
  std::uint16_t index;
  std::uint8_t sub;
  std::uint16_t size;
  std::uint32_t address;  // of the value in the medium
};

// Walks the records of an image.
class RecordReader {
 public:
  RecordReader(Medium& medium, const Image& image)
      : medium_(medium),
        position_(image.bank + static_cast<std::uint32_t>(sizeof(StoreHeader))),
        end_(position_ + image.header.payload_length) {}

  bool next(Record& record) {
    std::array<std::byte, Store::record_overhead> head;
    if (end_ - position_ < head.size()) return false;
    if (!medium_.read(position_, head)) {
      failed_ = true;
      return false;
    }
    std::memcpy(&record.index, head.data(), 2);
    std::memcpy(&record.sub, head.data() + 2, 1);
    std::memcpy(&record.size, head.data() + 3, 2);
    record.address = position_ + static_cast<std::uint32_t>(head.size());
    if (end_ - record.address < record.size) return false;
    position_ = record.address + record.size;
    return true;
  }

  bool failed() const { return failed_; }

 private:
  Medium& medium_;
  std::uint32_t position_;
  std::uint32_t end_;
  bool failed_ = false;
};

// Collects records in chunks. Without a medium it only counts.
class RecordWriter {
 public:
  RecordWriter(Medium* medium, std::uint32_t address, std::uint32_t room, std::uint32_t crc)
      : medium_(medium), address_(address), room_(room), crc_(crc) {}

  void begin(std::uint16_t index, std::uint8_t sub, std::uint16_t size) {
    put(bytes_of(index));
    put(bytes_of(sub));
    put(bytes_of(size));
  }

  void put(std::span<const std::byte> bytes) {
    if (bytes.size() > room_ - length_) failed_ = true;
    if (failed_) return;
    length_ += static_cast<std::uint32_t>(bytes.size());
    if (medium_ == nullptr) return;
    crc_ = crc32(bytes, crc_);
    while (!bytes.empty()) {
      const std::size_t part = std::min(bytes.size(), chunk_size - filled_);
      std::copy_n(bytes.begin(), part, chunk_.begin() + static_cast<std::ptrdiff_t>(filled_));
      filled_ += part;
      bytes = bytes.subspan(part);
      if (filled_ == chunk_size) drain();
    }
  }

  void fail() { failed_ = true; }

  // True when everything was accepted.
  bool finish() {
    if (filled_ > 0) drain();
    return !failed_;
  }

  std::uint32_t length() const { return length_; }
  std::uint32_t crc() const { return crc_; }

 private:
  void drain() {
    if (!medium_->write(address_, std::span(chunk_).first(filled_))) failed_ = true;
    address_ += static_cast<std::uint32_t>(filled_);
    filled_ = 0;
  }

  Medium* medium_;
  std::uint32_t address_;
  std::uint32_t room_;
  std::uint32_t crc_;
  std::uint32_t length_ = 0;
  Chunk chunk_{};
  std::size_t filled_ = 0;
  bool failed_ = false;
};

// ---- Identity of the values: the first records, of objects that are not saved themselves ----

constexpr std::uint16_t identity = 0x1018;
constexpr std::uint8_t product_code = 2;  // sub 1 is the vendor; revision and serial number may change

void put_identity(RecordWriter& writer, const Dictionary& dictionary) {
  for (std::uint8_t sub = 1; sub <= product_code; ++sub) {
    const Entry* entry = dictionary.find(identity, sub);
    ReadValue value;
    if (entry == nullptr || dictionary.read(*entry, value) != AbortCode::none) continue;
    writer.begin(identity, sub, static_cast<std::uint16_t>(value.bytes.size()));
    writer.put(value.bytes);
  }
}

// Returns true if a product of this type saved the values, or if the image has no identity. Empty: the medium does not
// respond.
std::optional<bool> is_own(Medium& medium, const Image& image, const Dictionary& dictionary) {
  RecordReader reader(medium, image);
  for (Record record; reader.next(record) && record.index == identity;) {
    const Entry* entry = dictionary.find(identity, record.sub);
    ReadValue own;
    std::array<std::byte, 8> number;
    if (entry == nullptr || dictionary.read(*entry, own) != AbortCode::none || own.bytes.size() != record.size ||
        record.size > number.size()) {
      return false;
    }
    const auto saved = std::span(number).first(record.size);
    if (!medium.read(record.address, saved)) return {};
    if (!std::equal(saved.begin(), saved.end(), own.bytes.begin())) return false;
  }
  if (reader.failed()) return {};
  return true;
}

void copy_record(RecordWriter& writer, Medium& medium, const Record& record) {
  writer.begin(record.index, record.sub, record.size);
  Chunk chunk;
  for (std::uint32_t done = 0; done < record.size;) {
    const auto part = std::span(chunk).first(std::min<std::size_t>(chunk_size, record.size - done));
    if (!medium.read(record.address + done, part)) return writer.fail();
    writer.put(part);
    done += static_cast<std::uint32_t>(part.size());
  }
}

// The present bytes of an entry with storage.
std::span<const std::byte> present_value(const Dictionary& dictionary, const Entry& entry) {
  if (Listener* owner = dictionary.listener(entry)) owner->refresh(entry);
  const std::byte* place = dictionary.storage(entry);
  if (entry.fixed_size()) return {place, size_of(entry.type)};
  std::uint32_t length = 0;
  std::memcpy(&length, place, sizeof length);
  return {place + sizeof length, std::min(length, entry.capacity)};
}

bool is_savable(const Entry& entry) { return entry.saved && entry.offset != Field::no_storage; }

void put_value(RecordWriter& writer, const Dictionary& dictionary, const Entry& entry) {
  const auto value = present_value(dictionary, entry);
  if (value.size() > Store::largest_value) return writer.fail();
  writer.begin(entry.index, entry.sub, static_cast<std::uint16_t>(value.size()));
  writer.put(value);
}

void put_area(RecordWriter& writer, const Dictionary& dictionary, Area area) {
  for (const Entry& entry : dictionary.table()) {
    if (is_savable(entry) && area_of(entry.index) == area) put_value(writer, dictionary, entry);
  }
}

// The content of a new image: for `areas` the present values or none, for the other areas the values of the `old`
// image, but for the objects with these `keys` their present values.
struct NewImage {
  const Dictionary& dictionary;
  Area areas;
  bool with_present_values;
  std::span<const std::uint32_t> keys;
  std::optional<Image> old;
};

// Copies an area of the old image, with the present values of the single objects at the places of their keys.
void copy_area(RecordWriter& writer, Medium& medium, const NewImage& image, Area area) {
  auto key = image.keys.begin();
  const auto put_keys_before = [&](std::uint32_t end) {
    for (; key != image.keys.end() && *key < end; ++key) {
      const auto index = static_cast<std::uint16_t>(*key >> 8);
      const Entry* entry = image.dictionary.find(index, static_cast<std::uint8_t>(*key));
      if (entry != nullptr && is_savable(*entry) && area_of(index) == area) put_value(writer, image.dictionary, *entry);
    }
  };
  if (image.old) {
    RecordReader reader(medium, *image.old);
    for (Record record; reader.next(record);) {
      if (area_of(record.index) != area || record.index == identity) continue;
      const std::uint32_t record_key = static_cast<std::uint32_t>(record.index) << 8 | record.sub;
      put_keys_before(record_key);
      if (std::find(image.keys.begin(), image.keys.end(), record_key) == image.keys.end()) {
        copy_record(writer, medium, record);
      }
    }
    if (reader.failed()) writer.fail();
  }
  put_keys_before(~std::uint32_t{0});
}

// All records of the new image, area by area.
void put_records(RecordWriter& writer, Medium& medium, const NewImage& image) {
  put_identity(writer, image.dictionary);
  for (const Area area : {Area::communication, Area::manufacturer, Area::profile, Area::motor}) {
    if (!contains(image.areas, area)) {
      copy_area(writer, medium, image, area);
    } else if (image.with_present_values) {
      put_area(writer, image.dictionary, area);
    }
  }
}

// Copies a saved value to its object, if it still fits.
bool load_record(Medium& medium, const Dictionary& dictionary, const Record& record) {
  const Entry* entry = dictionary.find(record.index, record.sub);
  if (entry == nullptr || !entry->saved || entry->offset == Field::no_storage) return true;
  std::byte* place = dictionary.storage(*entry);
  if (entry->fixed_size()) {
    if (record.size != size_of(entry->type)) return true;
    std::array<std::byte, 8> number;
    const auto value = std::span(number).first(record.size);
    if (!medium.read(record.address, value)) return false;
    if (dictionary.check_range(*entry, value) == AbortCode::none) std::copy(value.begin(), value.end(), place);
    return true;
  }
  if (record.size > entry->capacity) return true;
  const std::uint32_t length = record.size;
  std::memcpy(place, &length, sizeof length);
  return medium.read(record.address, {place + sizeof length, record.size});
}

}  // namespace

std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t crc) {
  crc = ~crc;
  for (const std::byte byte : bytes) {
    crc ^= static_cast<std::uint32_t>(byte);
    crc = crc >> 4 ^ crc_of_nibble[crc & 15];
    crc = crc >> 4 ^ crc_of_nibble[crc & 15];
  }
  return ~crc;
}

AbortCode Store::rewrite(const Dictionary& dictionary, Area areas, Content content,
                         std::span<const std::uint32_t> keys) {
  const Banks banks = inspect(medium_);
  if (!banks.readable) return AbortCode::hardware_error;
  NewImage image{dictionary, areas, content == Content::present, keys, {}};
  if (banks.newest) {
    const std::optional<bool> own = is_own(medium_, *banks.newest, dictionary);
    if (!own) return AbortCode::hardware_error;
    if (*own) image.old = banks.newest;  // values of another product are dropped
  } else if (content == Content::factory && is_erased(medium_)) {
    return AbortCode::none;  // nothing is saved, so there is nothing to delete
  }

  const std::uint32_t room = banks.capacity - static_cast<std::uint32_t>(sizeof(StoreHeader));
  RecordWriter counter(nullptr, 0, room, 0);
  put_records(counter, medium_, image);
  if (!counter.finish()) return AbortCode::hardware_error;

  const std::uint32_t bank = banks.newest && banks.newest->bank == 0 ? banks.capacity : 0;
  StoreHeader header{};
  header.mark = StoreHeader::begun_mark;
  if (!medium_.write(bank, bytes_of(header)) || !medium_.flush()) return AbortCode::hardware_error;

  header.version = StoreHeader::current_version;
  header.sequence = banks.newest ? banks.newest->header.sequence + 1 : 1;
  header.payload_length = counter.length();
  RecordWriter writer(&medium_, bank + static_cast<std::uint32_t>(sizeof header), room, crc_of_header(header));
  put_records(writer, medium_, image);
  if (!writer.finish() || writer.length() != header.payload_length || !medium_.flush()) {
    return AbortCode::hardware_error;
  }

  header.crc = writer.crc();
  header.mark = StoreHeader::valid_mark;
  if (!medium_.write(bank, bytes_of(header)) || !medium_.flush()) return AbortCode::hardware_error;
  return inspect(medium_, bank, banks.capacity).image ? AbortCode::none : AbortCode::hardware_error;
}

Store::Loaded Store::load(Dictionary& dictionary, Area areas) const {
  const Banks banks = inspect(medium_);
  if (!banks.newest) return banks.readable && is_without_save(medium_) ? Loaded::nothing : Loaded::damaged;
  if (!is_own(medium_, *banks.newest, dictionary).value_or(false)) return Loaded::damaged;
  RecordReader reader(medium_, *banks.newest);
  for (Record record; reader.next(record);) {
    if (contains(areas, area_of(record.index)) && !load_record(medium_, dictionary, record)) return Loaded::damaged;
  }
  return reader.failed() ? Loaded::damaged : Loaded::values;
}

}  // namespace servodrome::dictionary
