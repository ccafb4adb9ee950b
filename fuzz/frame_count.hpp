#pragma once

#include <cstdint>
#include <cstdio>

// Counts the frames of a run: an input of libFuzzer is a dialogue of many frames. Prints the number at the end.
namespace servodrome::fuzz {

class FrameCount {
 public:
  explicit constexpr FrameCount(const char* what) : what_(what) {}
  ~FrameCount() { std::fprintf(stderr, "stat::%s: %llu\n", what_, static_cast<unsigned long long>(count_)); }
  FrameCount(const FrameCount&) = delete;
  FrameCount& operator=(const FrameCount&) = delete;
  void operator++() { ++count_; }

 private:
  const char* what_;
  std::uint64_t count_ = 0;
};

}  // namespace servodrome::fuzz
