#include "links/file_descriptor.hpp"

#include <array>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <thread>
#include <unistd.h>

#include "links/pty.hpp"

namespace servodrome::links {
namespace file_descriptor_test {
namespace {

using namespace std::chrono_literals;

TEST(FileDescriptor, BytesHaveArrivedUntilTheyAreRead) {
  const std::string path = testing::TempDir() + "file_descriptor_test";
  const Pty pty(path);
  EXPECT_FALSE(has_arrived(pty.master()));
  const FileDescriptor client(::open(path.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  ASSERT_TRUE(client.is_open());
  EXPECT_FALSE(has_arrived(pty.master()));
  ASSERT_EQ(::write(client.get(), "ab", 2), 2);
  const Deadline deadline = std::chrono::steady_clock::now() + 60s;  // a worker thread of the kernel delivers them
  while (!has_arrived(pty.master()) && std::chrono::steady_clock::now() < deadline) std::this_thread::sleep_for(1ms);
  EXPECT_TRUE(has_arrived(pty.master()));
  std::array<char, 1> byte{};
  ASSERT_EQ(read_some(pty.master(), byte.data(), 1), 1);
  EXPECT_TRUE(has_arrived(pty.master()));
  ASSERT_EQ(read_some(pty.master(), byte.data(), 1), 1);
  EXPECT_FALSE(has_arrived(pty.master()));
  EXPECT_FALSE(has_arrived(no_descriptor));
}

}  // namespace
}  // namespace file_descriptor_test
}  // namespace servodrome::links
