#include "dictionary/store.hpp"

#include <algorithm>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "dictionary/failing_medium.hpp"
#include "dictionary/table.hpp"

namespace servodrome::dictionary {
namespace store_test {
namespace {

struct Objects {
  std::uint32_t guard_time_ms;
  std::uint32_t pdo_identifier;
  std::int16_t gain;
  Blob<12> axis_name;
  Blob<200> curve;
  std::uint8_t not_saved;
  std::int8_t homing_method;
  std::int64_t position_counts;

  // The content of its objects; bytes between them do not count.
  auto values() const {
    return std::tuple(guard_time_ms, pdo_identifier, gain, axis_name.length, axis_name.bytes, curve.length, curve.bytes,
                      not_saved, homing_method, position_counts);
  }
};

constexpr auto table = make_table<[] {
  TableBuilder<16> builder;
  builder.add(var(0x100C, "Guard time", SERVODROME_FIELD(Objects, guard_time_ms), Access::rw, Pdo::none,
                  {.default_value = 100, .saved = true}));
  builder.add(var(0x1400, "COB-ID", SERVODROME_FIELD(Objects, pdo_identifier), Access::rw, Pdo::none,
                  {.default_value = 0x200, .saved = true, .adds_node_id = true}));
  builder.add(var(0x2000, "Gain", SERVODROME_FIELD(Objects, gain), Access::rw, Pdo::none,
                  {.default_value = 7, .minimum = -1000, .maximum = 1000, .saved = true}));
  builder.add(var(0x2001, "Axis name", SERVODROME_FIELD(Objects, axis_name), Access::rw, Pdo::none, {.saved = true}));
  builder.add(var(0x2002, "Curve", SERVODROME_FIELD(Objects, curve), Access::wo, Pdo::none, {.saved = true}));
  builder.add(var(0x2003, "Not saved", SERVODROME_FIELD(Objects, not_saved), Access::rw, Pdo::none));
  builder.add(number_constant(0x2004, 0, ObjectCode::var, "Constant", Type::unsigned8, 1));
  builder.add(var(0x6098, "Homing method", SERVODROME_FIELD(Objects, homing_method), Access::rw, Pdo::rpdo,
                  {.default_value = 35, .saved = true}));
  builder.add(
      var(0x6100, "Position", SERVODROME_FIELD(Objects, position_counts), Access::ro, Pdo::tpdo, {.saved = true}));
  return builder;
}>();
static_assert(is_valid_table(table));

constexpr std::uint8_t node_id = 5;

struct Device {
  explicit Device(int variant = 0) {
    reset();
    if (variant != 0) set_values(variant);
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  // Starts like a device: loads factory values, then the saved values.
  void reset() { dictionary.load_defaults(Area::all, node_id); }
  bool start(Medium& medium, Area areas = Area::all) {
    reset();
    return Store(medium).load(dictionary, areas) == Store::Loaded::values;
  }
  bool operator==(const Device& other) const { return objects.values() == other.objects.values(); }
  void set_text(std::uint16_t index, std::string_view text) {
    ASSERT_EQ(dictionary.write_any(*dictionary.find(index, 0), std::as_bytes(std::span(text))), AbortCode::none);
  }
  // Each saved object has a value that differs from its value in any other `variant`.
  void set_values(int variant) {
    objects.guard_time_ms = 0x01010101U * static_cast<unsigned>(variant);
    objects.pdo_identifier = 0x80000000U + static_cast<unsigned>(variant);
    objects.gain = static_cast<std::int16_t>(-variant);
    set_text(0x2001, std::string(static_cast<std::size_t>(variant), 'a'));
    set_text(0x2002, std::string(static_cast<std::size_t>(150 + 3 * variant), static_cast<char>('A' + variant)));
    objects.homing_method = static_cast<std::int8_t>(-variant);
    objects.position_counts = -(std::int64_t{1} << 40) * variant;
  }

  alignas(8) Objects objects{};
  Dictionary dictionary{table, std::as_writable_bytes(std::span(&objects, 1))};
};

Device device_with(int variant) { return Device(variant); }

constexpr std::uint32_t ample = 1024;

TEST(Store, SavedValuesComeBackAndOthersDoNot) {
  FailingMedium medium(ample);
  Device device;
  device.set_values(3);
  device.objects.not_saved = 9;
  ASSERT_EQ(Store(medium).save(device.dictionary, Area::all), AbortCode::none);
  EXPECT_EQ(medium.flushes, 3U);

  Device restarted;
  ASSERT_TRUE(restarted.start(medium));
  EXPECT_EQ(restarted.objects.not_saved, 0);
  restarted.objects.not_saved = 9;
  EXPECT_EQ(restarted, device);
}

// The store reads back each byte that it writes. A worn-out cell is an error, and the previous values stay.
TEST(Store, AWornOutCellIsAnError) {
  FailingMedium medium(ample);
  const Device before = device_with(3);
  ASSERT_EQ(Store(medium).save(before.dictionary, Area::all), AbortCode::none);
  FailingMedium good = medium;
  const Device after = device_with(2);
  ASSERT_EQ(Store(good).save(after.dictionary, Area::all), AbortCode::none);
  unsigned cells = 0;
  for (std::uint32_t at = ample / 2; at < ample; ++at) {  // the other bank
    if (good.memory[at] == medium.memory[at]) continue;
    FailingMedium worn = medium;
    worn.stuck_at = at;
    EXPECT_EQ(Store(worn).save(after.dictionary, Area::all), AbortCode::hardware_error) << at;
    Device restarted;
    ASSERT_TRUE(restarted.start(worn)) << at;
    EXPECT_EQ(restarted, before) << at;
    ++cells;
  }
  EXPECT_GT(cells, 100U);
}

// Byte-exact limits: the last chunk of 64 bytes may be full, empty or have one byte.
TEST(Store, ImagesOfEveryLength) {
  struct One {
    Blob<200> text;
  };
  static constexpr std::array entries{
      var(0x2000, "Text", SERVODROME_FIELD(One, text), Access::rw, Pdo::none, {.saved = true})};
  for (std::uint32_t length = 0; length <= 200; ++length) {
    One saved{}, loaded{};
    saved.text.length = length;
    for (std::uint32_t i = 0; i < length; ++i) saved.text.bytes[i] = static_cast<char>('a' + i % 26);
    FailingMedium medium(ample);
    const Dictionary from(entries, std::as_writable_bytes(std::span(&saved, 1)));
    ASSERT_EQ(Store(medium).save(from, Area::all), AbortCode::none) << length;
    Dictionary into(entries, std::as_writable_bytes(std::span(&loaded, 1)));
    EXPECT_EQ(Store(medium).load(into, Area::all), Store::Loaded::values) << length;
    EXPECT_EQ(loaded.text.length, length);
    EXPECT_EQ(loaded.text.bytes, saved.text.bytes) << length;
  }
}

TEST(Store, EmptyOrErasedMediumHoldsNothing) {
  for (const std::byte fill : {std::byte{0x00}, std::byte{0xFF}}) {
    FailingMedium medium(ample, fill);
    Device device;
    EXPECT_EQ(Store(medium).load(device.dictionary, Area::all), Store::Loaded::nothing);
    EXPECT_EQ(device, Device());
    EXPECT_EQ(Store(medium).restore_defaults(device.dictionary, Area::all), AbortCode::none);
    EXPECT_EQ(medium.written, 0U);
  }
}

// A medium with contents but without an image counts as damaged (an old image or foreign data), never as empty.
TEST(Store, OtherBytesAreDamageUntilTheyAreForgotten) {
  for (const std::byte fill : {std::byte{0x53}, std::byte{0x01}, std::byte{0xFE}}) {
    FailingMedium medium(ample, fill);
    Device device;
    EXPECT_EQ(Store(medium).load(device.dictionary, Area::all), Store::Loaded::damaged);
    EXPECT_EQ(Store(medium).restore_defaults(device.dictionary, Area::communication), AbortCode::none);
    EXPECT_EQ(Store(medium).load(device.dictionary, Area::all), Store::Loaded::values);
    EXPECT_EQ(device, Device());
  }
  for (const std::size_t at : {std::size_t{0}, std::size_t{63}, std::size_t{64}, std::size_t{ample - 1}}) {
    FailingMedium medium(ample);
    medium.memory[at] = std::byte{0xFF};
    Device device;
    EXPECT_EQ(Store(medium).load(device.dictionary, Area::all), Store::Loaded::damaged) << at;
  }
}

TEST(Store, AMediumThatDoesNotAnswerIsNotEmpty) {
  for (std::uint64_t reads = 0; reads < 2 + ample / 64; ++reads) {
    FailingMedium medium(ample);
    medium.reads_until_failure = reads;
    Device device;
    EXPECT_EQ(Store(medium).load(device.dictionary, Area::all), Store::Loaded::damaged) << reads;
  }
}

// A product with an identity: 1018h sub 1 and 2.
struct Product {
  struct Objects {
    std::uint32_t vendor;
    std::uint32_t product;
    std::uint32_t revision;
    std::int32_t position;
  };
  static constexpr std::array table{
      element(0x1018, 1, ObjectCode::record, "Vendor", SERVODROME_FIELD(Objects, vendor), Access::ro),
      element(0x1018, 2, ObjectCode::record, "Product", SERVODROME_FIELD(Objects, product), Access::ro),
      element(0x1018, 3, ObjectCode::record, "Revision", SERVODROME_FIELD(Objects, revision), Access::ro),
      var(0x2000, "Position", SERVODROME_FIELD(Objects, position), Access::rw, Pdo::none, {.saved = true}),
      var(0x6000, "Missing in the other", SERVODROME_FIELD(Objects, revision), Access::rw, Pdo::none, {.saved = true})};

