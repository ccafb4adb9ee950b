#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "describe/sample.hpp"
#include "ethercat/slave/communication_section.hpp"

// Cases that tests/interop/esi_test.py cannot find in the products: entries of every kind, names that need escaping,
// start-up parameters, bootstrap. Checks the structure and the agreement with the SII image.
namespace servodrome::describe {
namespace esi_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Parses an XML document of elements, attributes and text; fails on text that is not well-formed.
struct Element {
  std::string name;
  std::map<std::string, std::string> attributes;
  std::string text;
  std::vector<std::unique_ptr<Element>> children;

  // Returns the first element on this path of names; an empty element if there is none.
  const Element& at(std::initializer_list<const char*> path) const {
    static const Element nothing;
    const Element* here = this;
    for (const char* step : path) {
      const auto found = std::find_if(here->children.begin(), here->children.end(),
                                      [step](const auto& child) { return child->name == step; });
      if (found == here->children.end()) return nothing;
      here = found->get();
    }
    return *here;
  }
  std::vector<const Element*> all(const char* child_name) const {
    std::vector<const Element*> found;
    for (const auto& child : children) {
      if (child->name == child_name) found.push_back(child.get());
    }
    return found;
  }
  // Returns the child whose element `key` has the text `value`.
  const Element& with(const char* key, const std::string& value) const {
    static const Element nothing;
    for (const auto& child : children) {
      if (child->at({key}).text == value) return *child;
    }
    return nothing;
  }
};

class Parser {
 public:
  explicit Parser(const std::string& document) : text_(document) {
    expect("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    root_ = element();
    skip_space();
    EXPECT_EQ(at_, text_.size());
  }
  const Element& root() const { return *root_; }

 private:
  void skip_space() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
  }
  void expect(const std::string& word) {
    EXPECT_EQ(text_.substr(at_, word.size()), word) << at_;
    at_ += word.size();
  }
  std::string until(const char* ends) {
    const std::size_t end = std::min(text_.find_first_of(ends, at_), text_.size());
    std::string found = text_.substr(at_, end - at_);
    at_ = end;
    return found;
  }
  static std::string unescaped(std::string text) {
    for (const auto& [escaped, plain] : {std::pair{"&lt;", "<"}, {"&gt;", ">"}, {"&quot;", "\""}, {"&amp;", "&"}}) {
      for (std::size_t i = 0; (i = text.find(escaped, i)) != std::string::npos; ++i) {
        text.replace(i, std::string(escaped).size(), plain);
      }
    }
    return text;
  }
  std::unique_ptr<Element> element() {
    auto one = std::make_unique<Element>();
    skip_space();
    expect("<");
    one->name = until(" />");
    while (text_.at(at_) == ' ') {
      ++at_;
      const std::string key = until("=");
      expect("=\"");
      one->attributes[key] = unescaped(until("\"<"));
      expect("\"");
    }
    if (text_.at(at_) == '/') {
      expect("/>");
      return one;
    }
    expect(">");
    one->text = unescaped(until("<"));
    while (text_.substr(at_, 2) != "</" && !testing::Test::HasFailure()) {
      one->children.push_back(element());
      skip_space();
    }
    expect("</" + one->name + ">");
    return one;
  }

