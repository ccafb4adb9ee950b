// Objects that one request writes as a whole.
#include "dictionary/joint_write.hpp"

#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "dictionary/table.hpp"

namespace servodrome::dictionary {
namespace joint_write_test {
namespace {

struct Objects {
  std::uint16_t word = 1;
  std::int32_t target = 2;
  std::uint8_t mode = 3;
  Blob<8> name;
};

constexpr auto table = make_table<[] {
  TableBuilder<8> builder;
  builder.add(var(0x2000, "", SERVODROME_FIELD(Objects, word), Access::rw, Pdo::none, {.owner = Owner::drive}));
  builder.add(var(0x2001, "", SERVODROME_FIELD(Objects, target), Access::wo, Pdo::none,
                  {.minimum = -100, .maximum = 100, .owner = Owner::drive}));
  builder.add(var(0x2002, "", SERVODROME_FIELD(Objects, mode), Access::rw));
  builder.add(var(0x2003, "", SERVODROME_FIELD(Objects, name), Access::rw));
  builder.add(var(0x2004, "", {Type::unsigned32}, Access::rw, Pdo::none, {.owner = Owner::product}));  // a command
  return builder;
}>();
static_assert(is_valid_table(table));

struct Log final : Listener, Recorder {
  Log(const Objects& its_objects) : objects(its_objects) {}
  void note(const std::string& what, const Entry& entry, std::span<const std::byte> value = {}) {
    std::string line = what + " " + std::to_string(entry.index & 0xF);
    if (!value.empty()) line += " " + std::to_string(decode_number(entry.type, value));
    lines.push_back(line);
  }
  AbortCode check(const Entry& entry, std::span<const std::byte> value) override {
    if (entry.index == 0x2004) note("acts", entry, value);
    return decode_number(entry.type, value) == 99 ? AbortCode::device_state : AbortCode::none;
  }
  void written(const Entry& entry) override {
    note("told with " + std::to_string(objects.word) + "," + std::to_string(objects.target) + "," +
             std::to_string(objects.mode),
         entry);
  }
  void before(const Entry& entry, std::span<const std::byte> value) override { note("before", entry, value); }
  void written(const Entry& entry, std::span<const std::byte> value) override { note("after", entry, value); }

  const Objects& objects;
  std::vector<std::string> lines;
};

// A view that changes writes of the bus: it doubles values of 2002h, and ignores values of 2000h.
struct Distorting final : View {
  void show(const Entry&, std::span<std::byte>) override {}
  bool take(const Entry& entry, std::span<std::byte> value) override {
    if (entry.index == 0x2002) value[0] = value[0] << 1;
    return entry.index != 0x2000;
  }
};

struct JointWriteTest : testing::Test {
  JointWriteTest() {
    dictionary.set_listener(Owner::drive, &log);
    dictionary.set_listener(Owner::product, &log);
  }
  AbortCode add(JointWrite& request, std::uint16_t index, std::int64_t value) {
    const Entry& entry = *dictionary.find(index, 0);
    values.push_back(encode_number(value));
    return request.add(entry, std::span(values.back()).first(size_of(entry.type)));
  }
  std::string all() const {
    return std::to_string(objects.word) + "," + std::to_string(objects.target) + "," + std::to_string(objects.mode);
  }

  Objects objects;
  Dictionary dictionary{table, std::as_writable_bytes(std::span(&objects, 1))};
  Log log{objects};
  std::vector<std::array<std::byte, 8>> values = [] {
    std::vector<std::array<std::byte, 8>> reserved;
    reserved.reserve(200);
    return reserved;
  }();
};

TEST_F(JointWriteTest, OwnersActWhenAllIsStored) {
  JointWrite request(dictionary);
  EXPECT_EQ(add(request, 0x2000, 10), AbortCode::none);
  EXPECT_EQ(add(request, 0x2002, 30), AbortCode::none);
  EXPECT_EQ(add(request, 0x2001, -20), AbortCode::none);
  EXPECT_TRUE(log.lines.empty());
  EXPECT_EQ(request.commit(), AbortCode::none);
  EXPECT_EQ(log.lines, (std::vector<std::string>{"told with 10,-20,30 0", "told with 10,-20,30 1"}));
}

TEST_F(JointWriteTest, WithoutCommitNothingChanges) {
  {
    JointWrite request(dictionary);
    EXPECT_EQ(add(request, 0x2000, 10), AbortCode::none);
    EXPECT_EQ(add(request, 0x2002, 30), AbortCode::none);
    EXPECT_EQ(add(request, 0x2000, 11), AbortCode::none);  // twice in a request
    EXPECT_EQ(add(request, 0x2001, 101), AbortCode::value_too_high);
    EXPECT_EQ(add(request, 0x2001, 99), AbortCode::device_state);
    EXPECT_EQ(add(request, 0x2004, 99), AbortCode::none) << "a command is checked by commit only";
    EXPECT_EQ(all(), "11,2,30");
  }
  EXPECT_EQ(all(), "1,2,3");
  EXPECT_TRUE(log.lines.empty());
}

TEST_F(JointWriteTest, CommandsActWithTheStoredValues) {
  JointWrite request(dictionary);
  EXPECT_EQ(add(request, 0x2004, 99), AbortCode::none);
  EXPECT_EQ(add(request, 0x2000, 10), AbortCode::none);
  EXPECT_EQ(request.commit(), AbortCode::device_state);
  EXPECT_EQ(log.lines, (std::vector<std::string>{"acts 4 99", "told with 10,2,3 0"})) << "the others are written";
}

TEST_F(JointWriteTest, RecordsOldAndNewValues) {
  dictionary.set_recorder(&log);
  JointWrite request(dictionary);
  EXPECT_EQ(add(request, 0x2002, 30), AbortCode::none);
  EXPECT_EQ(add(request, 0x2001, 20), AbortCode::none);
  EXPECT_EQ(request.commit(), AbortCode::none);
  EXPECT_EQ(log.lines,
            (std::vector<std::string>{"before 2 3", "after 2 30", "before 1", "told with 1,20,30 1", "after 1 20"}));
}

TEST_F(JointWriteTest, PassesTheView) {
  Distorting view;
  dictionary.set_view(&view);
  JointWrite request(dictionary);
  EXPECT_EQ(add(request, 0x2000, 10), AbortCode::none);
  EXPECT_EQ(add(request, 0x2002, 30), AbortCode::none);
  EXPECT_EQ(request.commit(), AbortCode::none);
  EXPECT_EQ(all(), "1,2,60");
  EXPECT_TRUE(log.lines.empty());
}

TEST_F(JointWriteTest, HasACapacity) {
  {
    JointWrite request(dictionary);
    for (std::size_t i = 0; i < JointWrite::capacity; ++i) EXPECT_EQ(add(request, 0x2002, 7), AbortCode::none);
    EXPECT_EQ(add(request, 0x2002, 7), AbortCode::out_of_memory);
  }
  EXPECT_EQ(all(), "1,2,3");
}

}  // namespace
}  // namespace joint_write_test
}  // namespace servodrome::dictionary