  Product(std::uint32_t vendor, std::uint32_t product, std::uint32_t revision, std::size_t entries = table.size())
      : objects{vendor, product, revision, 0}, dictionary(std::span(table).first(entries), bytes()) {}
  Product(const Product&) = delete;
  Product& operator=(const Product&) = delete;
  std::span<std::byte> bytes() { return std::as_writable_bytes(std::span(&objects, 1)); }
  Store::Loaded load(Medium& medium) { return Store(medium).load(dictionary, Area::all); }

  Objects objects;
  Dictionary dictionary;
};

TEST(Store, AnotherProductsValuesAreNotTaken) {
  FailingMedium medium(ample);
  Product mine(1, 2, 3);
  mine.objects.position = 4711;
  ASSERT_EQ(Store(medium).save(mine.dictionary, Area::all), AbortCode::none);
  EXPECT_EQ(Product(1, 2, 3).load(medium), Store::Loaded::values);
  EXPECT_EQ(Product(1, 2, 4).load(medium), Store::Loaded::values) << "a new revision takes what fits";
  for (const auto& [vendor, product] : {std::pair{1U, 3U}, {5U, 2U}, {2U, 1U}}) {
    Product other(vendor, product, 3);
    EXPECT_EQ(other.load(medium), Store::Loaded::damaged);
    EXPECT_EQ(other.objects.position, 0);
  }
  FailingMedium once = medium;
  once.reads_until_failure = 5;  // two headers, the records, the first number of the identity
  EXPECT_EQ(Store(once).save(mine.dictionary, Area::manufacturer), AbortCode::hardware_error);
}

TEST(Store, WhatAnotherProductSavedIsNotMixedIn) {
  FailingMedium medium(ample);
  Product mine(1, 2, 3);
  Product other(1, 7, 3);
  other.objects.position = 4711;
  ASSERT_EQ(Store(medium).save(other.dictionary, Area::all), AbortCode::none);
  mine.objects.position = 12;
  ASSERT_EQ(Store(medium).save(mine.dictionary, Area::profile), AbortCode::none);
  Product restarted(1, 2, 3);
  EXPECT_EQ(restarted.load(medium), Store::Loaded::values);
  EXPECT_EQ(restarted.objects.position, 0) << "the manufacturer's area was the other's";
  // A store accepts its own image, with its identity, when only a part is saved or erased.
  ASSERT_EQ(Store(medium).save(mine.dictionary, Area::manufacturer), AbortCode::none);
  ASSERT_EQ(Store(medium).restore_defaults(mine.dictionary, Area::profile), AbortCode::none);
  EXPECT_EQ(restarted.load(medium), Store::Loaded::values);
  EXPECT_EQ(restarted.objects.position, 12);
  EXPECT_EQ(Product(1, 7, 3).load(medium), Store::Loaded::damaged);
}

// An image of a table without identity (all images of old versions) is accepted.
TEST(Store, AnImageWithoutIdentityIsTaken) {
  struct Plain {
    std::int32_t position;
  };
  constexpr std::array entries{
      var(0x2000, "Position", SERVODROME_FIELD(Plain, position), Access::rw, Pdo::none, {.saved = true})};
  Plain plain{99};
  const Dictionary old(entries, std::as_writable_bytes(std::span(&plain, 1)));
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(old, Area::all), AbortCode::none);
  Product mine(1, 2, 3);
  EXPECT_EQ(mine.load(medium), Store::Loaded::values);
  EXPECT_EQ(mine.objects.position, 99);
  ASSERT_EQ(Store(medium).save(mine.dictionary, Area::all), AbortCode::none);
  Dictionary reader(entries, std::as_writable_bytes(std::span(&plain, 1)));
  EXPECT_EQ(Store(medium).load(reader, Area::all), Store::Loaded::damaged);
}

// The format, byte by byte: a new version must read the images of earlier versions.
TEST(Store, FormatIsAsDocumented) {
  struct Two {
    std::uint16_t first;
    Blob<4> second;
  };
  Two objects{0x1234, {3, {'x', 'y', 'z'}}};
  constexpr std::array entries{
      element(0x2000, 1, ObjectCode::record, "First", SERVODROME_FIELD(Two, first), Access::rw, Pdo::none,
              {.saved = true}),
      var(0x6000, "Second", SERVODROME_FIELD(Two, second), Access::rw, Pdo::none, {.saved = true})};
  const Dictionary dictionary(entries, std::as_writable_bytes(std::span(&objects, 1)));
  FailingMedium medium(200);
  ASSERT_EQ(Store(medium).save(dictionary, Area::all), AbortCode::none);

  const std::vector<unsigned> checked{1, 0, 0, 0, 1, 0, 0, 0, 15, 0, 0, 0};
  const std::vector<unsigned> records{0x00, 0x20, 1, 2, 0, 0x34, 0x12, 0x00, 0x60, 0, 3, 0, 'x', 'y', 'z'};
  std::uint32_t crc = 0;
  for (const auto* part : {&checked, &records}) {
    for (const unsigned value : *part) {
      const auto byte = static_cast<std::byte>(value);
      crc = crc32({&byte, 1}, crc);
    }
  }
  std::vector<unsigned> expected = checked;
  for (unsigned i = 0; i < 4; ++i) expected.push_back(crc >> (8 * i) & 0xFF);
  for (const char letter : std::string("STOR")) expected.push_back(static_cast<unsigned>(letter));
  expected.insert(expected.end(), records.begin(), records.end());
  std::vector<unsigned> actual;
  for (std::size_t i = 0; i < expected.size(); ++i) actual.push_back(static_cast<unsigned>(medium.memory[i]));
  EXPECT_EQ(actual, expected);
  EXPECT_THAT(std::vector(medium.memory.begin() + static_cast<std::ptrdiff_t>(expected.size()), medium.memory.end()),
              testing::Each(std::byte{0}));
}

TEST(Store, Crc32CheckValue) {
  EXPECT_EQ(crc32(std::as_bytes(std::span("123456789", 9))), 0xCBF43926U);  // the check value of IEEE 802.3
  EXPECT_EQ(crc32({}), 0U);
}

TEST(Store, SavingOneAreaKeepsTheOthers) {
  FailingMedium medium(ample);
  Store store(medium);
  ASSERT_EQ(store.save(device_with(1).dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(store.save(device_with(2).dictionary, Area::manufacturer), AbortCode::none);
  ASSERT_EQ(store.save(device_with(4).dictionary, Area::profile), AbortCode::none);

  Device device;
  ASSERT_TRUE(device.start(medium));
  EXPECT_EQ(device.objects.guard_time_ms, 0x01010101U);
  EXPECT_EQ(device.objects.pdo_identifier, 0x80000001U);
  EXPECT_EQ(device.objects.gain, -2);
  EXPECT_EQ(device.objects.curve.length, 156U);
  EXPECT_EQ(device.objects.homing_method, -4);

  ASSERT_EQ(store.save(device_with(5).dictionary, Area::communication | Area::profile), AbortCode::none);
  ASSERT_TRUE(device.start(medium));
  EXPECT_EQ(device.objects.guard_time_ms, 0x05050505U);
  EXPECT_EQ(device.objects.gain, -2);
  EXPECT_EQ(device.objects.homing_method, -5);
}

TEST(Store, FirstSaveOfOneAreaLeavesFactoryValuesElsewhere) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(3).dictionary, Area::profile), AbortCode::none);
  Device device;
  ASSERT_TRUE(device.start(medium));
  EXPECT_EQ(device.objects.gain, 7);
  EXPECT_EQ(device.objects.pdo_identifier, 0x205U);
  EXPECT_EQ(device.objects.homing_method, -3);
}

TEST(Store, LoadingOneAreaLeavesTheOthersAlone) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(3).dictionary, Area::all), AbortCode::none);
  Device device;
  ASSERT_TRUE(device.start(medium, Area::communication));  // NMT reset communication
  EXPECT_EQ(device.objects.guard_time_ms, 0x03030303U);
  EXPECT_EQ(device.objects.gain, 7);
  EXPECT_EQ(device.objects.homing_method, 35);
}

