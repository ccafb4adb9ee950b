#include <algorithm>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "describe/sample.hpp"

namespace servodrome::describe {
namespace eds_test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::Pair;

using Section = std::vector<std::pair<std::string, std::string>>;

// The sections of an EDS in their order. Fails on a line that is not a section, a key or empty.
struct Parsed {
  explicit Parsed(const std::string& text) { parse(text); }

  void parse(const std::string& text) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      ASSERT_FALSE(line.empty());
      ASSERT_EQ(line.back(), '\r');
      line.pop_back();
      if (line.empty()) continue;
      EXPECT_TRUE(std::all_of(line.begin(), line.end(), [](char c) { return c >= ' ' && c <= '~' && c != ';'; }))
          << line;
      EXPECT_LE(line.size(), 255U);
      if (line.front() == '[') {
        names.push_back(line.substr(1, line.size() - 2));
        EXPECT_TRUE(sections.try_emplace(names.back()).second) << line << " twice";
      } else {
        const auto equals = line.find('=');
        ASSERT_NE(equals, std::string::npos) << line;
        sections[names.back()].emplace_back(line.substr(0, equals), line.substr(equals + 1));
      }
    }
  }
  const Section& operator[](const std::string& name) const {
    static const Section missing{{"missing", "section"}};
    const auto found = sections.find(name);
    return found == sections.end() ? missing : found->second;
  }
  std::string value(const std::string& section, const std::string& key) const {
    for (const auto& [name, text] : (*this)[section]) {
      if (name == key) return text;
    }
    return "(no key)";
  }

  std::vector<std::string> names;
  std::map<std::string, Section> sections;
};

struct EdsTest : testing::Test {
  Parsed eds{describe::eds(sample::description())};
};

TEST_F(EdsTest, SaysWhatItIs) {
  EXPECT_THAT(eds["FileInfo"],
              ElementsAre(Pair("FileName", "sample.eds"), Pair("FileVersion", "2"), Pair("FileRevision", "1"),
                          Pair("EDSVersion", "4.0"), Pair("Description", "A sample with ?"),
                          Pair("CreationTime", "12:05AM"), Pair("CreationDate", "02-09-2024"),
                          Pair("CreatedBy", "somebody"), Pair("ModificationTime", "11:59PM"),
                          Pair("ModificationDate", "12-31-2024"), Pair("ModifiedBy", "somebody else")));
  EXPECT_THAT(eds["Comments"], ElementsAre(Pair("Lines", "2"), Pair("Line1", "first"), Pair("Line2", "second")));
}

TEST_F(EdsTest, DescribesTheDeviceFromItsIdentityObject) {
  EXPECT_THAT(
      eds["DeviceInfo"],
      ElementsAre(Pair("VendorName", "Servodrome"), Pair("VendorNumber", "0x12345678"), Pair("ProductName", "Sample_1"),
                  Pair("ProductNumber", "0x9ABCDEF0"), Pair("RevisionNumber", "0x00010002"), Pair("OrderCode", "S-1"),
                  Pair("BaudRate_10", "0"), Pair("BaudRate_20", "0"), Pair("BaudRate_50", "0"),
                  Pair("BaudRate_125", "1"), Pair("BaudRate_250", "0"), Pair("BaudRate_500", "1"),
                  Pair("BaudRate_800", "0"), Pair("BaudRate_1000", "1"), Pair("SimpleBootUpMaster", "0"),
                  Pair("SimpleBootUpSlave", "1"), Pair("Granularity", "8"), Pair("DynamicChannelsSupported", "0"),
                  Pair("CompactPDO", "0"), Pair("GroupMessaging", "0"), Pair("NrOfRXPDO", "1"), Pair("NrOfTXPDO", "1"),
                  Pair("LSS_Supported", "1")));
  EXPECT_THAT(eds["DummyUsage"], ElementsAre(Pair("Dummy0001", "0"), Pair("Dummy0002", "1"), Pair("Dummy0003", "1"),
                                             Pair("Dummy0004", "0"), Pair("Dummy0005", "0"), Pair("Dummy0006", "0"),
                                             Pair("Dummy0007", "0")));
}

TEST_F(EdsTest, ListsEveryObjectOnceInItsList) {
  EXPECT_THAT(eds["MandatoryObjects"], ElementsAre(Pair("SupportedObjects", "3"), Pair("1", "0x1000"),
                                                   Pair("2", "0x1001"), Pair("3", "0x1018")));
  EXPECT_THAT(eds["ManufacturerObjects"],
              ElementsAre(Pair("SupportedObjects", "6"), Pair("1", "0x2000"), Pair("2", "0x2001"), Pair("3", "0x2002"),
                          Pair("4", "0x2003"), Pair("5", "0x2004"), Pair("6", "0x2005")));
  EXPECT_EQ(eds.value("OptionalObjects", "SupportedObjects"), "16");
  EXPECT_EQ(eds.value("OptionalObjects", "1"), "0x1003");
  EXPECT_EQ(eds.value("OptionalObjects", "16"), "0x607A");
}

TEST_F(EdsTest, EveryEntryOfTheTableHasItsSection) {
  std::size_t expected = 7;  // sections that are not objects
  for (const dictionary::Entry& entry : sample::table) {
    char name[16];
    const bool is_var = entry.code == dictionary::ObjectCode::var;
    std::snprintf(name, sizeof name, is_var ? "%04X" : "%04Xsub%X", entry.index, entry.sub);
    if (entry.index < 0x1000) {
      EXPECT_EQ(eds.sections.count(name), 0U) << name;
      continue;
    }
    EXPECT_EQ(eds.sections.count(name), 1U) << name;
    expected += !is_var && entry.sub == 0 ? 2 : 1;
  }
  EXPECT_EQ(eds.sections.size(), expected);
}

