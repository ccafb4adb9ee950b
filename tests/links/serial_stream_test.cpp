// A pty and a tty whose bytes another thread reads: nothing is lost, mixed up or left for the next program.
#include "links/serial_stream.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <optional>
#include <random>
#include <termios.h>
#include <thread>
#include <unistd.h>

#include "links/can_rig.hpp"
#include "links/pty.hpp"

namespace servodrome::links {
namespace serial_stream_test {
namespace {

using test::RawClient;

struct Owner final : SerialStream::Owner {
  void on_open() override { ++opened; }
  void on_bytes(std::string_view bytes) override {
    EXPECT_FALSE(bytes.empty());
    EXPECT_LE(bytes.size(), asked);
    asked = 0;
    received += bytes;
  }
  void on_written() override { ++written; }
  void on_close() override {
    asked = 0;
    ++closed;
  }

  unsigned opened = 0;
  unsigned closed = 0;
  unsigned written = 0;
  std::size_t asked = 0;
  std::string received;
};

struct SerialStreamTest : testing::Test {
  RawClient open_client() const {
    return RawClient(FileDescriptor(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)));
  }
  void read(std::size_t most = SerialStream::most_at_once) {
    if (owner.asked != 0 || !stream->is_open()) return;
    stream->read(owner.asked = most);
  }
  bool until(const std::function<bool()>& condition) { return test::run_until(io, condition); }