TEST(Store, RestoredAreasHaveFactoryValuesAfterTheNextStartOnly) {
  FailingMedium medium(ample);
  Store store(medium);
  Device device = device_with(3);
  ASSERT_EQ(store.save(device.dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(store.restore_defaults(device.dictionary, Area::manufacturer), AbortCode::none);
  EXPECT_EQ(device, device_with(3));  // the values in use do not change

  ASSERT_TRUE(device.start(medium));
  EXPECT_EQ(device.objects.gain, 7);
  EXPECT_EQ(device.objects.axis_name.length, 0U);
  EXPECT_EQ(device.objects.guard_time_ms, 0x03030303U);
  EXPECT_EQ(device.objects.homing_method, -3);

  ASSERT_EQ(store.restore_defaults(device.dictionary, Area::all), AbortCode::none);
  ASSERT_TRUE(device.start(medium));
  EXPECT_EQ(device.objects.guard_time_ms, 100U);
  EXPECT_EQ(device.objects.homing_method, 35);
}

// Repeats `change` with a loss of power at every byte that it writes, and the byte at that place either unchanged or
// garbled in each way of `garbles`. Afterwards a load must give exactly `before` or `after`, and a further save must
// work.
template <typename Change>
void expect_all_or_nothing(const FailingMedium& start, const Device& before, const Device& after,
                           std::span<const unsigned> garbles, Change change) {
  FailingMedium whole = start;
  whole.written = 0;
  ASSERT_EQ(change(whole), AbortCode::none);
  ASSERT_GT(whole.written, 100U);
  unsigned old_images = 0;
  for (std::uint64_t cut = 0; cut < whole.written; ++cut) {
    for (const unsigned garble : garbles) {
      FailingMedium medium = start;
      medium.written = 0;
      medium.power_ends_after = cut;
      medium.torn_byte_xor = garble;
      EXPECT_EQ(change(medium), AbortCode::hardware_error);
      ASSERT_TRUE(medium.dead);

      medium.power_ends_after = FailingMedium::never;
      medium.dead = false;
      Device device;
      ASSERT_TRUE(device.start(medium)) << "cut at " << cut << " garble " << garble;
      // The last byte of the mark may become its final value when the write is cut.
      const bool is_old = device == before;
      ASSERT_TRUE(is_old || (cut + 1 == whole.written && device == after)) << "cut at " << cut << " garble " << garble;
      old_images += is_old ? 1 : 0;

      ASSERT_EQ(Store(medium).save(device_with(6).dictionary, Area::all), AbortCode::none);
      ASSERT_TRUE(device.start(medium));
      ASSERT_EQ(device, device_with(6));
    }
  }
  EXPECT_GE(old_images, whole.written * garbles.size() - garbles.size());
  Device device;
  ASSERT_TRUE(device.start(whole));
  EXPECT_EQ(device, after);
}

constexpr std::array<unsigned, 10> some_garbles{0, 0x01, 0x80, 0x0F, 0xF0, 0x55, 0xAA, 0xFF, 0x53, 0x3C};

TEST(Store, CutAtEveryByteOfASaveLeavesOldOrNew) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::none);
  // The second save goes to the unused bank, the third overwrites an older image.
  expect_all_or_nothing(medium, device_with(1), device_with(2), some_garbles,
                        [](Medium& m) { return Store(m).save(device_with(2).dictionary, Area::all); });
  ASSERT_EQ(Store(medium).save(device_with(2).dictionary, Area::all), AbortCode::none);
  expect_all_or_nothing(medium, device_with(2), device_with(3), some_garbles,
                        [](Medium& m) { return Store(m).save(device_with(3).dictionary, Area::all); });
}

