// The main program of the unit tests of a folder.
//
//   FOLDER_tests                         runs all tests, with the options of GoogleTest
//   FOLDER_tests --source=homing_test    runs only the tests that are written in homing_test.cpp
//   FOLDER_tests --list-sources          prints the names of the sources, one a line
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <set>
#include <string>
#include <string_view>

namespace {

void for_each_test(const std::function<void(const testing::TestInfo&)>& use) {
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  for (int i = 0; i < all.total_test_suite_count(); ++i) {
    const testing::TestSuite& suite = *all.GetTestSuite(i);
    for (int j = 0; j < suite.total_test_count(); ++j) use(*suite.GetTestInfo(j));
  }
}

std::string source_of(const testing::TestInfo& test) { return std::filesystem::path(test.file()).stem().string(); }

std::set<std::string> sources() {
  std::set<std::string> names;
  for_each_test([&](const testing::TestInfo& test) { names.insert(source_of(test)); });
  return names;
}

// A filter of GoogleTest that lets the tests of one source run; empty: it has none.
std::string filter_of(std::string_view source) {
  std::string filter;
  for_each_test([&](const testing::TestInfo& test) {
    if (source_of(test) != source) return;
    if (!filter.empty()) filter += ':';
    filter.append(test.test_suite_name()).append(".").append(test.name());
  });
  return filter;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleMock(&argc, argv);
  constexpr std::string_view source_option = "--source=";
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (argument == "--list-sources") {
      for (const std::string& name : sources()) std::puts(name.c_str());
      return 0;
    }
    if (!argument.starts_with(source_option)) {
      std::fprintf(stderr,
                   "%s: unknown argument %s; known are --source=NAME, --list-sources and the options of GoogleTest\n",
                   argv[0], argv[i]);
      return 2;
    }
    const std::string filter = filter_of(argument.substr(source_option.size()));
    if (filter.empty()) {
      std::fprintf(stderr, "%s: no tests from %s; --list-sources prints the sources\n", argv[0],
                   argv[i] + source_option.size());
      return 2;
    }
    GTEST_FLAG_SET(filter, filter);
  }
  return RUN_ALL_TESTS();
}
