// Invalid descriptions: each error message names the place and the reason, and no file ends the program.
#include <random>
#include <sstream>

#include "described_support.hpp"

namespace servodrome::described {
namespace described_bad_files_test {
namespace {

using namespace test;

std::string content_of(const std::string& name) { return describe::read_file(data_file(name)); }

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), with);
}

// Returns the error message; empty: the file was accepted.
std::string complaint_about_eds(const std::string& text) {
  try {
    std::istringstream stream(text);
    make_can_blueprint(describe::read_eds(stream, "x.eds"), text);
    return {};
  } catch (const describe::DeviceFileError& error) {
    EXPECT_FALSE(error.remedy().empty());
    return error.what();
  }
}
std::string complaint_about_esi(const std::string& text, const std::string& device = {}) {
  try {
    make_ethercat_blueprint(describe::read_esi(text, "x.xml", device));
    return {};
  } catch (const describe::DeviceFileError& error) {
    EXPECT_FALSE(error.remedy().empty());
    return error.what();
  }
}

TEST(BadDataSheet, SaysLineAndKey) {
  const std::string good = content_of("capital_access.eds");
  EXPECT_EQ(complaint_about_eds(good), "");
  const auto begins = [](const std::string& text, const std::string& with) {
    EXPECT_EQ(text.substr(0, with.size()), with) << text;
  };
  begins(complaint_about_eds(replaced(good, "[6041]\r\nParameterName=Statusword\r\nObjectType=7\r\nDataType=0x0006",
                                      "[6041]\r\nParameterName=Statusword\r\nObjectType=7\r\nDataType=zwei")),
         "x.eds:");
  EXPECT_NE(complaint_about_eds(replaced(good, "DataType=0x0006", "DataType=zwei"))
                .find("DataType: \"zwei\" is not a number"),
            std::string::npos);
  EXPECT_NE(complaint_about_eds(replaced(good, "AccessType=RW", "AccessType=sometimes")).find("AccessType"),
            std::string::npos);
  EXPECT_NE(complaint_about_eds(replaced(good, "[6040]", "[5040]")).find("not a CiA 402 drive"), std::string::npos);
  EXPECT_NE(complaint_about_eds("").find("no object is described"), std::string::npos);
  EXPECT_NE(complaint_about_eds("[1000\n").find("x.eds:1"), std::string::npos);
}

TEST(BadDataSheet, TwiceTheSameObjectIsNoted) {
  const std::string good = content_of("capital_access.eds");
  std::istringstream stream(good +
                            "\r\n[6081SUB0]\r\nParameterName=x\r\nDataType=7\r\n[60FF]\r\nParameterName=again\r\n");
  const auto blueprint = make_can_blueprint(describe::read_eds(stream, "x.eds"));
  EXPECT_FALSE(blueprint->device.notes.empty());
}

TEST(BadDataSheet, AsManyObjectsAsThereAreIndices) {
  std::string text;
  for (unsigned index = 0; index <= 0xFFFF; ++index) {
    text += fmt::format("[{:04X}]\nParameterName=p\nDataType=7\nAccessType=rw\n", index);
  }
  EXPECT_NE(complaint_about_eds(text).find("at most 32768"), std::string::npos);
}