TEST(Store, CutWithEveryGarbleOfTheTornByte) {
  std::array<unsigned, 256> all{};
  for (unsigned i = 0; i < 256; ++i) all[i] = i;
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(Store(medium).save(device_with(2).dictionary, Area::all), AbortCode::none);
  expect_all_or_nothing(medium, device_with(2), device_with(3), all,
                        [](Medium& m) { return Store(m).save(device_with(3).dictionary, Area::all); });
}

TEST(Store, CutAtEveryByteOfAnAreaSaveAndOfARestore) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(Store(medium).save(device_with(2).dictionary, Area::all), AbortCode::none);
  Device merged = device_with(2);
  merged.objects.guard_time_ms = 0x04040404;
  merged.objects.pdo_identifier = 0x80000004;
  expect_all_or_nothing(medium, device_with(2), merged, some_garbles,
                        [](Medium& m) { return Store(m).save(device_with(4).dictionary, Area::communication); });
  Device restored = device_with(2);
  restored.objects.homing_method = 35;
  restored.objects.position_counts = 0;
  expect_all_or_nothing(medium, device_with(2), restored, some_garbles,
                        [](Medium& m) { return Store(m).restore_defaults(Device().dictionary, Area::profile); });
}

// Single objects: their values at their places, all other records stay, and values of trials are not saved.
TEST(Store, SavingObjectsKeepsAllOthers) {
  FailingMedium medium(ample);
  Store store(medium);
  ASSERT_EQ(store.save(device_with(2).dictionary, Area::all), AbortCode::none);
  constexpr std::array<std::uint32_t, 3> keys{0x140000, 0x200100, 0x200300};  // the last one is not saved
  ASSERT_EQ(store.save_objects(device_with(4).dictionary, keys), AbortCode::none);
  Device merged = device_with(2);
  merged.objects.pdo_identifier = 0x80000004;
  merged.set_text(0x2001, "aaaa");
  Device device;
  ASSERT_TRUE(device.start(medium));
  EXPECT_EQ(device, merged);

  // The image is that of a whole save of these values, record by record.
  FailingMedium whole(ample);
  ASSERT_EQ(Store(whole).save(device_with(2).dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(Store(whole).save(merged.dictionary, Area::all), AbortCode::none);
  EXPECT_EQ(medium.memory, whole.memory);
}

TEST(Store, SavingObjectsDoesNotBringRestoredValuesBack) {
  FailingMedium medium(ample);
  Store store(medium);
  ASSERT_EQ(store.save(device_with(3).dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(store.restore_defaults(device_with(3).dictionary, Area::all), AbortCode::none);
  constexpr std::array<std::uint32_t, 1> keys{0x609800};
  ASSERT_EQ(store.save_objects(device_with(3).dictionary, keys), AbortCode::none);
  Device expected;
  expected.objects.homing_method = -3;
  Device device;
  ASSERT_TRUE(device.start(medium));
  EXPECT_EQ(device, expected);
  FailingMedium fresh(ample);
  ASSERT_EQ(Store(fresh).save_objects(device_with(3).dictionary, keys), AbortCode::none);
  ASSERT_TRUE(device.start(fresh));
  EXPECT_EQ(device, expected);
}

TEST(Store, CutAtEveryByteOfSavingObjects) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::none);
  Device merged = device_with(1);
  merged.objects.gain = -2;
  constexpr std::array<std::uint32_t, 1> keys{0x200000};
  expect_all_or_nothing(medium, device_with(1), merged, some_garbles,
                        [&keys](Medium& m) { return Store(m).save_objects(device_with(2).dictionary, keys); });
}

TEST(Store, CutOfTheVeryFirstSaveLeavesFactoryValues) {
  FailingMedium whole(ample);
  ASSERT_EQ(Store(whole).save(device_with(1).dictionary, Area::all), AbortCode::none);
  for (std::uint64_t cut = 0; cut + 1 < whole.written; ++cut) {
    FailingMedium medium(ample);
    medium.power_ends_after = cut;
    EXPECT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::hardware_error);
    Device device;
    ASSERT_FALSE(device.start(medium));
    ASSERT_EQ(device, Device());
    // Only a torn mark looks like damage.
    constexpr std::uint64_t mark = sizeof(StoreHeader::mark);
    const bool is_torn = (cut > sizeof(StoreHeader) - mark && cut < sizeof(StoreHeader)) || cut + mark > whole.written;
    if (is_torn) continue;
    FailingMedium again(ample);
    again.memory = medium.memory;
    ASSERT_EQ(Store(again).load(device.dictionary, Area::all), Store::Loaded::nothing) << cut;
    ASSERT_EQ(Store(again).save(device_with(1).dictionary, Area::all), AbortCode::none);
    ASSERT_EQ(Store(again).load(device.dictionary, Area::all), Store::Loaded::values);
  }
}

// A medium with a cache, like a file: any subset of the bytes since the last flush survives. The test fails if `save`
// omits a flush.
TEST(Store, CutBetweenFlushesWithAnySubsetOfCachedBytes) {
  std::mt19937 random(4711);
  FailingMedium start(ample);
  ASSERT_EQ(Store(start).save(device_with(1).dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(Store(start).save(device_with(2).dictionary, Area::all), AbortCode::none);
  start.caching = true;
  start.written = 0;
  FailingMedium whole = start;
  ASSERT_EQ(Store(whole).save(device_with(3).dictionary, Area::all), AbortCode::none);
  for (std::uint64_t cut = 0; cut < whole.written; ++cut) {
    for (int round = 0; round < 8; ++round) {
      FailingMedium medium = start;
      medium.power_ends_after = cut;
      EXPECT_EQ(Store(medium).save(device_with(3).dictionary, Area::all), AbortCode::hardware_error);
      medium.lose_cache(random);
      Device device;
      ASSERT_TRUE(device.start(medium)) << cut;
      ASSERT_EQ(device, device_with(2)) << cut;
    }
  }
}

TEST(Store, EveryFlippedBitOfOneBankLeavesTheOther) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::none);
  const auto length_of_image = static_cast<std::size_t>(medium.written) - sizeof(StoreHeader);
  ASSERT_EQ(Store(medium).save(device_with(2).dictionary, Area::all), AbortCode::none);
  const std::size_t bank = ample / 2;  // the bank of the second save
  const std::size_t length_of_second =
      static_cast<std::size_t>(medium.written) - length_of_image - 2 * sizeof(StoreHeader);
  for (std::size_t i = 0; i < medium.memory.size(); ++i) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      FailingMedium rotten = medium;
      rotten.memory[i] ^= static_cast<std::byte>(1U << bit);
      const bool hits_newest = i >= bank && i < bank + length_of_second;
      Device device;
      ASSERT_TRUE(device.start(rotten));
      ASSERT_EQ(device, device_with(hits_newest ? 1 : 2)) << "byte " << i << " bit " << bit;
    }
  }
}

