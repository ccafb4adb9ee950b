#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace servodrome::studio {

// A function with its own stack (coroutine) that can pause in its middle and be resumed there. Its thread and the
// owner's thread take turns: only one of them runs at a time, and each sees all memory changes of the other.
class Task {
 public:
  // pause() throws it when the task must end. Code that catches it must throw it again.
  struct Ended {};

  // The first resume() starts `body`. An exception that leaves it ends the task and is discarded.
  explicit Task(std::function<void()> body) : body_(std::move(body)) {}
  // Ends the task at its present pause.
  ~Task() { end(); }
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;

  // --- The owner's side
  // Lets the body run until it pauses or ends. Throws std::system_error if no thread can be started.
  void resume();
  // Makes pause() throw, until the body has ended.
  void end();
  bool over() const { return over_; }

  // --- The body's side
  // Pauses the body until the next resume().
  void pause();
  // The task must end: the body starts nothing new.
  bool ending() const { return ending_; }

 private:
  enum class Turn { owner, body };
  void hand_over(std::unique_lock<std::mutex>& lock, Turn to);

  std::function<void()> body_;
  std::thread thread_;
  std::mutex mutex_;
  std::condition_variable handed_over_;
  Turn turn_ = Turn::owner;
  // Written by the side that has the turn.
  bool over_ = false;
  bool ending_ = false;
};

}  // namespace servodrome::studio
