#include "dictionary/dictionary.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <string>
#include <string_view>
#include <vector>

#include "dictionary/table.hpp"

namespace servodrome::dictionary {
namespace dictionary_test {
namespace {

struct Objects {
  bool enabled;
  std::int8_t mode;
  std::int16_t torque;
  std::int32_t position;
  std::int64_t position_counts;
  std::uint8_t number_of_errors;
  std::uint16_t controlword;
  std::uint32_t identifier;
  std::uint64_t serial;
  float gain;
  Blob<8> name;
  Blob<6> program;
};

constexpr Owner drive = Owner::drive;

constexpr auto table = make_table<[] {
  TableBuilder<24> builder;
  builder.add(number_constant(0x1000, 0, ObjectCode::var, "Device type", Type::unsigned32, 0x00020192));
  builder.add(text_constant(0x1008, "Device name", "Test"));
  builder.add(highest_sub(0x1400, ObjectCode::record, "RPDO 1", 2));
  builder.add(element(0x1400, 1, ObjectCode::record, "COB-ID", SERVODROME_FIELD(Objects, identifier), Access::rw,
                      Pdo::none, {.default_value = 0x80000200, .adds_node_id = true}));
  builder.add(element(0x1400, 2, ObjectCode::record, "Errors", SERVODROME_FIELD(Objects, number_of_errors), Access::ro,
                      Pdo::none, {.default_value = 255}));
  builder.add(var(0x2000, "Enabled", SERVODROME_FIELD(Objects, enabled), Access::rw));
  builder.add(var(0x2001, "Name", SERVODROME_FIELD(Objects, name), Access::rw));
  builder.add(var(0x2002, "Program", {Type::domain, offsetof(Objects, program), 6}, Access::wo));
  builder.add(var(0x2003, "Trace", {Type::domain}, Access::ro, Pdo::none, {.owner = drive}));
  builder.add(var(0x2004, "Gain", SERVODROME_FIELD(Objects, gain), Access::rw));
  builder.add(var(0x2005, "Serial", SERVODROME_FIELD(Objects, serial), Access::rw));
  builder.add(
      var(0x6040, "Controlword", SERVODROME_FIELD(Objects, controlword), Access::wo, Pdo::rpdo, {.owner = drive}));
  builder.add(var(0x6060, "Mode", SERVODROME_FIELD(Objects, mode), Access::rw, Pdo::rpdo,
                  {.default_value = -1, .minimum = -3, .maximum = 10, .owner = drive}));
  builder.add(var(0x6071, "Torque", SERVODROME_FIELD(Objects, torque), Access::rw, Pdo::rpdo, {.default_value = -300}));
  builder.add(
      var(0x607A, "Position", SERVODROME_FIELD(Objects, position), Access::rw, Pdo::rpdo, {.default_value = -70000}));
  builder.add(var(0x6100, "Position, long", SERVODROME_FIELD(Objects, position_counts), Access::rw, Pdo::rpdo,
                  {.default_value = std::numeric_limits<std::int64_t>::min() + 1}));
  return builder;
}>();
static_assert(is_valid_table(table));

std::span<const std::byte> bytes_of(std::string_view text) { return std::as_bytes(std::span(text)); }

std::string text_of(std::span<const std::byte> bytes) {
  std::string result;
  for (const std::byte byte : bytes) result.push_back(static_cast<char>(byte));
  return result;
}

struct MockListener : Listener {
  virtual ~MockListener() = default;
  MOCK_METHOD(AbortCode, check, (const Entry&, std::span<const std::byte>), (override));
  MOCK_METHOD(void, written, (const Entry&), (override));
  MOCK_METHOD(void, refresh, (const Entry&), (override));
  MOCK_METHOD(std::span<const std::byte>, domain, (const Entry&), (override));
};

struct DictionaryTest : testing::Test {
  const Entry& entry(std::uint16_t index, std::uint8_t sub = 0) {
    const Entry* found = dictionary.find(index, sub);
    EXPECT_NE(found, nullptr);
    return *found;
  }
  AbortCode write(std::uint16_t index, std::uint8_t sub, std::initializer_list<unsigned> value) {
    std::vector<std::byte> bytes;
    for (const unsigned byte : value) bytes.push_back(static_cast<std::byte>(byte));
    return dictionary.write(entry(index, sub), bytes);
  }
  std::string read(std::uint16_t index, std::uint8_t sub = 0) {
    ReadValue value;
    EXPECT_EQ(dictionary.read(entry(index, sub), value), AbortCode::none);
    return text_of(value.bytes);
  }