  std::string path = testing::TempDir() + fmt::format("servodrome_stream_{}", ::getpid());
  boost::asio::io_context io;
  Owner owner;
  std::unique_ptr<SerialStream> stream = open_adapter_stream(path, io, owner);
};

std::string random_bytes(std::mt19937& draw, std::size_t size) {
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(draw());
  return bytes;
}

TEST_F(SerialStreamTest, ProgramsComeAndGo) {
  std::mt19937 draw(1);
  for (unsigned round = 1; round <= 40; ++round) {
    owner.received.clear();
    RawClient client = open_client();
    std::string sent;
    std::string answered;
    for (unsigned act = draw() % 8; act > 0; --act) {
      const std::string bytes = random_bytes(draw, 1 + draw() % 600);
      if (draw() % 2 == 0) {
        client.write(bytes);
        sent += bytes;
        read(1 + draw() % SerialStream::most_at_once);
      } else if (until([&] { return stream->is_open(); })) {
        stream->write(bytes);
        answered += bytes;
      }
    }
    if (draw() % 2 == 0) {
      ASSERT_TRUE(until([&] { return client.text().size() >= answered.size(); })) << round;
      EXPECT_EQ(client.text(), answered) << "a program gets only what was written for it";
    }
    if (sent.empty()) {  // a visit without bytes may be too short to be noticed
      ASSERT_TRUE(until([&] { return owner.opened == round; }));
    }
    client.close();
    ASSERT_TRUE(until([&] {
      read();
      return owner.closed == round;
    }));
    EXPECT_EQ(owner.opened, round);
    EXPECT_EQ(owner.received, sent);
    EXPECT_EQ(stream->unwritten(), 0U);
  }
}

// The program is slowed down while nothing is read, and loses nothing.
TEST_F(SerialStreamTest, ReadsOnlyWhenAsked) {
  std::mt19937 draw(2);
  const RawClient client = open_client();
  ASSERT_TRUE(until([&] { return owner.opened == 1; }));
  EXPECT_TRUE(stream->settled()) << "without a pending read() bytes do not count";
  const std::string sent = random_bytes(draw, 200'000);
  std::size_t accepted = 0;
  const auto send = [&] {
    const ssize_t size = ::write(client.descriptor(), sent.data() + accepted, sent.size() - accepted);
    if (size > 0) accepted += static_cast<std::size_t>(size);
    return size > 0;
  };
  while (send()) continue;
  EXPECT_LT(accepted, sent.size());
  io.poll();
  EXPECT_EQ(owner.received, "");
  ASSERT_TRUE(until([&] {
    if (accepted < sent.size()) send();
    read(draw() % 100 + 1);
    return owner.received.size() == sent.size();
  }));
  EXPECT_EQ(owner.received, sent);
}

TEST_F(SerialStreamTest, WaitsForAProgramThatDoesNotRead) {
  std::mt19937 draw(3);
  const RawClient client = open_client();
  ASSERT_TRUE(until([&] { return owner.opened == 1; }));
  const std::string answer = random_bytes(draw, 200'000);
  stream->write(answer.substr(0, 1));
  stream->write(answer.substr(1));
  ASSERT_TRUE(until([&] { return stream->unwritten() < answer.size() - 1; }));
  EXPECT_GT(stream->unwritten(), 0U);
  EXPECT_EQ(owner.written, 0U);
  ASSERT_TRUE(until([&] { return client.text().size() == answer.size(); }));
  EXPECT_EQ(client.text(), answer);
  ASSERT_TRUE(until([&] { return owner.written > 0; }));
  EXPECT_EQ(stream->unwritten(), 0U);
}

// A program that never reads and ends, while the owner does not read either: the owner gets what it has written, and
// the next program gets nothing.
TEST_F(SerialStreamTest, ProgramThatNeverReadsLeavesNothing) {
  std::mt19937 draw(5);
  RawClient client = open_client();
  ASSERT_TRUE(until([&] { return owner.opened == 1; }));
  stream->write(random_bytes(draw, 200'000));
  client.write("commands");
  EXPECT_GT(stream->unwritten(), 0U);
  client.close();
  ASSERT_TRUE(until([&] { return stream->unwritten() == 0 && owner.written > 0; }));
  stream->write("for a program that is gone");
  EXPECT_EQ(stream->unwritten(), 0U);
  EXPECT_TRUE(stream->is_open()) << "its bytes are not read yet";
  ASSERT_TRUE(until([&] {
    read(3);
    return owner.closed == 1;
  }));
  EXPECT_EQ(owner.received, "commands");
  const RawClient next = open_client();
  ASSERT_TRUE(until([&] { return owner.opened == 2; }));
  stream->write("1");
  ASSERT_TRUE(until([&] { return !next.text().empty(); }));
  EXPECT_EQ(next.text(), "1");
}

// The next program may open the pty before the end of the last one is noticed, and while nothing is read.
TEST_F(SerialStreamTest, BytesOfProgramsStayInOrder) {
  std::string sent;
  for (unsigned round = 0; round < 60; ++round) {
    for (unsigned program = 0; program < 40; ++program) {
      const RawClient client = open_client();
      sent += static_cast<char>('0' + program);
      client.write({&sent.back(), 1});
      const bool is_seen = program > 0 || until([&] { return owner.opened > owner.closed; });
      ASSERT_TRUE(is_seen);
    }
    ASSERT_TRUE(until([&] {
      read(1 + round % 3);
      return owner.received.size() == sent.size();
    })) << round;
    ASSERT_EQ(owner.received, sent) << round;
  }
}

// What a program has set is taken back when it ends; what the next one sets is left alone.
TEST_F(SerialStreamTest, SettingsAreOfOneProgram) {
  RawClient client = open_client();
  ASSERT_TRUE(until([&] { return owner.opened == 1; }));
  termios raw{};
  ASSERT_EQ(::tcgetattr(client.descriptor(), &raw), 0);
  EXPECT_EQ(raw.c_lflag & (ICANON | ECHO), 0U);
  termios cooked = raw;
  cooked.c_lflag |= ICANON | ECHO;
  ASSERT_EQ(::tcsetattr(client.descriptor(), TCSANOW, &cooked), 0);
  ASSERT_EQ(::tcflow(client.descriptor(), TCOOFF), 0);
  read();
  client.close();
  ASSERT_TRUE(until([&] { return owner.closed == 1; }));
  const RawClient next = open_client();
  termios settings{};
  ASSERT_EQ(::tcgetattr(next.descriptor(), &settings), 0);
  EXPECT_EQ(settings.c_lflag, raw.c_lflag);
  settings.c_cc[VMIN] = 0;
  ASSERT_EQ(::tcsetattr(next.descriptor(), TCSANOW, &settings), 0);
  next.write("x");
  ASSERT_TRUE(until([&] {
    read();
    return owner.received == "x";
  })) << "output is not stopped";
  ASSERT_EQ(::tcgetattr(next.descriptor(), &settings), 0);
  EXPECT_EQ(settings.c_cc[VMIN], 0);
}

// After settled() was true twice, with the handlers in between, all bytes that were written before have arrived.
TEST_F(SerialStreamTest, IsSettledWhenAllBytesHaveArrived) {
  std::mt19937 draw(4);
  RawClient client = open_client();
  EXPECT_FALSE(stream->settled()) << "the program is not noticed yet";
  std::size_t sent = 0;
  for (unsigned round = 0; round < 300; ++round) {
    const std::string bytes = random_bytes(draw, 1 + draw() % 50);
    client.write(bytes);
    sent += bytes.size();
    unsigned in_a_row = 0;
    ASSERT_TRUE(until([&] {
      read();
      in_a_row = stream->settled() ? in_a_row + 1 : 0;
      if (in_a_row == 1) io.poll();
      return in_a_row == 2;
    }));
    ASSERT_EQ(owner.received.size(), sent) << round;
  }
}

TEST(TtyStream, IsOpenUntilItIsLost) {
  const std::string path = testing::TempDir() + fmt::format("servodrome_tty_{}", ::getpid());
  auto far_end = std::make_optional<Pty>(path);
  boost::asio::io_context io;
  Owner owner;
  const auto stream = open_tty_stream(
      FileDescriptor(::open(far_end->device().c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)), io, owner);
  EXPECT_TRUE(stream->is_open());
  stream->read(owner.asked = 10);
  ASSERT_EQ(::write(far_end->master(), "abc", 3), 3);
  while (owner.received.size() < 3) {
    io.run_one();
    if (owner.asked == 0) stream->read(owner.asked = 10);
  }
  far_end.reset();
  while (owner.closed == 0) io.run_one();
  EXPECT_FALSE(stream->is_open());
  EXPECT_EQ(owner.opened, 0U);
  EXPECT_TRUE(stream->settled());
}

// The destructor ends the thread in each of its states.
TEST(TtyStream, EndsInEachState) {
  const std::string path = testing::TempDir() + fmt::format("servodrome_ends_{}", ::getpid());
  for (unsigned state = 0; state < 4; ++state) {
    boost::asio::io_context io;
    Owner owner;
    const auto stream = open_adapter_stream(path, io, owner);
    if (state == 0) continue;
    const FileDescriptor client(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    while (owner.opened == 0) io.run_one();
    if (state == 1) continue;
    stream->read(owner.asked = 1);
    if (state == 2) continue;
    ASSERT_EQ(::write(client.get(), "ab", 2), 2);
  }
}

}  // namespace
}  // namespace serial_stream_test
}  // namespace servodrome::links
