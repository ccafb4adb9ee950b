#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

// One row of an object dictionary, and the types that describe it.
namespace servodrome::dictionary {

// Data types by their number in CiA 301 table 44.
enum class Type : std::uint8_t {
  boolean = 0x01,
  integer8 = 0x02,
  integer16 = 0x03,
  integer32 = 0x04,
  unsigned8 = 0x05,
  unsigned16 = 0x06,
  unsigned32 = 0x07,
  real32 = 0x08,
  visible_string = 0x09,
  octet_string = 0x0A,
  domain = 0x0F,
  integer64 = 0x15,
  unsigned64 = 0x1B,
};

// Object codes (CiA 301 table 42).
enum class ObjectCode : std::uint8_t { domain = 0x02, var = 0x07, array = 0x08, record = 0x09 };

enum class Access : std::uint8_t { constant, ro, wo, rw };
enum class Pdo : std::uint8_t { none = 0, rpdo = 1, tpdo = 2, both = 3 };

// The part of the device that gets callbacks for reads and writes of the object (see Listener).
enum class Owner : std::uint8_t { none, communication, drive, product };
inline constexpr std::size_t owner_count = 4;

// The areas that are saved, restored and reset separately (CiA 301 1010h, 1011h, NMT reset), and the motor data 6410h
// of CiA 402-2, which some devices store separately from the rest of the profile.
enum class Area : std::uint8_t { none = 0, communication = 1, manufacturer = 2, profile = 4, motor = 8, all = 15 };
constexpr Area operator|(Area a, Area b) {
  return static_cast<Area>(static_cast<std::uint8_t>(a) | static_cast<std::uint8_t>(b));
}
constexpr bool contains(Area set, Area one) { return (static_cast<unsigned>(set) & static_cast<unsigned>(one)) != 0; }
constexpr Area area_of(std::uint16_t index) {
  if (index == 0x6410) return Area::motor;
  return index < 0x2000 ? Area::communication : index < 0x6000 ? Area::manufacturer : Area::profile;
}

constexpr bool is_signed(Type type) {
  return type == Type::integer8 || type == Type::integer16 || type == Type::integer32 || type == Type::integer64;
}

// Size of a value in bytes; 0 for types of variable length.
constexpr std::uint8_t size_of(Type type) {
  switch (type) {
    case Type::boolean:
    case Type::integer8:
    case Type::unsigned8: return 1;
    case Type::integer16:
    case Type::unsigned16: return 2;
    case Type::integer32:
    case Type::unsigned32:
    case Type::real32: return 4;
    case Type::integer64:
    case Type::unsigned64: return 8;
    default: return 0;
  }
}

constexpr std::int64_t minimum_of(Type type) {
  return is_signed(type) ? -(std::int64_t{1} << (size_of(type) * 8 - 2)) * 2 : 0;
}
constexpr std::int64_t maximum_of(Type type) {
  switch (type) {
    case Type::boolean: return 1;
    case Type::integer64:
    case Type::unsigned64: return std::numeric_limits<std::int64_t>::max();
    default: return is_signed(type) ? -(minimum_of(type) + 1) : (std::int64_t{1} << (size_of(type) * 8)) - 1;
  }
}

// A string or block of bytes within an objects struct.
template <std::size_t Capacity>
struct Blob {
  std::uint32_t length = 0;
  std::array<char, Capacity> bytes{};
};

// The place of a value: `offset` bytes from the beginning of the device's objects struct.
struct Field {
  static constexpr std::uint32_t no_storage = 0xFFFFFFFF;
  Type type;
  std::uint32_t offset = no_storage;
  std::uint32_t capacity = 0;  // of a Blob
};

struct Entry {
  static constexpr std::int64_t type_limit = std::numeric_limits<std::int64_t>::min();

  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  ObjectCode code = ObjectCode::var;
  Type type = Type::unsigned32;
  Access access = Access::rw;
  Pdo pdo = Pdo::none;
  Owner owner = Owner::none;
  bool saved = false;                 // part of the non-volatile image
  bool default_adds_node_id = false;  // the default is `default_value` + node id ($NODEID+ in an EDS)
  bool local = false;                 // for the device's service port only, invisible to the fieldbus
  bool has_range = false;             // `minimum` and `maximum` are narrower than the type's
  std::uint32_t offset = Field::no_storage;
  std::uint32_t capacity = 0;  // of a string or domain, in bytes
  std::int64_t default_value = 0;
  std::int64_t minimum = 0;
  std::int64_t maximum = 0;
  const char* name = "";
  const char* unit = "";
  const char* text = nullptr;  // value of a constant string