TEST_F(EdsTest, RecordsNameTheirObjectAndCountTheirEntries) {
  EXPECT_THAT(eds["1018"],
              ElementsAre(Pair("ParameterName", "Identity"), Pair("ObjectType", "0x9"), Pair("SubNumber", "5")));
  EXPECT_THAT(eds["1018sub0"],
              ElementsAre(Pair("ParameterName", "Highest sub-index supported"), Pair("ObjectType", "0x7"),
                          Pair("DataType", "0x0005"), Pair("AccessType", "const"), Pair("DefaultValue", "4"),
                          Pair("PDOMapping", "0")));
  EXPECT_EQ(eds.value("1003", "ObjectType"), "0x8");
  EXPECT_EQ(eds.value("1003sub0", "ParameterName"), "Number of errors");
  EXPECT_EQ(eds.value("1600", "SubNumber"), "11");
  EXPECT_THAT(eds["1600sub0"], ElementsAre(Pair("ParameterName", "Number of mapped application objects in PDO"),
                                           Pair("ObjectType", "0x7"), Pair("DataType", "0x0005"),
                                           Pair("AccessType", "rw"), Pair("DefaultValue", "2"), Pair("LowLimit", "0"),
                                           Pair("HighLimit", "10"), Pair("PDOMapping", "0")));
  EXPECT_EQ(eds.value("1600subA", "ParameterName"), "Mapped object");
}

TEST_F(EdsTest, VariablesCarryTheirRules) {
  EXPECT_THAT(eds["6060"], ElementsAre(Pair("ParameterName", "Modes of operation"), Pair("ObjectType", "0x7"),
                                       Pair("DataType", "0x0002"), Pair("AccessType", "rw"), Pair("DefaultValue", "-1"),
                                       Pair("LowLimit", "-3"), Pair("HighLimit", "10"), Pair("PDOMapping", "1")));
  EXPECT_EQ(eds.value("6040", "LowLimit"), "(no key)");
}

TEST_F(EdsTest, AccessSaysInWhichDirectionAnObjectIsMapped) {
  const auto access = [this](const char* section) {
    return eds.value(section, "AccessType") + " " + eds.value(section, "PDOMapping");
  };
  EXPECT_EQ(access("6040"), "rww 1");
  EXPECT_EQ(access("607A"), "rwr 1");
  EXPECT_EQ(access("6060"), "rw 1");
  EXPECT_EQ(access("6041"), "ro 1");
  EXPECT_EQ(access("6071"), "wo 1");
  EXPECT_EQ(access("6061"), "ro 0");
  EXPECT_EQ(access("1000"), "const 0");
}

TEST_F(EdsTest, DefaultsOfEveryKind) {
  const auto value = [this](const char* section) { return eds.value(section, "DefaultValue"); };
  EXPECT_EQ(value("1000"), "0x00020192");
  EXPECT_EQ(value("1006"), "1000");  // a time, not a bit field
  EXPECT_EQ(value("1008"), "Sample, \"drive\"");
  EXPECT_EQ(value("1014"), "$NODEID+0x80");
  EXPECT_EQ(value("1400sub1"), "$NODEID+0x80000200");
  EXPECT_EQ(value("1600sub1"), "0x60400010");
  EXPECT_EQ(value("2000"), "1");
  EXPECT_EQ(value("2001"), "0.1");
  EXPECT_EQ(value("2002"), "");
  EXPECT_EQ(value("2003"), "");
  EXPECT_EQ(value("2004"), "");
  EXPECT_EQ(value("2005sub1"), "18446744073709551615");
  EXPECT_EQ(value("2005sub2"), "-5000000000");
  EXPECT_EQ(value("607A"), "-123456");
  EXPECT_EQ(eds.value("607A", "HighLimit"), "2147483647");
  EXPECT_EQ(eds.value("2005sub2", "HighLimit"), "4611686018427387904");
}

TEST_F(EdsTest, DomainsAreAnObjectTypeOfTheirOwn) {
  EXPECT_THAT(eds["2004"], ElementsAre(Pair("ParameterName", "Trace"), Pair("ObjectType", "0x2"),
                                       Pair("DataType", "0x000F"), Pair("AccessType", "ro"), Pair("DefaultValue", "")));
  EXPECT_EQ(eds.value("2003", "DataType"), "0x000A");
}

TEST_F(EdsTest, SameTableSameBytes) {
  EXPECT_EQ(describe::eds(sample::description()), describe::eds(sample::description()));
}

TEST(Eds, GranularityIsZeroWhereNoMappingCanBeChanged) {
  std::vector<dictionary::Entry> fixed(sample::table.begin(), sample::table.end());
  for (dictionary::Entry& entry : fixed) entry.access = dictionary::Access::ro;
  Description description = sample::description();
  description.granularity_bits = 16;
  EXPECT_EQ(Parsed(describe::eds(description)).value("DeviceInfo", "Granularity"), "16");
  description.table = fixed;
  EXPECT_EQ(Parsed(describe::eds(description)).value("DeviceInfo", "Granularity"), "0");
}

TEST(Eds, AnEmptyTableIsStillAnEds) {
  const Parsed eds{describe::eds({})};
  EXPECT_THAT(eds.names, ElementsAre("FileInfo", "DeviceInfo", "DummyUsage", "Comments", "MandatoryObjects",
                                     "OptionalObjects", "ManufacturerObjects"));
  EXPECT_EQ(eds.value("DeviceInfo", "NrOfRXPDO"), "0");
}

}  // namespace
}  // namespace eds_test
}  // namespace servodrome::describe
