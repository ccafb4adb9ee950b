// Texts that the TOML library cannot handle safely, as line files.
#include "line/toml_guard.hpp"

#include <filesystem>
#include <fstream>
#include <gmock/gmock.h>

#include "line/line_file.hpp"
#include "line/toml_text.hpp"

namespace servodrome::line {
namespace toml_guard_test {
namespace {

using testing::HasSubstr;

std::string what_of(const std::string& text) {
  const LineFile file = parse_line_file(text, "f.toml", all_products());
  return file.diagnostics.empty() ? std::string() : file.diagnostics.front().what;
}

// Also behind a byte order mark, and behind a string that ends with quotes.
TEST(TomlGuard, RefusesWhatTheLibraryCannotHandle) {
  for (const char* nameless : {"[\n", "[\r", "[[ \r\n", "[ \n]", "\xEF\xBB\xBF[=]", "a = [\"\"\"x\"\"\"\"]\n[=]",
                               "a = ['''x''''']\n[=]", "a = [\"\"\"\\\"\"\"\"]\n[=]"}) {
    EXPECT_EQ(what_of(nameless), "a table has no name") << nameless;
  }
  std::string key = "c";
  for (int i = 0; i < 400'000; ++i) key += ".c";
  EXPECT_EQ(what_of("a = {b = \"\"\"x\"\"\"\", " + key + " = 1}"), "a key has too many parts");
  EXPECT_THAT(what_of("a = [\"\"\"x\"\"\"\"\"]\nb = \"\"\"\"\"\"\nc = 1"), HasSubstr("unknown key"));  // it is TOML
}

TEST(TomlGuard, RefusesBracketsThatDoNotFit) {
  for (const char* text :
       {"a = [}", "a = }", "a = [1}", "a = {b = ]}", "a = {b = 1]", "a = [[1}]", "]", "[a]]", "[a}"}) {
    EXPECT_THAT(what_of(text), HasSubstr("closes no bracket")) << text;
  }
  EXPECT_THAT(what_of("a = [[1, {b = [2]}], [], {}]"), HasSubstr("unknown key"));
}

// Outside of strings and comments TOML has only ASCII. The library misjudges U+00A1 to U+0499 there.
TEST(TomlGuard, RefusesOtherLettersOutsideOfQuotes) {
  for (const char* foreign : {"\xC3\xA4 = 1", "a = 1 \xC6\x9E",
                              "\xC2\xA0"
                              "a = 1",
                              "[a\xD0\x96]", "a = [1, \xE2\x80\xA8 2]"}) {
    EXPECT_EQ(what_of(foreign), "there is a letter that is not ASCII") << foreign;
  }
  EXPECT_THAT(what_of("\"\xC3\xA4\" = '\xC6\x9E'  # \xD0\x96"), HasSubstr("unknown key"));
  // The library skips blanks behind a backslash, also those of the next lines.
  for (const char* escaped : {"a = \"\"\"\\\xEF\xBB\xBD\"\"\"", "a = \"\"\"b\\ \n  \xC3\xA4\"\"\""}) {
    EXPECT_EQ(what_of(escaped), "there is a letter that is not ASCII") << escaped;
  }
  EXPECT_THAT(what_of("a = \"\"\"\xC3\xA4\\\n  b\xC3\xA4\"\"\""), HasSubstr("unknown key"));
  // The library looks for the end of such a value also within its quotes.
  for (const char* word :
       {"t = 0'l\xCE\xB0'", "t = 1=\"\xCE\xB0\"", "t = [1, 2{a=\"\xCE\xB0\"}]", "t = 1.'\xCE\xB0'"}) {
    EXPECT_EQ(what_of(word), "a quote stands within a word") << word;
  }
  EXPECT_THAT(what_of("a.\"\xCE\xB0\" = [1, '\xCE\xB0', {\"\xCE\xB0\" = 1, b.'\xCE\xB0' = 2}]\n['\xCE\xB0'.b]"),
              HasSubstr("unknown key"));
}

TEST(TomlFile, HasAtMostOneMebibyte) {
  constexpr std::size_t most = std::size_t{1} << 20;
  const std::string path = testing::TempDir() + "toml_guard_test.toml";
  for (const std::size_t size : {std::size_t{0}, most, most + 1}) {
    std::ofstream(path, std::ios::binary) << std::string(size, '#');
    std::vector<Diagnostic> diagnostics;
    const auto text = read_text_file(path, "a line file", diagnostics);
    EXPECT_EQ(text.has_value(), size <= most);
    EXPECT_EQ(text.value_or("").size(), size <= most ? size : 0U);
    EXPECT_EQ(diagnostics.size(), size <= most ? 0U : 1U);
  }
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace toml_guard_test
}  // namespace servodrome::line