TEST(Store, RotInBothBanksLeavesFactoryValuesAndAWorkingMedium) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(Store(medium).save(device_with(2).dictionary, Area::all), AbortCode::none);
  medium.memory[sizeof(StoreHeader) + 6] ^= std::byte{1};
  medium.memory[ample / 2 + sizeof(StoreHeader) + 6] ^= std::byte{1};
  Device device;
  EXPECT_FALSE(device.start(medium));
  EXPECT_EQ(device, Device());
  ASSERT_EQ(Store(medium).save(device_with(3).dictionary, Area::all), AbortCode::none);
  ASSERT_TRUE(device.start(medium));
  EXPECT_EQ(device, device_with(3));
}

TEST(Store, SequenceNumberWraps) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::none);
  // Simulates the state after 4294967295 saves: the newest image has the greatest number.
  StoreHeader header;
  std::memcpy(&header, medium.memory.data(), sizeof header);
  header.sequence = 0xFFFFFFFF;
  header.crc = crc32(std::as_bytes(std::span(&header, 1)).first(offsetof(StoreHeader, crc)));
  header.crc = crc32(std::span(medium.memory).subspan(sizeof header, header.payload_length), header.crc);
  std::memcpy(medium.memory.data(), &header, sizeof header);
  Device device;
  ASSERT_TRUE(device.start(medium));
  ASSERT_EQ(device, device_with(1));
  for (int variant = 2; variant < 6; ++variant) {
    ASSERT_EQ(Store(medium).save(device_with(variant).dictionary, Area::all), AbortCode::none);
    ASSERT_TRUE(device.start(medium));
    ASSERT_EQ(device, device_with(variant));
  }
}

