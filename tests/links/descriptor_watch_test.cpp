#include "links/descriptor_watch.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

namespace servodrome::links {
namespace descriptor_watch_test {
namespace {

using namespace std::chrono_literals;

class Watch : public testing::Test {
 protected:
  Watch() {
    std::array<int, 2> ends{};
    EXPECT_EQ(::pipe(ends.data()), 0);
    reader = FileDescriptor(ends[0]);
    writer = FileDescriptor(ends[1]);
    listen();
  }
  void listen() {
    watch.add(reader.get(), [this] {
      char byte = 0;
      EXPECT_EQ(::read(reader.get(), &byte, 1), 1);
      ++told;
    });
  }
  void send() { EXPECT_EQ(::write(writer.get(), "x", 1), 1); }

  FileDescriptor reader;
  FileDescriptor writer;
  DescriptorWatch watch;
  int told = 0;
};

TEST_F(Watch, TellsOfWhatIsReadable) {
  EXPECT_FALSE(watch.wait(0ms));
  EXPECT_EQ(told, 0);
  send();
  watch.wait();
  EXPECT_EQ(told, 1);
  watch.remove(reader.get());
  EXPECT_TRUE(watch.empty());
  send();
  watch.wait(0ms);
  EXPECT_EQ(told, 1);
}

TEST_F(Watch, HearsNothingWhilePausedAndEverythingAfterwards) {
  watch.pause();
  send();
  watch.wait(0ms);
  EXPECT_EQ(told, 0);
  EXPECT_FALSE(watch.empty());
  watch.resume();
  watch.wait(0ms);
  EXPECT_EQ(told, 1);
}

TEST_F(Watch, WhatComesAndGoesInAPauseIsHeardOrNotAfterwards) {
  watch.pause();
  watch.remove(reader.get());
  listen();
  send();
  watch.wait(0ms);
  EXPECT_EQ(told, 0);
  watch.resume();
  watch.wait(0ms);
  EXPECT_EQ(told, 1);
  watch.pause();
  watch.remove(reader.get());
  watch.resume();
  send();
  watch.wait(0ms);
  EXPECT_EQ(told, 1);
}

TEST_F(Watch, TicksWhilePaused) {
  watch.pause();
  watch.tick_every(1ms);
  EXPECT_TRUE(watch.wait());
  watch.tick_every(0ms);
  EXPECT_FALSE(watch.wait(3ms));
}

}  // namespace
}  // namespace descriptor_watch_test
}  // namespace servodrome::links