  Objects objects{};
  Dictionary dictionary{table, std::as_writable_bytes(std::span(&objects, 1))};
};

TEST_F(DictionaryTest, FindsEveryEntryAndOnlyThose) {
  unsigned found = 0;
  for (unsigned index = 0; index <= 0xFFFF; ++index) {
    for (const unsigned sub : {0U, 1U, 2U, 3U, 255U}) {
      AbortCode abort = AbortCode::general_error;
      const Entry* entry = dictionary.find(static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub), abort);
      if (entry == nullptr) continue;
      ++found;
      EXPECT_EQ(entry->key(), index << 8 | sub);
      EXPECT_EQ(abort, AbortCode::none);
    }
  }
  EXPECT_EQ(found, table.size());
}

TEST_F(DictionaryTest, TellsAMissingObjectFromAMissingSubIndex) {
  const auto abort_of = [this](std::uint16_t index, std::uint8_t sub) {
    AbortCode abort{};
    EXPECT_EQ(dictionary.find(index, sub, abort), nullptr);
    return abort;
  };
  EXPECT_EQ(abort_of(0x0FFF, 0), AbortCode::object_does_not_exist);  // before the first
  EXPECT_EQ(abort_of(0x1001, 0), AbortCode::object_does_not_exist);
  EXPECT_EQ(abort_of(0xFFFF, 255), AbortCode::object_does_not_exist);  // behind the last
  EXPECT_EQ(abort_of(0x1000, 1), AbortCode::sub_index_does_not_exist);
  EXPECT_EQ(abort_of(0x1400, 3), AbortCode::sub_index_does_not_exist);
  EXPECT_EQ(abort_of(0x6100, 255), AbortCode::sub_index_does_not_exist);
  EXPECT_EQ(Dictionary({}, {}).find(0x1000, 0), nullptr);
}

TEST_F(DictionaryTest, ConstantsNeedNoStorage) {
  EXPECT_EQ(dictionary.number(0x1000), 0x00020192);
  EXPECT_EQ(dictionary.number(0x1400, 0), 2);
  EXPECT_EQ(read(0x1008), "Test");
  EXPECT_EQ(write(0x1000, 0, {0, 0, 0, 0}), AbortCode::read_only);
  EXPECT_EQ(write(0x1008, 0, {'x'}), AbortCode::read_only);
}

TEST_F(DictionaryTest, AccessIsCheckedBeforeLengthAndRange) {
  EXPECT_EQ(write(0x1400, 2, {1, 2, 3}), AbortCode::read_only);
  ReadValue value;
  EXPECT_EQ(dictionary.read(entry(0x6040), value), AbortCode::write_only);
  EXPECT_EQ(dictionary.read(entry(0x2002), value), AbortCode::write_only);
  EXPECT_EQ(dictionary.number(0x6040), 0);
}

TEST_F(DictionaryTest, LengthIsCheckedBeforeRange) {
  EXPECT_EQ(write(0x6060, 0, {0x7F, 0}), AbortCode::length_too_high);
  EXPECT_EQ(write(0x6060, 0, {}), AbortCode::length_too_low);
  EXPECT_EQ(write(0x607A, 0, {1, 2, 3}), AbortCode::length_too_low);
  EXPECT_EQ(write(0x607A, 0, {1, 2, 3, 4, 5}), AbortCode::length_too_high);
  EXPECT_EQ(write(0x2001, 0, {1, 2, 3, 4, 5, 6, 7, 8, 9}), AbortCode::length_too_high);
  EXPECT_EQ(objects.position, 0);
}

TEST_F(DictionaryTest, ProductsChooseTheirLengthAborts) {
  dictionary = Dictionary(table, std::as_writable_bytes(std::span(&objects, 1)),
                          {.too_long = AbortCode::length_mismatch, .too_short = AbortCode::general_error});
  EXPECT_EQ(write(0x607A, 0, {1, 2, 3, 4, 5}), AbortCode::length_mismatch);
  EXPECT_EQ(write(0x607A, 0, {1}), AbortCode::general_error);
}

TEST_F(DictionaryTest, RangeIsCheckedBeforeTheOwner) {
  testing::StrictMock<MockListener> owner;
  dictionary.set_listener(drive, &owner);
  objects.mode = 6;
  EXPECT_EQ(write(0x6060, 0, {11}), AbortCode::value_too_high);
  EXPECT_EQ(write(0x6060, 0, {0xFC}), AbortCode::value_too_low);  // -4
  EXPECT_EQ(objects.mode, 6);
}

TEST_F(DictionaryTest, LimitsThemselvesAreAllowed) {
  EXPECT_EQ(write(0x6060, 0, {10}), AbortCode::none);
  EXPECT_EQ(write(0x6060, 0, {0xFD}), AbortCode::none);
  EXPECT_EQ(objects.mode, -3);
}

TEST_F(DictionaryTest, OwnerChecksThenTheValueIsCommittedThenTheOwnerIsTold) {
  MockListener owner;
  dictionary.set_listener(drive, &owner);
  testing::InSequence in_this_order;
  EXPECT_CALL(owner, check).WillOnce([this](const Entry& checked, std::span<const std::byte> value) {
    EXPECT_EQ(checked.index, 0x6040);
    EXPECT_EQ(text_of(value), "\x0F\x01");
    EXPECT_EQ(objects.controlword, 0);  // not yet
    return AbortCode::none;
  });
  EXPECT_CALL(owner, written).WillOnce([this](const Entry& told) {
    EXPECT_EQ(told.index, 0x6040);
    EXPECT_EQ(objects.controlword, 0x010F);
  });
  EXPECT_EQ(write(0x6040, 0, {0x0F, 0x01}), AbortCode::none);
}

TEST_F(DictionaryTest, OwnersRefusalChangesNothing) {
  testing::StrictMock<MockListener> owner;
  dictionary.set_listener(drive, &owner);
  EXPECT_CALL(owner, check).WillOnce(testing::Return(AbortCode::device_state));
  EXPECT_EQ(write(0x6060, 0, {1}), AbortCode::device_state);
  EXPECT_EQ(objects.mode, 0);
}

TEST_F(DictionaryTest, OnlyTheOwnerIsTold) {
  testing::StrictMock<MockListener> other;
  dictionary.set_listener(Owner::communication, &other);
  dictionary.set_listener(Owner::product, &other);
  EXPECT_EQ(write(0x6060, 0, {1}), AbortCode::none);
  EXPECT_EQ(write(0x2000, 0, {1}), AbortCode::none);
  EXPECT_TRUE(objects.enabled);
}

TEST_F(DictionaryTest, OwnerRefreshesBeforeARead) {
  testing::StrictMock<MockListener> owner;
  dictionary.set_listener(drive, &owner);
  EXPECT_CALL(owner, refresh).WillOnce([this](const Entry&) { objects.mode = 8; });
  EXPECT_EQ(dictionary.number(0x6060), 8);
}

TEST_F(DictionaryTest, WriteAnyPassesAccessButNotTheOtherChecks) {
  const std::array one{std::byte{7}};
  EXPECT_EQ(dictionary.write_any(entry(0x1400, 2), one), AbortCode::none);
  EXPECT_EQ(objects.number_of_errors, 7);
  EXPECT_EQ(dictionary.write_any(entry(0x1400, 2), {}), AbortCode::length_too_low);
  const std::array beyond{std::byte{11}};
  EXPECT_EQ(dictionary.write_any(entry(0x6060), beyond), AbortCode::value_too_high);
}

TEST_F(DictionaryTest, NumbersAreSignExtendedAsTheirTypeDemands) {
  objects.mode = -2;
  objects.torque = -3;
  objects.position = std::numeric_limits<std::int32_t>::min();
  objects.position_counts = std::numeric_limits<std::int64_t>::min();
  objects.number_of_errors = 0xFE;
  objects.identifier = 0xFFFFFFFE;
  objects.serial = 0xFFFFFFFFFFFFFFFE;
  EXPECT_EQ(dictionary.number(0x6060), -2);
  EXPECT_EQ(dictionary.number(0x6071), -3);
  EXPECT_EQ(dictionary.number(0x607A), std::numeric_limits<std::int32_t>::min());
  EXPECT_EQ(dictionary.number(0x6100), std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(dictionary.number(0x1400, 2), 0xFE);
  EXPECT_EQ(dictionary.number(0x1400, 1), 0xFFFFFFFE);
  EXPECT_EQ(dictionary.number(0x2005), -2);  // unsigned 64-bit values wrap
  EXPECT_EQ(dictionary.number(0x7777), 0);
  EXPECT_EQ(decode_number(Type::integer8, bytes_of("\x80")), -128);
  EXPECT_EQ(decode_number(Type::unsigned8, bytes_of("\x80")), 128);
}

TEST_F(DictionaryTest, SetNumberFindsChecksAndWrites) {
  EXPECT_EQ(dictionary.set_number(0x6071, 0, -1234), AbortCode::none);
  EXPECT_EQ(objects.torque, -1234);
  EXPECT_EQ(dictionary.set_number(0x6071, 1, 0), AbortCode::sub_index_does_not_exist);
  EXPECT_EQ(dictionary.set_number(0x6072, 0, 0), AbortCode::object_does_not_exist);
  EXPECT_EQ(dictionary.set_number(0x6060, 0, -4), AbortCode::value_too_low);
  EXPECT_EQ(dictionary.set_number(0x1000, 0, 1), AbortCode::read_only);
}

TEST_F(DictionaryTest, DefaultsOfTheChosenAreasWithTheNodeId) {
  objects.name.length = 3;
  objects.torque = 99;
  dictionary.load_defaults(Area::communication, 0x12);
  EXPECT_EQ(objects.identifier, 0x80000212U);
  EXPECT_EQ(objects.number_of_errors, 255);
  EXPECT_EQ(objects.torque, 99);
  EXPECT_EQ(objects.name.length, 3U);
  dictionary.load_defaults(Area::manufacturer | Area::profile, 0x7F);
  EXPECT_EQ(objects.identifier, 0x80000212U);
  EXPECT_EQ(objects.torque, -300);
  EXPECT_EQ(objects.mode, -1);
  EXPECT_EQ(objects.position, -70000);
  EXPECT_EQ(objects.position_counts, std::numeric_limits<std::int64_t>::min() + 1);
  EXPECT_EQ(objects.name.length, 0U);
}

TEST_F(DictionaryTest, DefaultsDoNotTellTheOwner) {
  testing::StrictMock<MockListener> owner;
  dictionary.set_listener(drive, &owner);
  dictionary.load_defaults(Area::all, 1);
  EXPECT_EQ(objects.mode, -1);
}

TEST_F(DictionaryTest, StringsKeepTheirLength) {
  EXPECT_EQ(read(0x2001), "");
  EXPECT_EQ(dictionary.write(entry(0x2001), bytes_of("eightchr")), AbortCode::none);
  EXPECT_EQ(read(0x2001), "eightchr");
  EXPECT_EQ(dictionary.write(entry(0x2001), bytes_of("two")), AbortCode::none);
  EXPECT_EQ(read(0x2001), "two");
  EXPECT_EQ(dictionary.write(entry(0x2001), {}), AbortCode::none);
  EXPECT_EQ(read(0x2001), "");
  objects.name.length = 1000;  // a length beyond the capacity must not be used
  EXPECT_EQ(read(0x2001).size(), 8U);
}

TEST_F(DictionaryTest, DomainsLiveInTheObjectsOrWithTheirOwner) {
  EXPECT_EQ(write(0x2002, 0, {1, 2, 3, 4, 5, 6}), AbortCode::none);
  EXPECT_EQ(objects.program.length, 6U);
  EXPECT_EQ(objects.program.bytes[5], 6);
  EXPECT_EQ(write(0x2002, 0, {1, 2, 3, 4, 5, 6, 7}), AbortCode::length_too_high);

  EXPECT_EQ(read(0x2003), "");  // it has no owner yet
  testing::NiceMock<MockListener> owner;
  dictionary.set_listener(drive, &owner);
  const std::string trace(1000, 't');
  EXPECT_CALL(owner, domain).WillOnce(testing::Return(bytes_of(trace)));
  EXPECT_EQ(read(0x2003), trace);
}

TEST_F(DictionaryTest, ANumberReadIsACopy) {
  objects.position = 5;
  ReadValue value;
  ASSERT_EQ(dictionary.read(entry(0x607A), value), AbortCode::none);
  objects.position = 6;
  EXPECT_EQ(decode_number(Type::integer32, value.bytes), 5);
}

TEST(TypeLimits, AreThoseOfTheCppTypes) {
  EXPECT_EQ(minimum_of(Type::integer8), -128);
  EXPECT_EQ(maximum_of(Type::integer8), 127);
  EXPECT_EQ(minimum_of(Type::integer32), std::numeric_limits<std::int32_t>::min());
  EXPECT_EQ(maximum_of(Type::integer32), std::numeric_limits<std::int32_t>::max());
  EXPECT_EQ(minimum_of(Type::integer64), std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(maximum_of(Type::integer64), std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(minimum_of(Type::unsigned16), 0);
  EXPECT_EQ(maximum_of(Type::unsigned16), 0xFFFF);
  EXPECT_EQ(maximum_of(Type::unsigned32), 0xFFFFFFFF);
  EXPECT_EQ(maximum_of(Type::boolean), 1);
}

TEST(Areas, AreTheRangesOfTheStandard) {
  EXPECT_EQ(area_of(0x1000), Area::communication);
  EXPECT_EQ(area_of(0x1FFF), Area::communication);
  EXPECT_EQ(area_of(0x2000), Area::manufacturer);
  EXPECT_EQ(area_of(0x5FFF), Area::manufacturer);
  EXPECT_EQ(area_of(0x6000), Area::profile);
  EXPECT_TRUE(contains(Area::communication | Area::profile, Area::profile));
  EXPECT_FALSE(contains(Area::communication | Area::profile, Area::manufacturer));
}

TEST(AbortCodes, HaveTheWordsOfTheStandard) {
  EXPECT_STREQ(text(AbortCode::object_does_not_exist), "object does not exist");
  EXPECT_STREQ(text(static_cast<AbortCode>(1)), "unknown abort code");
}

// The run-time checks of a table: each invalid table is refused by exactly the check that is meant for it.
Entry number(std::uint16_t index, std::uint8_t sub = 0, ObjectCode code = ObjectCode::var) {
  return element(index, sub, code, "x", {Type::integer16, 0}, Access::rw);
}

TEST(TableChecks, AcceptTheTableOfThisFile) { EXPECT_TRUE(is_valid_table(std::vector(table.begin(), table.end()))); }

TEST(TableChecks, RefuseDisorderAndDuplicates) {
  EXPECT_TRUE(is_valid_table(std::array{number(0x2000), number(0x2001)}));
  EXPECT_FALSE(is_valid_table(std::array{number(0x2001), number(0x2000)}));
  EXPECT_FALSE(is_sorted_and_unique(std::array{number(0x2001), number(0x2000)}));
  EXPECT_FALSE(is_sorted_and_unique(std::array{number(0x2000), number(0x2000)}));
  EXPECT_FALSE(is_sorted_and_unique(std::array{number(0x2000, 1), number(0x2000, 0)}));
}

TEST(TableChecks, RefuseDefaultsOutOfRange) {
  Entry entry = number(0x2000);
  entry.minimum = -5;
  entry.maximum = 5;
  for (const auto& [value, good] : {std::pair{-6, false}, {-5, true}, {5, true}, {6, false}}) {
    entry.default_value = value;
    EXPECT_EQ(is_valid_table(std::array{entry}), good) << value;
    EXPECT_EQ(defaults_are_in_range(std::array{entry}), good) << value;
  }
}

TEST(TableChecks, DefaultsMustFitTheirType) {
  EXPECT_FALSE(is_valid_table(
      std::array{var(0x2000, "x", {Type::unsigned8, 0}, Access::rw, Pdo::none, {.default_value = 256})}));
  EXPECT_FALSE(
      is_valid_table(std::array{var(0x2000, "x", {Type::unsigned8, 0}, Access::rw, Pdo::none, {.default_value = -1})}));
  EXPECT_FALSE(
      is_valid_table(std::array{var(0x2000, "x", {Type::boolean, 0}, Access::rw, Pdo::none, {.default_value = 2})}));
}

TEST(TableChecks, RefuseObjectsWithoutSubIndexZeroOrOfTwoKinds) {
  EXPECT_FALSE(is_valid_table(std::array{number(0x2000, 1, ObjectCode::array)}));
  EXPECT_FALSE(is_valid_table(std::array{number(0x1000), number(0x2000, 1, ObjectCode::array)}));
  EXPECT_FALSE(is_valid_table(std::array{number(0x2000, 0, ObjectCode::record), number(0x2000, 1, ObjectCode::array)}));
  EXPECT_TRUE(is_valid_table(std::array{number(0x2000, 0, ObjectCode::array), number(0x2000, 1, ObjectCode::array)}));
}

std::vector<std::uint32_t> keys(const auto& builder) {
  std::vector<std::uint32_t> result;
  for (std::size_t i = 0; i < builder.count; ++i) result.push_back(builder.entries[i].key());
  return result;
}

// Local objects are in the dictionary of the service port and not in that of the bus; both dictionaries use the same
// values.
struct LocalObjects {
  std::uint16_t seen = 0;
  std::uint16_t hidden = 0;
};
constexpr std::array table_with_local{
    var(0x2000, "Seen", SERVODROME_FIELD(LocalObjects, seen), Access::rw),
    var(0x2001, "Hidden", SERVODROME_FIELD(LocalObjects, hidden), Access::rw, Pdo::none,
        {.default_value = 7, .saved = true, .local = true}),
    var(0x2002, "Constant", {Type::unsigned8}, Access::constant, Pdo::none, {.default_value = 3}),
};
constexpr auto bus_table = make_bus_table<table_with_local>();

TEST(LocalObjectsOfATable, AreNotSeenByTheBus) {
  static_assert(is_valid_table(table_with_local) && is_valid_table(bus_table) && bus_table.size() == 2);
  LocalObjects objects;
  Dictionary whole(table_with_local, std::as_writable_bytes(std::span(&objects, 1)));
  Dictionary bus(bus_table, std::as_writable_bytes(std::span(&objects, 1)));
  whole.load_defaults(Area::all, 0);
  EXPECT_EQ(whole.number(0x2001), 7);
  AbortCode abort{};
  EXPECT_EQ(bus.find(0x2001, 0, abort), nullptr);
  EXPECT_EQ(abort, AbortCode::object_does_not_exist);
  EXPECT_EQ(bus.set_number(0x2000, 0, 5), AbortCode::none);
  EXPECT_EQ(whole.number(0x2000), 5);
}

TEST(TableChecks, RefuseObjectsThatAreLocalInPart) {
  std::vector<Entry> entries{highest_sub(0x2000, ObjectCode::record, "Object", 1),
                             element(0x2000, 1, ObjectCode::record, "Part", {Type::unsigned8}, Access::constant)};
  EXPECT_TRUE(is_valid_table(entries));
  entries[1].local = true;
  EXPECT_FALSE(is_valid_table(entries));
}

TEST(TableBuilder, AddReplacesAnEntryOfTheSameKey) {
  TableBuilder<4> builder;
  builder.add(std::array{number(0x2000), number(0x2001)});
  builder.add(var(0x2000, "override", {Type::unsigned8, 3}, Access::ro));
  EXPECT_THAT(keys(builder), testing::ElementsAre(0x200000, 0x200100));
  EXPECT_STREQ(builder.at(0x2000).name, "override");
  EXPECT_EQ(builder.at(0x2000).type, Type::unsigned8);
}

TEST(TableBuilder, BaseMovesWhatHasStorageOnly) {
  TableBuilder<4> builder;
  builder.add(number(0x2000), 100);
  builder.append(std::array{number(0x2001), number_constant(0x2002, 0, ObjectCode::var, "c", Type::unsigned8, 1)}, 50);
  EXPECT_EQ(builder.at(0x2000).offset, 100U);
  EXPECT_EQ(builder.at(0x2001).offset, 50U);
  EXPECT_EQ(builder.at(0x2002).offset, Field::no_storage);
}

TEST(TableBuilder, PicksAndRemovesWholeObjects) {
  const std::array section{number(0x2000, 0, ObjectCode::array), number(0x2000, 1, ObjectCode::array), number(0x2001),
                           number(0x2002)};
  constexpr std::array<std::uint16_t, 3> wanted{0x2002, 0x2000, 0x7777};
  TableBuilder<8> builder;
  builder.add(number(0x1000)).pick(section, wanted, 10);
  EXPECT_THAT(keys(builder), testing::ElementsAre(0x100000, 0x200000, 0x200001, 0x200200));
  EXPECT_EQ(builder.at(0x2000, 1).offset, 10U);
  builder.remove(0x2000);
  EXPECT_THAT(keys(builder), testing::ElementsAre(0x100000, 0x200200));
  builder.remove(0x5555);
  EXPECT_EQ(builder.count, 2U);
}

TEST(TableBuilder, OverridesDefaultsAndRanges) {
  TableBuilder<2> builder;
  builder.add(number(0x2000));
  EXPECT_FALSE(builder.at(0x2000).has_range);
  builder.set_default(0x2000, 0, -7).set_range(0x2000, 0, -10, 10);
  const Entry& entry = builder.at(0x2000);
  EXPECT_EQ(entry.default_value, -7);
  EXPECT_EQ(entry.minimum, -10);
  EXPECT_EQ(entry.maximum, 10);
  EXPECT_TRUE(entry.has_range);
}

TEST(TableBuilder, MakeTableSorts) {
  constexpr auto sorted = make_table<[] {
    TableBuilder<8> builder;
    builder.add(number_constant(0x6000, 0, ObjectCode::var, "c", Type::unsigned8, 1));
    builder.add(number_constant(0x1000, 0, ObjectCode::var, "a", Type::unsigned8, 1));
    builder.add(number_constant(0x2000, 0, ObjectCode::var, "b", Type::unsigned8, 1));
    return builder;
  }>();
  static_assert(sorted.size() == 3 && is_valid_table(sorted));
  EXPECT_EQ(sorted[0].index, 0x1000);
  EXPECT_EQ(sorted[2].index, 0x6000);
}

// The recorder receives each write with the previous value, and no refused write.
TEST(DictionaryRecorder, GetsTheValueBeforeAndAfter) {
  struct Note {
    std::uint16_t index;
    std::vector<std::byte> before;
    std::vector<std::byte> after;
  };
  class Notes final : public Recorder {
   public:
    void before(const Entry&, std::span<const std::byte> value) override { before_.assign(value.begin(), value.end()); }
    void written(const Entry& entry, std::span<const std::byte> value) override {
      notes.push_back({entry.index, before_, {value.begin(), value.end()}});
    }
    std::vector<Note> notes;

   private:
    std::vector<std::byte> before_;
  };
  Objects objects{};
  objects.mode = 1;
  Dictionary dictionary(table, std::as_writable_bytes(std::span(&objects, 1)));
  Notes notes;
  dictionary.set_recorder(&notes);
  const auto write = [&](std::uint16_t index, std::string_view bytes) {
    return dictionary.write(*dictionary.find(index, 0), bytes_of(bytes));
  };
  const auto is = [](std::string_view text) {
    const auto bytes = bytes_of(text);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  EXPECT_EQ(write(0x6060, "\x03"), AbortCode::none);
  EXPECT_EQ(write(0x6060, "\x7F"), AbortCode::value_too_high);
  EXPECT_EQ(write(0x2001, "one"), AbortCode::none);
  EXPECT_EQ(write(0x2001, "three"), AbortCode::none);
  EXPECT_EQ(write(0x6040, "ab"), AbortCode::none);
  EXPECT_EQ(dictionary.set_number(0x6071, 0, 5), AbortCode::none);  // the device itself
  ASSERT_EQ(notes.notes.size(), 4U);
  EXPECT_EQ(notes.notes[0].before, is("\x01"));
  EXPECT_EQ(notes.notes[0].after, is("\x03"));
  EXPECT_EQ(notes.notes[1].before, is(""));
  EXPECT_EQ(notes.notes[2].before, is("one"));
  EXPECT_EQ(notes.notes[2].after, is("three"));
  EXPECT_EQ(notes.notes[3].before, is("")) << "a write-only object has no value to read";
  dictionary.set_recorder(nullptr);
  EXPECT_EQ(write(0x6060, "\x04"), AbortCode::none);
  EXPECT_EQ(notes.notes.size(), 4U);
}

}  // namespace
}  // namespace dictionary_test
}  // namespace servodrome::dictionary