TEST(Store, MediumTooSmallIsRefusedAndOldValuesStay) {
  const auto needed = [](int variant) {
    FailingMedium medium(ample);
    EXPECT_EQ(Store(medium).save(device_with(variant).dictionary, Area::all), AbortCode::none);
    return static_cast<std::uint32_t>(medium.written - sizeof(StoreHeader)) * 2;  // the header is written twice
  };
  FailingMedium exact(needed(1));
  ASSERT_EQ(Store(exact).save(device_with(1).dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(Store(exact).save(device_with(1).dictionary, Area::all), AbortCode::none);
  ASSERT_GT(needed(2), needed(1));
  const auto image = exact.memory;
  EXPECT_EQ(Store(exact).save(device_with(2).dictionary, Area::all), AbortCode::hardware_error);
  EXPECT_EQ(exact.memory, image);
  Device device;
  ASSERT_TRUE(device.start(exact));
  EXPECT_EQ(device, device_with(1));

  for (std::uint32_t size = 0; size < needed(1); ++size) {
    FailingMedium small(size);
    EXPECT_EQ(Store(small).save(device_with(1).dictionary, Area::all), AbortCode::hardware_error) << size;
    EXPECT_EQ(small.written, 0U);
    EXPECT_FALSE(small.overran);
    EXPECT_FALSE(device.start(small));
  }
}

TEST(Store, AMediumThatDoesNotAnswerLosesNothing) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::none);
  ASSERT_EQ(Store(medium).save(device_with(2).dictionary, Area::all), AbortCode::none);
  unsigned refused = 0;
  for (std::uint64_t reads = 0;; ++reads) {
    FailingMedium failing = medium;
    failing.reads_until_failure = reads;
    const AbortCode abort = Store(failing).save(device_with(3).dictionary, Area::communication);
    failing.reads_until_failure = FailingMedium::never;
    Device device;
    ASSERT_TRUE(device.start(failing));
    if (abort == AbortCode::none) {
      EXPECT_EQ(device.objects.guard_time_ms, 0x03030303U);
      break;
    }
    ASSERT_EQ(abort, AbortCode::hardware_error);
    Device merged = device_with(2);
    merged.objects.guard_time_ms = 0x03030303;
    merged.objects.pdo_identifier = 0x80000003;
    ASSERT_TRUE(device == device_with(2) || device == merged) << reads;
    ++refused;
  }
  EXPECT_GT(refused, 20U);

  // A bank that once does not answer may hold the newest values, so it must not be overwritten.
  ASSERT_EQ(Store(medium).save(device_with(4).dictionary, Area::all), AbortCode::none);  // back in the first bank
  FailingMedium once = medium;
  once.fails_once = true;
  once.reads_until_failure = 0;
  EXPECT_EQ(Store(once).save(device_with(3).dictionary, Area::profile), AbortCode::hardware_error);
  Device kept;
  ASSERT_TRUE(kept.start(once));
  EXPECT_EQ(kept, device_with(4));

  FailingMedium failing = medium;
  failing.flush_fails = true;
  EXPECT_EQ(Store(failing).save(device_with(3).dictionary, Area::all), AbortCode::hardware_error);
}

TEST(Store, LoadSaysWhenTheMediumStopsAnsweringHalfway) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(1).dictionary, Area::all), AbortCode::none);
  Device device;
  std::uint64_t reads = 0;
  for (;; ++reads) {
    medium.reads_until_failure = reads;
    if (device.start(medium)) break;
  }
  EXPECT_EQ(device, device_with(1));
  EXPECT_GT(reads, 10U);
}

