#include "axis/object_catalogue.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sstream>

#include "master/problem_of.hpp"

namespace servodrome::master {
namespace object_catalogue_test {
namespace {

using dictionary::Type;
using testing::HasSubstr;

std::vector<unsigned> bytes_of(std::string_view text, Type type) {
  std::vector<unsigned> numbers;
  for (const std::byte byte : parse_value(text, type)) numbers.push_back(std::to_integer<unsigned>(byte));
  return numbers;
}
using Bytes = std::vector<unsigned>;

TEST(ObjectCatalogue, ResolvesAddressesAndStandardNames) {
  const auto& catalogue = ObjectCatalogue::standard();
  const auto resolves = [&](const char* text, unsigned index, unsigned sub) {
    const ObjectAddress object = catalogue.resolve(text);
    EXPECT_EQ(object.index, index) << text;
    EXPECT_EQ(object.sub, sub) << text;
  };
  resolves("6041", 0x6041, 0);
  resolves("0x6041", 0x6041, 0);
  resolves("6099h:1", 0x6099, 1);
  resolves("1018:0x04", 0x1018, 4);
  resolves("2000:1F", 0x2000, 0x1F);
  resolves("statusword", 0x6041, 0);
  resolves("Profile velocity", 0x6081, 0);
  resolves("profile_velocity", 0x6081, 0);
  resolves("Software position limit.Min position limit", 0x607D, 1);
  resolves("manufacturer device name", 0x1008, 0);
  for (const char* wrong : {"", "60411", "6041:100", "6041:", "nonsense", "homing speeds"}) {
    EXPECT_THROW(catalogue.resolve(wrong), MasterError) << wrong;
  }
  EXPECT_EQ(catalogue.find({0x607A, 0})->type, Type::integer32);
  EXPECT_EQ(catalogue.find({0x607A, 1}), nullptr);
  EXPECT_EQ(catalogue.title({0x6041, 0}), "6041:00 Statusword");
  EXPECT_EQ(catalogue.title({0x2FFF, 2}), "2FFF:02");
}

TEST(ObjectCatalogue, ReadsAnEds) {
  std::istringstream eds(
      "[FileInfo]\r\nFileName=x.eds\r\n; a comment\r\n[2004]\r\nParameterName=CAN baud rate\r\nObjectType=0x7\r\n"
      "DataType=0x0006\r\nAccessType=rw\r\n[2100]\r\nParameterName=Gains\r\nObjectType=0x9\r\nSubNumber=2\r\n"
      "[2100sub0]\r\nParameterName=Highest\r\nDataType=5\r\n[2100SubA]\r\nParameterName=Position\r\nDATATYPE="
      "0x0004\r\n");
  const auto catalogue = ObjectCatalogue::read_eds(eds, "x.eds");
  ASSERT_EQ(catalogue.objects().size(), 3U);
  EXPECT_EQ(catalogue.resolve("can baud rate"), (ObjectAddress{0x2004, 0}));
  EXPECT_EQ(catalogue.find({0x2004, 0})->type, Type::unsigned16);
  EXPECT_EQ(catalogue.resolve("gains.position"), (ObjectAddress{0x2100, 10}));
  EXPECT_EQ(catalogue.find({0x2100, 10})->type, Type::integer32);
  EXPECT_EQ(catalogue.find({0x2100, 0})->type, Type::unsigned8);
  EXPECT_EQ(catalogue.resolve("position"), (ObjectAddress{0x2100, 10}));
  EXPECT_THROW(catalogue.resolve("gains"), MasterError);
  std::istringstream empty("[FileInfo]\nFileName=x.eds\n");
  EXPECT_THROW(ObjectCatalogue::read_eds(empty, "x.eds"), MasterError);
}

// "P01-02" at the start of a name, and "d08", which is also a valid address.
TEST(ObjectCatalogue, ResolvesMakersNumbers) {
  std::istringstream eds(
      "[2001]\nParameterName=P01 Main\nObjectType=0x9\nSubNumber=3\n[2001sub0]\nParameterName=Highest\nDataType=5\n"
      "[2001sub3]\nParameterName=P01-02 Adjustment\nDataType=6\n[2001sub4]\nParameterName=P01-03 Rigidity\nDataType=6\n"
      "[200D]\nParameterName=d08 Speed\nDataType=3\n[2010]\nParameterName=x1 One\nDataType=3\n"
      "[2011]\nParameterName=x1 Another\nDataType=3\n[2012]\nParameterName=Gain of 2 stages\nDataType=3\n"
      "[0D09]\nParameterName=real address\nDataType=3\n[2013]\nParameterName=d09 hidden by it\nDataType=3\n");
  const auto catalogue = ObjectCatalogue::read_eds(eds, "x.eds");
  EXPECT_EQ(catalogue.resolve("P01-02"), (ObjectAddress{0x2001, 3}));
  EXPECT_EQ(catalogue.resolve("p01_03"), (ObjectAddress{0x2001, 4}));
  EXPECT_EQ(catalogue.resolve("d08"), (ObjectAddress{0x200D, 0}));
  EXPECT_EQ(catalogue.resolve("d09"), (ObjectAddress{0x0D09, 0}));
  EXPECT_EQ(catalogue.resolve("d10"), (ObjectAddress{0x0D10, 0})) << "no such number: an address";
  EXPECT_EQ(catalogue.resolve("P01-03 rigidity"), (ObjectAddress{0x2001, 4})) << "what only one sub-index is called";
  try {
    catalogue.resolve("x1");
    ADD_FAILURE() << "two have it";
  } catch (const MasterError& error) {
    EXPECT_NE(error.remedy().find("2010:00 x1 One, 2011:00 x1 Another"), std::string::npos) << error.what();
  }
  for (const char* wrong : {"x1", "Gain", "P01", "P01-04"})
    EXPECT_THROW(catalogue.resolve(wrong), MasterError) << wrong;
}

TEST(ValueText, ParsesWhatTheTypeHas) {
  EXPECT_EQ(bytes_of("-3", Type::integer8), (Bytes{0xFD}));
  EXPECT_EQ(bytes_of("567", Type::unsigned16), (Bytes{0x37, 0x02}));
  EXPECT_EQ(bytes_of("0x237", Type::unsigned16), (Bytes{0x37, 0x02}));
  EXPECT_EQ(bytes_of("0237h", Type::unsigned16), (Bytes{0x37, 0x02}));
  EXPECT_EQ(bytes_of("0xFFFE", Type::integer16), (Bytes{0xFE, 0xFF}));
  EXPECT_EQ(bytes_of("-32768", Type::integer16), (Bytes{0x00, 0x80}));
  EXPECT_EQ(bytes_of("-9223372036854775808", Type::integer64), (Bytes{0, 0, 0, 0, 0, 0, 0, 0x80}));
  EXPECT_EQ(bytes_of("18446744073709551615", Type::unsigned64), Bytes(8, 0xFF));
  EXPECT_EQ(bytes_of("1", Type::boolean), (Bytes{1}));
  EXPECT_EQ(bytes_of("false", Type::boolean), (Bytes{0}));
  EXPECT_EQ(bytes_of("1.5", Type::real32), (Bytes{0, 0, 0xC0, 0x3F}));
  EXPECT_EQ(bytes_of("save", Type::visible_string), (Bytes{'s', 'a', 'v', 'e'}));
  EXPECT_EQ(bytes_of("01 ff 7A", Type::domain), (Bytes{0x01, 0xFF, 0x7A}));
  const std::pair<const char*, Type> wrong[] = {{"", Type::unsigned8},      {"256", Type::unsigned8},
                                                {"-1", Type::unsigned8},    {"128", Type::integer8},
                                                {"-129", Type::integer8},   {"0x100", Type::integer8},
                                                {"12a", Type::unsigned32},  {"0x", Type::unsigned32},
                                                {"2", Type::boolean},       {"1.5x", Type::real32},
                                                {"1.5", Type::integer32},   {"1F2", Type::domain},
                                                {"GG", Type::octet_string}, {"18446744073709551616", Type::unsigned64}};
  for (const auto& [text, type] : wrong) EXPECT_THROW(parse_value(text, type), MasterError) << text;
  EXPECT_THAT(test::problem_of([] { parse_value("-129", Type::integer8); }), HasSubstr("outside i8, -128 .. 127"));
}

TEST(ValueText, PrintsWhatPeopleRead) {
  const auto text = [](std::initializer_list<unsigned> numbers, std::optional<Type> type) {
    std::vector<std::byte> bytes;
    for (const unsigned number : numbers) bytes.push_back(static_cast<std::byte>(number));
    return text_of_value(bytes, type);
  };
  EXPECT_EQ(text({0x37, 0x02}, Type::unsigned16), "567 (0237h)");
  EXPECT_EQ(text({0xFE, 0xFF}, Type::integer16), "-2");
  EXPECT_EQ(text({0xFE, 0xFF}, std::nullopt), "65534 (FFFEh)");
  EXPECT_EQ(text({'h', 'i', 0}, Type::visible_string), "\"hi\"");
  EXPECT_EQ(text({'a', 'b', 'c'}, std::nullopt), "\"abc\"");
  EXPECT_EQ(text({1, 2, 3}, std::nullopt), "01 02 03");
  EXPECT_EQ(text({0, 0, 0xC0, 0x3F}, Type::real32), "1.5");
}

}  // namespace
}  // namespace object_catalogue_test
}  // namespace servodrome::master
