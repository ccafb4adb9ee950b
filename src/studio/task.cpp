#include "studio/task.hpp"

namespace servodrome::studio {

// Passes the turn to the other side and waits until it comes back.
void Task::hand_over(std::unique_lock<std::mutex>& lock, Turn to) {
  const Turn mine = turn_;
  turn_ = to;
  handed_over_.notify_all();
  handed_over_.wait(lock, [this, mine] { return turn_ == mine; });
}

void Task::resume() {
  if (over_) return;
  std::unique_lock lock(mutex_);
  if (!thread_.joinable()) {
    thread_ = std::thread([this] {
      std::unique_lock body_lock(mutex_);
      handed_over_.wait(body_lock, [this] { return turn_ == Turn::body; });
      try {
        body_();
      } catch (...) {
        // Task ended, or an error that the body did not report.
      }
      over_ = true;
      turn_ = Turn::owner;
      handed_over_.notify_all();
    });
  }
  hand_over(lock, Turn::body);
  if (!over_) return;
  lock.unlock();
  thread_.join();
}

void Task::end() {
  ending_ = true;
  if (!thread_.joinable()) over_ = true;  // the body never began
  while (!over_) resume();
}

void Task::pause() {
  if (ending_) throw Ended{};
  // The body's thread holds the lock while it runs.
  std::unique_lock lock(mutex_, std::adopt_lock);
  hand_over(lock, Turn::owner);
  lock.release();
  if (ending_) throw Ended{};
}

}  // namespace servodrome::studio
