#pragma once

#include "dictionary/dictionary.hpp"
#include "dictionary/table.hpp"
#include "modbus/register_map.hpp"

// A device with objects of all kinds, for tests of the Modbus server and for its fuzz target.
namespace servodrome::modbus::test {

struct TestObjects {
  std::uint16_t plain = 0x1234;
  std::int8_t small = -3;
  std::int32_t position = 0;
  std::uint64_t wide = 0x1122334455667788;
  std::int16_t ranged = 0;
  std::uint16_t owned = 0;
  std::uint16_t secret = 0;
  std::uint16_t constant = 7;
  dictionary::Blob<6> name;
};

inline constexpr auto test_table = dictionary::make_table<[] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  TableBuilder<20> t;
  t.add(text_constant(0x1008, "", "abc"));
  t.add(var(0x2000, "", SERVODROME_FIELD(TestObjects, plain), Access::rw));
  t.add(var(0x2001, "", SERVODROME_FIELD(TestObjects, small), Access::rw));
  t.add(var(0x2002, "", SERVODROME_FIELD(TestObjects, position), Access::rw));
  t.add(var(0x2003, "", SERVODROME_FIELD(TestObjects, wide), Access::rw));
  t.add(
      var(0x2004, "", SERVODROME_FIELD(TestObjects, ranged), Access::rw, Pdo::none, {.minimum = -100, .maximum = 100}));
  t.add(var(0x2005, "", SERVODROME_FIELD(TestObjects, owned), Access::rw, Pdo::none, {.owner = Owner::drive}));
  t.add(var(0x2006, "", SERVODROME_FIELD(TestObjects, secret), Access::wo));
  t.add(var(0x2007, "", SERVODROME_FIELD(TestObjects, constant), Access::ro));
  t.add(var(0x2008, "", SERVODROME_FIELD(TestObjects, name), Access::rw));
  return t;
}>();

inline constexpr auto test_map = std::to_array<Register>({{0, 0x2000, 0, 1},
                                                          {1, 0x2001, 0, 1},
                                                          {2, 0x2002, 0, 2},
                                                          {4, 0x2003, 0, 4},
                                                          {8, 0x2004, 0, 1},
                                                          {9, 0x2005, 0, 1},
                                                          {10, 0x2006, 0, 1},
                                                          {11, 0x2007, 0, 1},
                                                          {12, 0x2008, 0, 3},
                                                          {15, 0x1008, 0, 2},
                                                          {0xFFFF, 0x2000, 0, 1}});
static_assert(is_valid_map(test_map, test_table));

struct TestDevice {
  TestObjects objects;
  dictionary::Dictionary dictionary{test_table, std::as_writable_bytes(std::span(&objects, 1))};
};

}  // namespace servodrome::modbus::test