// A table of another firmware: values that no longer fit are skipped, the others are loaded.
TEST(Store, UnknownResizedAndOutOfRangeRecordsAreSkipped) {
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(device_with(9).dictionary, Area::all), AbortCode::none);

  std::vector<Entry> newer(table.begin(), table.end());
  const auto at = [&newer](std::uint16_t index) -> Entry& {
    return *std::find_if(newer.begin(), newer.end(), [index](const Entry& e) { return e.index == index; });
  };
  at(0x100C).type = Type::unsigned16;  // resized
  at(0x1400).saved = false;            // no longer saved
  at(0x2000).minimum = -8;             // -9 is out of range now
  at(0x2001).capacity = 8;             // nine letters do not fit
  at(0x2002).index = 0x2009;           // removed
  at(0x6098).access = Access::ro;      // access rules do not apply to saved values
  std::sort(newer.begin(), newer.end(), [](const Entry& a, const Entry& b) { return a.key() < b.key(); });

  Device device;
  Dictionary dictionary(newer, std::as_writable_bytes(std::span(&device.objects, 1)));
  ASSERT_EQ(Store(medium).load(dictionary, Area::all), Store::Loaded::values);
  EXPECT_EQ(device.objects.guard_time_ms, 100U);
  EXPECT_EQ(device.objects.pdo_identifier, 0x205U);
  EXPECT_EQ(device.objects.gain, 7);
  EXPECT_EQ(device.objects.axis_name.length, 0U);
  EXPECT_EQ(device.objects.curve.length, 0U);
  EXPECT_EQ(device.objects.homing_method, -9);
  EXPECT_EQ(device.objects.position_counts, -9 * (std::int64_t{1} << 40));
}

TEST(Store, OwnersAreAskedToRefreshBeforeASaveAndNotToldOfALoad) {
  struct Counter final : Listener {
    explicit Counter(Objects& o) : objects(o) {}
    AbortCode check(const Entry&, std::span<const std::byte>) override { return ++calls, AbortCode::general_error; }
    void written(const Entry&) override { ++calls; }
    void refresh(const Entry&) override { objects.gain = 42; }
    Objects& objects;
    int calls = 0;
  };
  std::vector<Entry> owned(table.begin(), table.end());
  for (Entry& entry : owned) entry.owner = Owner::drive;
  Device device;
  Counter counter(device.objects);
  Dictionary dictionary(owned, std::as_writable_bytes(std::span(&device.objects, 1)));
  dictionary.set_listener(Owner::drive, &counter);
  FailingMedium medium(ample);
  ASSERT_EQ(Store(medium).save(dictionary, Area::all), AbortCode::none);
  device.objects.gain = 0;
  ASSERT_EQ(Store(medium).load(dictionary, Area::all), Store::Loaded::values);
  EXPECT_EQ(device.objects.gain, 42);
  EXPECT_EQ(counter.calls, 0);
}

TEST(Store, AValueLongerThanARecordCanSayIsRefused) {
  std::vector<std::byte> objects(4 + 70000);
  const std::array entries{var(0x2000, "Long", {Type::domain, 0, 70000}, Access::rw, Pdo::none, {.saved = true})};
  Dictionary dictionary(entries, objects);
  RamMedium medium(objects);  // the medium is never written
  FailingMedium large(300000);
  const std::vector<std::byte> longest(0xFFFF, std::byte{0x5A});
  ASSERT_EQ(dictionary.write(entries[0], longest), AbortCode::none);
  EXPECT_EQ(Store(large).save(dictionary, Area::all), AbortCode::none);
  std::vector<std::byte> other_objects(objects.size());
  Dictionary other(entries, other_objects);
  ASSERT_EQ(Store(large).load(other, Area::all), Store::Loaded::values);
  EXPECT_EQ(other_objects, objects);
  ASSERT_EQ(dictionary.write(entries[0], std::vector<std::byte>(0x10000)), AbortCode::none);
  EXPECT_EQ(Store(large).save(dictionary, Area::all), AbortCode::hardware_error);
}

// Invalid headers must not make the reader leave the bank, even with a valid CRC.
TEST(Store, LyingRecordsStayInTheirBank) {
  FailingMedium medium(256);
  StoreHeader header{StoreHeader::current_version, 1, 12, 0, StoreHeader::valid_mark};
  const std::array<std::uint8_t, 12> records{0x0C, 0x10, 0, 0xFF, 0xFF, 1, 2, 3, 4, 5, 6, 7};  // size 65535 of 100Ch
  const auto payload = std::as_bytes(std::span(records));
  const auto seal = [&] {
    header.crc = crc32(payload, crc32(std::as_bytes(std::span(&header, 1)).first(offsetof(StoreHeader, crc))));
    std::memcpy(medium.memory.data(), &header, sizeof header);
    std::memcpy(medium.memory.data() + sizeof header, payload.data(), payload.size());
  };
  seal();
  Device device;
  EXPECT_TRUE(device.start(medium));
  EXPECT_EQ(device, Device());
  for (const std::uint32_t length : {109U, 256U, 0x7FFFFFFFU, 0xFFFFFFFFU}) {
    header.payload_length = length;
    seal();
    EXPECT_FALSE(device.start(medium)) << length;
  }
  // A record must not use a byte of the other bank, even with a valid CRC.
  header.payload_length = 128 - sizeof header + 1;
  const auto all = std::as_bytes(std::span(medium.memory)).subspan(sizeof header, header.payload_length);
  header.crc = crc32(all, crc32(std::as_bytes(std::span(&header, 1)).first(offsetof(StoreHeader, crc))));
  std::memcpy(medium.memory.data(), &header, sizeof header);
  EXPECT_FALSE(device.start(medium));
  header.payload_length = 12;
  header.version = 2;
  seal();
  EXPECT_FALSE(device.start(medium));
  EXPECT_FALSE(medium.overran);
}

