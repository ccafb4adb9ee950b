#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace servodrome::studio {

// A function with a stack of its own that can be left in its middle and resumed there. Its thread and the owner's hand
// a baton to each other: only one of the two ever runs, and each sees all the other did.
class Task {
 public:
  // Thrown by pause() when the task is to end. Not to be caught, or to be thrown on.
  struct Ended {};

  // `body` runs when resume() is called first. An exception that leaves it ends the task, and is lost.
  explicit Task(std::function<void()> body) : body_(std::move(body)) {}
  // Ends the task where it stands.
  ~Task() { end(); }
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;

  // --- The owner's side
  // Lets the body run until it pauses or is over. Throws std::system_error if no thread can be started.
  void resume();
  // Lets pause() throw, until the body is over.
  void end();
  bool over() const { return over_; }

  // --- The body's side
  // Leaves the body until the next resume().
  void pause();
  // The task is to end: nothing more is to be done.
  bool ending() const { return ending_; }

 private:
  enum class Turn { owner, body };
  void hand_over(std::unique_lock<std::mutex>& lock, Turn to);

  std::function<void()> body_;
  std::thread thread_;
  std::mutex mutex_;
  std::condition_variable handed_over_;
  Turn turn_ = Turn::owner;
  // Written by the side whose turn it is.
  bool over_ = false;
  bool ending_ = false;
};

}  // namespace servodrome::studio