  const std::string& text_;
  std::size_t at_ = 0;
  std::unique_ptr<Element> root_;
};

using Communication = ethercat::CommunicationObjects<2, 2, 4, 2>;
struct Objects {
  Communication communication;
  sample::Objects sample;
  std::array<std::int16_t, 3> points;
  std::array<std::uint8_t, 3> words;
  std::array<bool, 3> bits;
};

constexpr auto table = dictionary::make_table<[] {
  using namespace dictionary;  // NOLINT: the vocabulary of the table
  TableBuilder<200> builder;
  builder.append(ethercat::communication_section<Communication>, offsetof(Objects, communication));
  for (const Entry& entry : sample::table) {
    if (entry.index >= 0x2000) builder.add(entry, offsetof(Objects, sample));
  }
  builder.add(text_constant(0x1008, "Manufacturer device name", "<Sample> & \"drive\""));
  builder.add(highest_sub(0x2010, ObjectCode::array, "Points", 3));
  builder.add(highest_sub(0x2011, ObjectCode::record, "Same names", 3));
  builder.add(highest_sub(0x2012, ObjectCode::record, "Bits", 4));
  for (std::uint8_t sub = 1; sub <= 3; ++sub) {
    builder.add(element(0x2010, sub, ObjectCode::array, "Point",
                        field_at<std::int16_t>(offsetof(Objects, points) + 2U * (sub - 1U)), Access::rw, Pdo::none,
                        {.default_value = -sub, .minimum = -10, .maximum = 10, .unit = "ms", .saved = true}));
    builder.add(element(0x2011, sub, ObjectCode::record, "Word",
                        field_at<std::uint8_t>(offsetof(Objects, words) + sub - 1U), Access::rw));
    builder.add(element(0x2012, sub, ObjectCode::record, "Bit", field_at<bool>(offsetof(Objects, bits) + sub - 1U),
                        Access::ro));
  }
  builder.add(number_constant(0x2012, 4, ObjectCode::record, "After the bits", Type::unsigned16, 7));
  builder.set_default(0x1000, 0, 0x00020192).set_default(0x1018, 1, 0x1234);
  builder.set_default(0x1600, 0, 3).set_default(0x1600, 1, 0x60400010).set_default(0x1600, 2, 0x00000008);
  builder.set_default(0x1600, 3, 0x60600008).set_default(0x1C12, 0, 1).set_default(0x1C12, 1, 0x1600);
  builder.set_default(0x1A00, 0, 1).set_default(0x1A00, 1, 0x60410010);
  return builder;
}>();
static_assert(dictionary::is_valid_table(table));

constexpr ethercat::StartUpParameter start_up[] = {{"PS", 0x6060, 0, 8, "cyclic synchronous position"},
                                                   {"SO", 0x2010, 2, -3, "second < point"}};
constexpr ethercat::Profile profile{.mailbox_out = {0x1000, 34, 128},
                                    .mailbox_in = {0x1080, 34, 192},
                                    .bootstrap = true,
                                    .bootstrap_out = {0x1000, 64, 1024},
                                    .bootstrap_in = {0x1400, 64, 512},
                                    .file_access = true,
                                    .complete_access = false,
                                    .start_up = start_up};
constexpr ethercat::DcMode clock_modes[] = {{"DC", "with SYNC0", 0, 250'000, 0, 1, 0x0300, 1},
                                            {"Both", "", 0, 0, 1000, -2, 0x0700, 2}};

class Esi : public testing::Test {
 protected:
  static Description device() {
    Description description = sample::description();
    description.vendor_name = "Drives & Co";
    description.url = "https://example.org/?a=1&b=2";
    description.table = table;
    description.ethercat = EthercatDescription{&profile,
                                               {.vendor_id = 0x1234,
                                                .product_code = 0xABCD,
                                                .revision_number = 3,
                                                .station_alias = 0x0102,
                                                .group = "Servo drives",
                                                .order = "S-1",
                                                .name = "Sample <EtherCAT>",
                                                .current_ma = -150,
                                                .dc_modes = clock_modes},
                                               2048};
    return description;
  }

  const Element& type(const std::string& name) const {
    return profile_.at({"Dictionary", "DataTypes"}).with("Name", name);
  }
  const Element& object(const std::string& index) const {
    return profile_.at({"Dictionary", "Objects"}).with("Index", index);
  }
  // The values of a sub-item.
  const Element& values(const std::string& index, const std::string& item) const {
    return object(index).at({"Info"}).with("Name", item).at({"Info"});
  }

  std::string text_ = esi(device());
  Parser parser_{text_};
  const Element& device_ = parser_.root().at({"Descriptions", "Devices", "Device"});
  const Element& profile_ = device_.at({"Profile"});
};

TEST_F(Esi, VendorGroupAndDevice) {
  EXPECT_EQ(parser_.root().at({"Vendor", "Id"}).text, "#x00001234");
  EXPECT_EQ(parser_.root().at({"Vendor", "Name"}).text, "Drives & Co");
  EXPECT_EQ(parser_.root().at({"Descriptions", "Groups", "Group", "Type"}).text, "Servo drives");
  EXPECT_EQ(device_.at({"GroupType"}).text, "Servo drives");
  EXPECT_EQ(device_.at({"Type"}).text, "S-1");
  EXPECT_EQ(device_.at({"Type"}).attributes.at("ProductCode"), "#x0000ABCD");
  EXPECT_EQ(device_.at({"Type"}).attributes.at("RevisionNo"), "#x00000003");
  EXPECT_EQ(device_.at({"Name"}).text, "Sample <EtherCAT>");
  EXPECT_EQ(device_.at({"Comment"}).text, "A sample with \xC2\xB5");  // one line
  EXPECT_EQ(device_.at({"URL"}).text, "https://example.org/?a=1&b=2");
  EXPECT_EQ(device_.at({"Info", "Electrical", "EBusCurrent"}).text, "-150");
  EXPECT_EQ(profile_.at({"ProfileNo"}).text, "402");
  EXPECT_EQ(profile_.at({"AddInfo"}).text, "2");
}

TEST_F(Esi, ValuesOfEveryType) {
  EXPECT_EQ(object("#x2000").at({"Info", "DefaultValue"}).text, "1");
  EXPECT_EQ(object("#x2000").at({"BitSize"}).text, "1");
  EXPECT_EQ(object("#x2001").at({"Type"}).text, "REAL");
  EXPECT_EQ(object("#x2001").at({"Info", "DefaultData"}).text, "CDCCCC3D");  // 0.1f, little endian
  EXPECT_EQ(object("#x2001").at({"Info", "Unit"}).text, "#x00000300");       // 1/s
  EXPECT_EQ(object("#x2002").at({"Type"}).text, "STRING(16)");
  EXPECT_EQ(object("#x2002").at({"BitSize"}).text, "128");
  EXPECT_EQ(object("#x2003").at({"Type"}).text, "ARRAY [0..15] OF BYTE");
  EXPECT_EQ(object("#x2003").at({"Flags", "Access"}).text, "wo");
  EXPECT_EQ(object("#x1008").at({"Info", "DefaultString"}).text, "<Sample> & \"drive\"");
  EXPECT_EQ(values("#x2005", "Serial").at({"DefaultValue"}).text, "18446744073709551615");
  EXPECT_EQ(values("#x2005", "Offset").at({"DefaultValue"}).text, "-5000000000");
  EXPECT_EQ(values("#x2005", "Offset").at({"MinValue"}).text, "-4611686018427387904");
  EXPECT_EQ(object("#x2005").at({"Name"}).text, "Long numbers | <wide>");
  EXPECT_EQ(object("#x6060").at({"Info", "MinValue"}).text, "-3");
  EXPECT_EQ(object("#x6060").at({"Info", "MaxValue"}).text, "10");
  EXPECT_EQ(object("#x6060").at({"Flags", "PdoMapping"}).text, "RT");
  EXPECT_EQ(object("#x6041").at({"Flags", "PdoMapping"}).text, "T");
  EXPECT_EQ(object("#x6041").at({"Flags", "Category"}).text, "m");
  EXPECT_EQ(object("#x2001").at({"Flags", "Backup"}).text, "1");
  EXPECT_EQ(object("#x1000").at({"Info", "DefaultValue"}).text, "#x00020192");
}

TEST_F(Esi, AnArrayIsDescribedOnce) {
  const Element& elements = type("DT2010ARR");
  EXPECT_EQ(elements.at({"BaseType"}).text, "INT");
  EXPECT_EQ(elements.at({"BitSize"}).text, "48");
  EXPECT_EQ(elements.at({"ArrayInfo", "LBound"}).text, "1");
  EXPECT_EQ(elements.at({"ArrayInfo", "Elements"}).text, "3");
  const auto items = type("DT2010").all("SubItem");
  ASSERT_EQ(items.size(), 2U);
  EXPECT_EQ(items[0]->at({"Type"}).text, "USINT");
  EXPECT_EQ(items[1]->at({"Name"}).text, "Elements");
  EXPECT_EQ(items[1]->at({"Type"}).text, "DT2010ARR");
  EXPECT_EQ(items[1]->at({"BitOffs"}).text, "16");
  EXPECT_EQ(items[1]->at({"Flags", "Backup"}).text, "1");
  EXPECT_EQ(object("#x2010").at({"BitSize"}).text, "64");
  const Element& second = values("#x2010", "SubIndex 002");
  EXPECT_EQ(second.at({"DefaultValue"}).text, "-2");
  EXPECT_EQ(second.at({"DisplayName"}).text, "Point");
  EXPECT_EQ(second.at({"Unit"}).text, "#xFD030000");
}

TEST_F(Esi, NamesOfARecordDiffer) {
  std::vector<std::string> names;
  for (const Element* item : type("DT2011").all("SubItem")) names.push_back(item->at({"Name"}).text);
  EXPECT_THAT(names, ElementsAre("SubIndex 000", "Word", "Word (SubIndex 002)", "Word (SubIndex 003)"));
  EXPECT_EQ(values("#x2011", "Word (SubIndex 003)").at({"DisplayName"}).text, "Word");
}

TEST_F(Esi, BitsAreWhereCompleteAccessHasThem) {
  std::vector<std::string> offsets;
  for (const Element* item : type("DT2012").all("SubItem")) offsets.push_back(item->at({"BitOffs"}).text);
  EXPECT_THAT(offsets, ElementsAre("0", "16", "17", "18", "24"));
  EXPECT_EQ(type("DT2012").at({"BitSize"}).text, "40");
}

TEST_F(Esi, WhatIsWrittenInPreOperationalOnly) {
  const auto items = type("DT1600").all("SubItem");
  EXPECT_EQ(items[1]->at({"Flags", "Access"}).attributes.at("WriteRestrictions"), "PreOP");
  EXPECT_EQ(object("#x2000").at({"Flags", "Access"}).attributes.count("WriteRestrictions"), 0U);
}

TEST_F(Esi, SyncManagersAndProcessData) {
  const auto channels = device_.all("Sm");
  ASSERT_EQ(channels.size(), 4U);
  EXPECT_EQ(channels[1]->text, "MBoxIn");
  EXPECT_EQ(channels[1]->attributes.at("StartAddress"), "#x1080");
  EXPECT_EQ(channels[1]->attributes.at("MinSize"), "34");
  EXPECT_EQ(channels[1]->attributes.at("DefaultSize"), "192");
  EXPECT_EQ(channels[2]->attributes.at("DefaultSize"), "4");
  EXPECT_EQ(channels[2]->attributes.at("Enable"), "1");
  EXPECT_EQ(channels[3]->attributes.at("Enable"), "0");  // no TxPDO is assigned
  const auto pdos = device_.all("RxPdo");
  ASSERT_EQ(pdos.size(), 2U);
  EXPECT_EQ(pdos[0]->attributes.at("Sm"), "2");
  EXPECT_EQ(pdos[1]->attributes.count("Sm"), 0U);
  const auto entries = pdos[0]->all("Entry");
  ASSERT_EQ(entries.size(), 3U);
  EXPECT_EQ(entries[0]->at({"DataType"}).text, "UINT");
  EXPECT_EQ(entries[1]->at({"Index"}).text, "#x0000");
  EXPECT_EQ(entries[1]->at({"BitLen"}).text, "8");
  EXPECT_TRUE(entries[1]->all("Name").empty());
  EXPECT_EQ(entries[2]->at({"Name"}).text, "Modes of operation");
}

TEST_F(Esi, MailboxAndStartUp) {
  const Element& coe = device_.at({"Mailbox", "CoE"});
  EXPECT_EQ(coe.attributes.at("CompleteAccess"), "0");
  EXPECT_EQ(device_.at({"Mailbox"}).all("FoE").size(), 1U);
  const auto commands = coe.all("InitCmd");
  ASSERT_EQ(commands.size(), 2U);
  EXPECT_EQ(commands[0]->at({"Transition"}).text, "PS");
  EXPECT_EQ(commands[0]->at({"Index"}).text, "#x6060");
  EXPECT_EQ(commands[0]->at({"Data"}).text, "08");
  EXPECT_EQ(commands[1]->at({"SubIndex"}).text, "2");
  EXPECT_EQ(commands[1]->at({"Data"}).text, "FDFF");
  EXPECT_EQ(commands[1]->at({"Comment"}).text, "second < point");
  EXPECT_EQ(object("#x6060").at({"Flags", "Setting"}).text, "1");
  EXPECT_EQ(object("#x6040").at({"Flags"}).all("Setting").size(), 0U);
}

TEST_F(Esi, ClockAndMemory) {
  const auto modes = device_.at({"Dc"}).all("OpMode");
  ASSERT_EQ(modes.size(), 2U);
  EXPECT_EQ(modes[0]->at({"AssignActivate"}).text, "#x0300");
  EXPECT_EQ(modes[0]->at({"ShiftTimeSync0"}).text, "250000");
  EXPECT_EQ(modes[1]->at({"CycleTimeSync0"}).attributes.at("Factor"), "2");
  EXPECT_EQ(modes[1]->at({"CycleTimeSync1"}).attributes.at("Factor"), "-2");
  EXPECT_EQ(modes[1]->at({"ShiftTimeSync1"}).text, "1000");
  EXPECT_EQ(device_.at({"Eeprom", "ByteSize"}).text, "2048");
  EXPECT_EQ(device_.at({"Eeprom", "ConfigData"}).text,
            "080E0000000000000201"
            "00000000");
  EXPECT_EQ(device_.at({"Eeprom", "BootStrap"}).text, "0010000400140002");
}

TEST_F(Esi, EachModelWithACodeOfItsOwnIsADevice) {
  Description description = device();
  ethercat::SiiDescription big = description.ethercat->sii;
  big.product_code = 0xABCE;
  big.name = "Big sample";
  description.ethercat->other_models = {big};
  const std::string text = esi(description);
  const Parser parser(text);
  const auto devices = parser.root().at({"Descriptions", "Devices"}).all("Device");
  ASSERT_EQ(devices.size(), 2U);
  EXPECT_EQ(devices[0]->at({"Name"}).text, "Sample <EtherCAT>");
  EXPECT_EQ(devices[1]->at({"Name"}).text, "Big sample");
  EXPECT_EQ(devices[1]->at({"Type"}).attributes.at("ProductCode"), "#x0000ABCE");
  const Element& code = devices[1]
                            ->at({"Profile", "Dictionary", "Objects"})
                            .with("Index", "#x1018")
                            .at({"Info"})
                            .with("Name", "Product code")
                            .at({"Info", "DefaultValue"});
  EXPECT_EQ(code.text, "#x0000ABCE");
}

TEST_F(Esi, TheMemoryIsThatOfTheSlave) {
  std::vector<std::uint8_t> image(2048);
  ASSERT_GT(ethercat::write_sii_image(device().ethercat->sii, profile, table, image), 0U);
  EXPECT_EQ(sii(device()), image);
}

TEST_F(Esi, ADeviceWithoutEthercatHasNone) {
  EXPECT_TRUE(esi(sample::description()).empty());
  EXPECT_TRUE(sii(sample::description()).empty());
}

}  // namespace
}  // namespace esi_test
}  // namespace servodrome::describe