  constexpr std::uint32_t key() const { return static_cast<std::uint32_t>(index) << 8 | sub; }
  constexpr bool readable() const { return access != Access::wo; }
  constexpr bool writable() const { return access == Access::rw || access == Access::wo; }
  constexpr bool fixed_size() const { return size_of(type) != 0; }
};

// Members that most entries leave at their defaults, for designated initialisers in `var` and `element`.
struct Options {
  std::int64_t default_value = 0;
  std::int64_t minimum = Entry::type_limit;
  std::int64_t maximum = Entry::type_limit;
  const char* unit = "";
  bool saved = false;
  bool adds_node_id = false;
  bool local = false;
  Owner owner = Owner::none;
};

constexpr Entry make_entry(std::uint16_t index, std::uint8_t sub, ObjectCode code, const char* name, Field field,
                           Access access, Pdo pdo, const Options& options) {
  Entry entry;
  entry.index = index;
  entry.sub = sub;
  entry.code = code;
  entry.type = field.type;
  entry.access = access;
  entry.pdo = pdo;
  entry.owner = options.owner;
  entry.saved = options.saved;
  entry.default_adds_node_id = options.adds_node_id;
  entry.local = options.local;
  entry.offset = field.offset;
  entry.capacity = field.capacity;
  entry.default_value = options.default_value;
  entry.minimum = options.minimum == Entry::type_limit ? minimum_of(field.type) : options.minimum;
  entry.maximum = options.maximum == Entry::type_limit ? maximum_of(field.type) : options.maximum;
  entry.has_range = options.minimum != Entry::type_limit || options.maximum != Entry::type_limit;
  entry.name = name;
  entry.unit = options.unit;
  return entry;
}

// A simple object: sub-index 0 only.
constexpr Entry var(std::uint16_t index, const char* name, Field field, Access access, Pdo pdo = Pdo::none,
                    const Options& options = {}) {
  return make_entry(index, 0, ObjectCode::var, name, field, access, pdo, options);
}

// Sub-index 0 of an ARRAY or RECORD. It carries the name of the whole object; its value is the highest sub-index.
constexpr Entry highest_sub(std::uint16_t index, ObjectCode code, const char* object_name, std::uint8_t highest) {
  return make_entry(index, 0, code, object_name, {Type::unsigned8}, Access::constant, Pdo::none,
                    {.default_value = highest});
}

constexpr Entry element(std::uint16_t index, std::uint8_t sub, ObjectCode code, const char* name, Field field,
                        Access access, Pdo pdo = Pdo::none, const Options& options = {}) {
  return make_entry(index, sub, code, name, field, access, pdo, options);
}

// A constant VISIBLE_STRING.
constexpr Entry text_constant(std::uint16_t index, const char* name, const char* text) {
  Entry entry = make_entry(index, 0, ObjectCode::var, name, {Type::visible_string}, Access::constant, Pdo::none, {});
  entry.text = text;
  return entry;
}

// A constant number that needs no storage.
constexpr Entry number_constant(std::uint16_t index, std::uint8_t sub, ObjectCode code, const char* name, Type type,
                                std::int64_t value) {
  return make_entry(index, sub, code, name, {type}, Access::constant, Pdo::none, {.default_value = value});
}

template <Type Code, std::uint32_t Bytes = 0>
struct FieldTypeIs {
  static constexpr Type type = Code;
  static constexpr std::uint32_t capacity = Bytes;
};
template <typename T>
struct FieldType;
template <>
struct FieldType<bool> : FieldTypeIs<Type::boolean> {};
template <>
struct FieldType<std::int8_t> : FieldTypeIs<Type::integer8> {};
template <>
struct FieldType<std::int16_t> : FieldTypeIs<Type::integer16> {};
template <>
struct FieldType<std::int32_t> : FieldTypeIs<Type::integer32> {};
template <>
struct FieldType<std::int64_t> : FieldTypeIs<Type::integer64> {};
template <>
struct FieldType<std::uint8_t> : FieldTypeIs<Type::unsigned8> {};
template <>
struct FieldType<std::uint16_t> : FieldTypeIs<Type::unsigned16> {};
template <>
struct FieldType<std::uint32_t> : FieldTypeIs<Type::unsigned32> {};
template <>
struct FieldType<std::uint64_t> : FieldTypeIs<Type::unsigned64> {};
template <>
struct FieldType<float> : FieldTypeIs<Type::real32> {};
template <std::size_t N>
struct FieldType<Blob<N>> : FieldTypeIs<Type::visible_string, N> {};

template <typename T>
constexpr Field field_at(std::size_t offset) {
  return {FieldType<T>::type, static_cast<std::uint32_t>(offset), FieldType<T>::capacity};
}

}  // namespace servodrome::dictionary

// The place and type of a member of an objects struct, so that a table cannot disagree with the struct.
#define SERVODROME_FIELD(STRUCT, MEMBER)                                                             \
  ::servodrome::dictionary::field_at<std::remove_cvref_t<decltype(std::declval<STRUCT&>().MEMBER)>>( \
      offsetof(STRUCT, MEMBER))

// The same for element I of a member that is a std::array.
#define SERVODROME_ELEMENT(STRUCT, MEMBER, I)                                                       \
  ::servodrome::dictionary::field_at<typename decltype(std::declval<STRUCT>().MEMBER)::value_type>( \
      offsetof(STRUCT, MEMBER) + (I) * sizeof(typename decltype(std::declval<STRUCT>().MEMBER)::value_type))
