#include "links/file_medium.hpp"

#include <array>
#include <filesystem>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdexcept>
#include <string>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

#include "dictionary/store.hpp"
#include "dictionary/table.hpp"

namespace servodrome::links {
namespace file_medium_test {
namespace {

namespace fs = std::filesystem;

struct FileMediumTest : testing::Test {
  FileMediumTest() {
    std::string pattern = (fs::temp_directory_path() / "file_medium_XXXXXX").string();
    folder = ::mkdtemp(pattern.data());
    path = (folder / "drive.bin").string();
  }
  ~FileMediumTest() override { fs::remove_all(folder); }
  FileMediumTest(const FileMediumTest&) = delete;
  FileMediumTest& operator=(const FileMediumTest&) = delete;

  // Returns the error of opening the file, or "" if there is none.
  static std::string complaint(const std::string& file, std::uint32_t size) {
    try {
      const FileMedium medium(file, size);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  fs::path folder;
  std::string path;
};

TEST_F(FileMediumTest, IsCreatedEmptyAndForItsUserOnly) {
  FileMedium medium(path, 4096);
  EXPECT_EQ(medium.size(), 4096U);
  EXPECT_EQ(fs::file_size(path), 4096U);
  struct stat status {};
  ASSERT_EQ(::stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  std::vector<std::byte> bytes(4096, std::byte{1});
  ASSERT_TRUE(medium.read(0, bytes));
  EXPECT_THAT(bytes, testing::Each(std::byte{0}));
}

TEST_F(FileMediumTest, KeepsWhatWasWritten) {
  constexpr std::array value{std::byte{1}, std::byte{2}, std::byte{3}};
  {
    FileMedium medium(path, 64);
    ASSERT_TRUE(medium.write(61, value));
    ASSERT_TRUE(medium.flush());
  }
  FileMedium medium(path, 64);
  std::array<std::byte, 4> bytes{};
  ASSERT_TRUE(medium.read(60, bytes));
  EXPECT_THAT(bytes, testing::ElementsAre(std::byte{0}, std::byte{1}, std::byte{2}, std::byte{3}));
  EXPECT_EQ(fs::file_size(path), 64U);
}

TEST_F(FileMediumTest, AStoreInAFileSurvivesTheProcess) {
  struct Objects {
    std::int32_t position;
  };
  constexpr std::array table{dictionary::var(0x2000, "Position", SERVODROME_FIELD(Objects, position),
                                             dictionary::Access::rw, dictionary::Pdo::none, {.saved = true})};
  Objects objects{-123456};
  dictionary::Dictionary values(table, std::as_writable_bytes(std::span(&objects, 1)));
  {
    FileMedium medium(path, 256);
    EXPECT_EQ(dictionary::Store(medium).load(values, dictionary::Area::all), dictionary::Store::Loaded::nothing);
    ASSERT_EQ(dictionary::Store(medium).save(values, dictionary::Area::all), dictionary::AbortCode::none);
  }
  objects.position = 0;
  FileMedium medium(path, 256);
  ASSERT_EQ(dictionary::Store(medium).load(values, dictionary::Area::all), dictionary::Store::Loaded::values);
  EXPECT_EQ(objects.position, -123456);
}

TEST_F(FileMediumTest, TwoUsersOfOneFileAreRefused) {
  const FileMedium medium(path, 64);
  EXPECT_THAT(complaint(path, 64), testing::AllOf(testing::HasSubstr(path), testing::HasSubstr("in use")));
}

TEST_F(FileMediumTest, AnotherSizeIsAnotherDevice) {
  EXPECT_EQ(complaint(path, 64), "");
  EXPECT_THAT(complaint(path, 128), testing::AllOf(testing::HasSubstr("64 bytes"), testing::HasSubstr("128")));
  EXPECT_EQ(fs::file_size(path), 64U);
}

TEST_F(FileMediumTest, ErrorsNameTheFileAndTheReason) {
  EXPECT_THAT(complaint((folder / "missing" / "drive.bin").string(), 64), testing::HasSubstr("No such file"));
  EXPECT_THAT(complaint(folder.string(), 64), testing::HasSubstr(folder.string() + ": cannot open: Is a directory"));
  EXPECT_THAT(complaint("/dev/null", 64), testing::HasSubstr("/dev/null: is not a regular file"));
  const std::string pipe = (folder / "pipe").string();
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(complaint(pipe, 64), testing::HasSubstr("not a regular file"));
}

TEST_F(FileMediumTest, AFileThatShrankDoesNotAnswer) {
  FileMedium medium(path, 64);
  fs::resize_file(path, 10);
  std::array<std::byte, 8> bytes{};
  EXPECT_TRUE(medium.read(0, bytes));
  EXPECT_FALSE(medium.read(8, bytes));
}

// Data written to a file without a name would be lost at the end of the process.
TEST_F(FileMediumTest, AFileThatIsNoMoreThereDoesNotAnswer) {
  std::array<std::byte, 8> bytes{};
  const auto expect_answers = [&](FileMedium& medium, bool answers) {
    EXPECT_EQ(medium.read(0, bytes), answers);
    EXPECT_EQ(medium.write(0, bytes), answers);
    EXPECT_EQ(medium.flush(), answers);
  };
  FileMedium medium(path, 64);
  expect_answers(medium, true);
  fs::rename(path, path + ".moved");
  expect_answers(medium, false);
  std::ofstream(path) << std::string(64, 'x');  // another file with that name
  expect_answers(medium, false);
  fs::remove(path);
  expect_answers(medium, false);
  fs::rename(path + ".moved", path);
  expect_answers(medium, true);
}

}  // namespace
}  // namespace file_medium_test
}  // namespace servodrome::links