// The same with records of random content and a valid CRC: only values of this table may be loaded.
TEST(Store, RandomRecordsStayInTheirBankAndTheirObjects) {
  std::mt19937 random(77);
  unsigned loaded = 0;
  for (int round = 0; round < 20000; ++round) {
    FailingMedium medium(320);
    std::vector<std::byte> records;
    while (records.size() < 90) {
      const std::uint32_t key = table[random() % table.size()].key();
      const std::array<unsigned long, 5> head{key >> 8, key >> 16, key, random() % 13, random() % 64 == 0 ? 1UL : 0UL};
      for (const unsigned long byte : head) records.push_back(static_cast<std::byte>(byte));
      for (unsigned long i = random() % 13; i > 0; --i) records.push_back(static_cast<std::byte>(random()));
    }
    StoreHeader header{StoreHeader::current_version, static_cast<std::uint32_t>(random()),
                       static_cast<std::uint32_t>(random() % records.size()), 0, StoreHeader::valid_mark};
    const auto payload = std::span(records).first(header.payload_length);
    header.crc = crc32(payload, crc32(std::as_bytes(std::span(&header, 1)).first(offsetof(StoreHeader, crc))));
    std::memcpy(medium.memory.data(), &header, sizeof header);
    std::copy(payload.begin(), payload.end(), medium.memory.begin() + sizeof header);

    Device device;
    ASSERT_TRUE(device.start(medium));
    ASSERT_FALSE(medium.overran);
    ASSERT_EQ(device.objects.not_saved, 0);
    ASSERT_TRUE(device.objects.gain >= -1000 && device.objects.gain <= 1000);
    ASSERT_LE(device.objects.axis_name.length, 12U);
    loaded += device == Device() ? 0U : 1U;
    ASSERT_EQ(Store(medium).save(device.dictionary, Area::communication), AbortCode::none);
    ASSERT_FALSE(medium.overran);
  }
  EXPECT_GT(loaded, 1000U);
}

// Random tables, values, saves, restores and power cuts, compared with a model of the values that must survive.
class RandomDevice {
 public:
  explicit RandomDevice(std::mt19937& random) : random_(random) {
    constexpr std::array types{Type::boolean,        Type::integer8,     Type::integer16,
                               Type::unsigned32,     Type::integer64,    Type::unsigned64,
                               Type::visible_string, Type::octet_string, Type::domain};
    std::uint32_t offset = 0;
    std::uint32_t key = 0x100000;
    while (true) {
      key += 1 + static_cast<std::uint32_t>(random_() % 0x9FFFF);
      if (key > 0xFFFFFF) break;
      Entry entry;
      entry.index = static_cast<std::uint16_t>(key >> 8);
      entry.sub = static_cast<std::uint8_t>(key);
      entry.type = types[random_() % types.size()];
      entry.saved = random_() % 4 != 0;
      entry.offset = offset;
      entry.capacity = entry.fixed_size() ? 0 : static_cast<std::uint32_t>(random_() % 90);
      offset += entry.fixed_size() ? size_of(entry.type) : 4 + entry.capacity;
      table_.push_back(entry);
    }
    objects_.resize(offset);
  }
  RandomDevice(const RandomDevice&) = delete;
  RandomDevice& operator=(const RandomDevice&) = delete;

  using Values = std::map<std::uint32_t, std::vector<std::byte>>;  // saved entries by key

  void randomize() {
    for (const Entry& entry : table_) {
      std::vector<std::byte> value(entry.fixed_size() ? size_of(entry.type) : random_() % (entry.capacity + 1));
      for (std::byte& byte : value) byte = static_cast<std::byte>(random_());
      ASSERT_EQ(dictionary().write_any(entry, value), AbortCode::none);
    }
  }
  Values values() {
    Values result;
    for (const Entry& entry : table_) {
      ReadValue value;
      if (!entry.saved || dictionary().read(entry, value) != AbortCode::none) continue;
      result[entry.key()] = {value.bytes.begin(), value.bytes.end()};
    }
    return result;
  }
  Values values_after_start(Medium& medium) {
    dictionary().load_defaults(Area::all, node_id);
    Store(medium).load(dictionary(), Area::all);
    return values();
  }
  Dictionary& dictionary() { return dictionary_.emplace(table_, objects_); }
  std::size_t size() const { return table_.size(); }

 private:
  std::mt19937& random_;
  std::vector<Entry> table_;
  std::vector<std::byte> objects_;
  std::optional<Dictionary> dictionary_;
};

RandomDevice::Values merge(const RandomDevice::Values& old, const RandomDevice::Values& fresh, Area areas) {
  RandomDevice::Values result = old;
  for (const auto& [key, value] : fresh) {
    if (contains(areas, area_of(static_cast<std::uint16_t>(key >> 8)))) result[key] = value;
  }
  return result;
}

TEST(Store, RandomTablesValuesAndCutsAgreeWithAModel) {
  std::mt19937 random(20240601);
  unsigned cuts = 0;
  for (int table_number = 0; table_number < 200; ++table_number) {
    RandomDevice device(random);
    FailingMedium medium(16384);
    medium.caching = (random() & 1) != 0;
    const RandomDevice::Values factory = device.values_after_start(medium);
    RandomDevice::Values remembered = factory;
    for (int step = 0; step < 40; ++step) {
      device.randomize();
      const auto areas = static_cast<Area>(random() % 8);
      const bool restore = random() % 5 == 0;
      const RandomDevice::Values next = merge(remembered, restore ? factory : device.values(), areas);
      const bool cut = random() % 3 == 0;
      if (cut) medium.power_ends_after = medium.written + random() % 2000;
      const AbortCode abort = restore ? Store(medium).restore_defaults(device.dictionary(), areas)
                                      : Store(medium).save(device.dictionary(), areas);
      if (medium.dead) {
        ++cuts;
        EXPECT_EQ(abort, AbortCode::hardware_error);
        medium.lose_cache(random);
        medium.dead = false;
      } else {
        ASSERT_EQ(abort, AbortCode::none);
        remembered = next;
      }
      medium.power_ends_after = FailingMedium::never;
      const RandomDevice::Values loaded = device.values_after_start(medium);
      if (loaded == next) remembered = next;
      ASSERT_EQ(loaded, remembered) << "table " << table_number << " step " << step;
      ASSERT_FALSE(medium.overran);
    }
  }
  EXPECT_GT(cuts, 500U);
}

}  // namespace
}  // namespace store_test
}  // namespace servodrome::dictionary