// 40 bytes of a file can declare 254 entries, and one long name can be copied 254 times. Descriptions that are larger
// than any device are refused while they are read, before they take all the memory.
TEST(BadDataSheet, AShortFileThatDescribesMuchIsRefusedWhileItIsRead) {
  std::string compact;
  for (unsigned index = 0x2000; index < 0x9000; ++index) {
    compact += fmt::format("[{:04X}]\nObjectType=8\nDataType=5\nCompactSubObj=254\n", index);
  }
  std::string names;
  for (unsigned index = 0x2000; index < 0x2002; ++index) {
    names += fmt::format("[{:04X}]\nObjectType=8\nDataType=5\nCompactSubObj=254\nParameterName={}\n", index,
                         std::string(500'000, 'x'));
  }
  std::string keys = "[2000]\n";
  for (unsigned key = 0; key < 500'000; ++key) keys += fmt::format("{}=\n", key);
  const auto said = [](const std::string& text) -> std::string {
    try {
      std::istringstream stream(text);
      return fmt::format("{} entries", describe::read_eds(stream, "x.eds").entries.size());
    } catch (const describe::DeviceFileError& error) {
      return error.what();
    }
  };
  EXPECT_NE(said(compact).find("more than 65536 objects"), std::string::npos) << said(compact);
  EXPECT_NE(said(names).find("more than 32 MiB"), std::string::npos) << said(names);
  EXPECT_NE(said(keys).find("more than 400000 sections and keys"), std::string::npos) << said(keys);
  std::string lines = content_of("capital_access.eds");
  for (unsigned line = 0; line < 5000; ++line) lines += "x\n";
  std::istringstream stream(lines);
  EXPECT_LE(describe::read_eds(stream, "x.eds").notes.size(), 1001U + 100U);
}

// A file is accepted, or refused with an error message that begins with the file's name. No other result is allowed.
TEST(BadDataSheet, CutAndSpoiltFilesAreTakenOrRefused) {
  std::mt19937 random(402);
  int refused = 0;
  for (const char* name : {"mapping_counts.dcf", "capital_access.eds", "compact_arrays.eds"}) {
    const std::string good = content_of(name);
    for (int i = 0; i < 150; ++i) {
      std::string bad = good.substr(0, random() % good.size());
      for (unsigned n = random() % 8; n > 0 && !bad.empty(); --n) {
        bad[random() % bad.size()] = static_cast<char>(random() % 255 + 1);
      }
      const std::string complaint = complaint_about_eds(bad);
      refused += complaint.empty() ? 0 : 1;
      EXPECT_TRUE(complaint.empty() || complaint.starts_with("x.eds")) << complaint;
    }
    EXPECT_EQ(complaint_about_eds(good), "") << name;
  }
  EXPECT_GT(refused, 150) << "of 450";
  EXPECT_LT(refused, 450);
}

TEST(BadSlaveInformation, SaysLineAndElement) {
  const std::string good = content_of("dictionary_defaults.xml");
  EXPECT_EQ(complaint_about_esi(good), "");
  EXPECT_NE(complaint_about_esi(good.substr(0, good.size() / 2)).find("the XML cannot be read"), std::string::npos);
  EXPECT_NE(complaint_about_esi("<a/>").find("EtherCATInfo"), std::string::npos);
  EXPECT_NE(complaint_about_esi(good, "OTHER").find("there is no device \"OTHER\""), std::string::npos);
  EXPECT_NE(
      complaint_about_esi(replaced(good, "ProductCode=\"#x00000201\"", "ProductCode=\"#xyz\"")).find("ProductCode"),
      std::string::npos);
  EXPECT_NE(
      complaint_about_esi(replaced(good, "<DefaultData>92010200", "<DefaultData>9201020")).find("1000:00 DefaultData"),
      std::string::npos);
  for (const char* elements : {"2000", "9223372036854775807"}) {
    const std::string bad = replaced(good, "<Elements>2<", fmt::format("<Elements>{}<", elements));
    EXPECT_NE(complaint_about_esi(bad).find("ArrayInfo"), std::string::npos) << elements;
  }
}

// Every object of a type has a copy of all entries and names of the type.
TEST(BadSlaveInformation, AShortFileThatDescribesMuchIsRefusedWhileItIsRead) {
  const auto with_objects = [good = content_of("dictionary_defaults.xml")](const std::string& types, unsigned count,
                                                                           const std::string& type) {
    std::string objects;
    for (unsigned i = 0; i < count; ++i) {
      objects += fmt::format("<Object><Index>#x{:04X}</Index><Name>{}</Name><Type>{}</Type></Object>", 0x2000 + i,
                             type == "LONG" ? std::string(500'000, 'x') : "n", type);
    }
    return replaced(replaced(good, "</DataTypes>", types + "</DataTypes>"), "</Objects>", objects + "</Objects>");
  };
  const std::string array =
      "<DataType><Name>A</Name><BaseType>USINT</BaseType><BitSize>2032</BitSize>"
      "<ArrayInfo><LBound>1</LBound><Elements>254</Elements></ArrayInfo></DataType>";
  const std::string part = "<SubItem><Name>p</Name><Type>A</Type></SubItem>";
  const std::string of_one = array + "<DataType><Name>LONG</Name>" + part + "</DataType>" +
                             "<DataType><Name>ONE</Name>" + part + "</DataType>";
  const std::string of_two = array + "<DataType><Name>TWO</Name>" + part + part + "</DataType>";
  const std::string block = "<DataType><Name>BLOCK</Name><BitSize>8388608</BitSize></DataType>";
  EXPECT_EQ(complaint_about_esi(with_objects(of_one, 30, "ONE")), "");
  const auto expect = [&](const std::string& text, const char* words) {
    const std::string said = complaint_about_esi(text);
    EXPECT_NE(said.find(words), std::string::npos) << said;
  };
  expect(with_objects(of_two, 1, "TWO"), "more than 256 sub-indices");
  expect(with_objects(of_one, 300, "ONE"), "more than 65536 objects");
  expect(with_objects(of_one, 2, "LONG"), "more than 32 MiB");
  expect(with_objects(block, 17, "BLOCK"), "more than 16 MiB");
  const auto with_pdos = [good = content_of("dictionary_defaults.xml")](unsigned count) {
    std::string pdos;
    for (unsigned i = 0; i < count; ++i) pdos += fmt::format("<RxPdo Sm=\"2\"><Index>{}</Index></RxPdo>", 0x1610 + i);
    return replaced(good, "</Device>", pdos + "</Device>");
  };
  EXPECT_EQ(complaint_about_esi(with_pdos(200)), "");
  expect(with_pdos(300), "more than 254 PDOs");
}

TEST(BadSlaveInformation, CutAndSpoiltFilesAreTakenOrRefused) {
  std::mt19937 random(402);
  const std::string good = content_of("slots_and_modules.xml");
  EXPECT_EQ(complaint_about_esi(good), "");
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    std::string bad = i % 4 == 0 ? good.substr(0, random() % good.size()) : good;
    for (unsigned n = random() % 8; n > 0 && !bad.empty(); --n) {
      bad[random() % bad.size()] = static_cast<char>('0' + random() % 75);
    }
    const std::string complaint = complaint_about_esi(bad);
    refused += complaint.empty() ? 0 : 1;
    EXPECT_TRUE(complaint.empty() || complaint.starts_with("x.xml")) << complaint;
    EXPECT_TRUE(i % 4 != 0 || !complaint.empty()) << "XML that is cut off";
  }
  EXPECT_GE(refused, 75);
  EXPECT_LT(refused, 300);
}

TEST(LineFileOfDescriptions, ComplainsAtTheKey) {
  const auto diagnostics_of = [](const std::string& text) {
    return line::parse_line_file(text, "", line::all_products()).diagnostics;
  };
  const auto missing = diagnostics_of(line_text("no-such.eds", 4096));
  ASSERT_FALSE(missing.empty());
  EXPECT_EQ(missing.front().line, 7U);
  EXPECT_NE(missing.front().what.find("cannot be read"), std::string::npos);
  const auto both = diagnostics_of(line_text(data_file("capital_access.eds"), 4096, false, "product = \"ismc\""));
  ASSERT_FALSE(both.empty());
  EXPECT_NE(both.front().what.find("product"), std::string::npos);
}

}  // namespace
}  // namespace described_bad_files_test
}  // namespace servodrome::described
