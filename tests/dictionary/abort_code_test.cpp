#include "dictionary/abort_code.hpp"

#include <array>
#include <cstdint>
#include <gtest/gtest.h>
#include <set>
#include <string>

namespace servodrome::dictionary {
namespace abort_code_test {
namespace {

// The numbers are from CiA 301, table 22, and from ETG.1000.6 for complete access; the texts have the meaning of the
// standard's.
TEST(AbortCodes, HaveTheStandardsNumbersAndWords) {
  struct Row {
    std::uint32_t code;
    const char* word;
  };
  std::set<std::string> texts;
  for (const auto& [code, word] : std::to_array<Row>({
           {0x00000000, "no error"},
           {0x05030000, "toggle"},
           {0x05040000, "timed out"},
           {0x05040001, "command specifier"},
           {0x05040002, "block size"},
           {0x05040003, "sequence number"},
           {0x05040004, "CRC"},
           {0x05040005, "memory"},
           {0x06010000, "unsupported access"},
           {0x06010001, "write-only"},
           {0x06010002, "read-only"},
           {0x06010003, "sub-index 0"},
           {0x06010004, "complete access"},
           {0x06020000, "object does not"},
           {0x06040041, "mapped to the PDO"},
           {0x06040042, "PDO length"},
           {0x06040043, "parameter"},
           {0x06040047, "internal"},
           {0x06060000, "hardware"},
           {0x06070010, "does not match"},
           {0x06070012, "too high"},
           {0x06070013, "too low"},
           {0x06090011, "sub-index"},
           {0x06090030, "invalid value"},
           {0x06090031, "value too high"},
           {0x06090032, "value too low"},
           {0x06090036, "less than minimum"},
           {0x060A0023, "resource"},
           {0x08000000, "general error"},
           {0x08000020, "transferred or stored"},
           {0x08000021, "local control"},
           {0x08000022, "device state"},
           {0x08000023, "dictionary"},
           {0x08000024, "no data"},
       })) {
    const char* said = text(AbortCode{code});
    ASSERT_NE(said, nullptr) << std::hex << code;
    EXPECT_NE(std::string(said).find(word), std::string::npos) << std::hex << code << " is \"" << said << '"';
    EXPECT_TRUE(texts.insert(said).second) << said << " is said of two codes";
  }
  EXPECT_STREQ(text(AbortCode{0x12345678}), "unknown abort code");
}

}  // namespace
}  // namespace abort_code_test
}  // namespace servodrome::dictionary
