#pragma once

#include <functional>
#include <memory>
#include <ucontext.h>
#include <vector>

#include "line/line.hpp"

namespace servodrome::chaos {

using links::Time;

// A function with its own stack that can pause: the program of a master that waits. studio::Task does the same with a
// thread; a fibre switches without a system call, which a busy machine could delay.
class Fibre {
 public:
  explicit Fibre(std::function<void()> body);
  Fibre(const Fibre&) = delete;
  Fibre& operator=(const Fibre&) = delete;

  // Runs the body until it pauses or ends.
  void resume();
  // To be called in the body.
  void pause();
  bool over() const { return over_; }

 private:
  static void enter(unsigned high, unsigned low);

  static constexpr std::size_t stack_bytes = 512 * 1024;
  std::function<void()> body_;
  std::vector<char> stack_ = std::vector<char>(stack_bytes);
  ucontext_t own_{};
  ucontext_t owner_{};
  bool over_ = false;
};

// The clock of a master that runs in a fibre: wait() pauses the fibre until the line has reached the time. The owner of
// the line advances the time and resumes the fibre when it is due, or when a frame has arrived for it.
class FibreClock final : public links::VirtualClock {
 public:
  FibreClock(const line::Line& line, Fibre*& fibre) : line_(line), fibre_(fibre) {}
  Time now() const override { return line_.now(); }
  void step(Time latest) override {
    due_ = latest;
    fibre_->pause();
  }
  Time due() const { return due_; }

 private:
  const line::Line& line_;
  Fibre*& fibre_;
  Time due_{};
};

}  // namespace servodrome::chaos
