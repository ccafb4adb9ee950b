#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "links/file_descriptor.hpp"
#include "links/time.hpp"

namespace servodrome::links {

// Waits for descriptors with one system call each time. Asio makes two for a descriptor that is only waited for, and on
// an EtherCAT segment of the size of a machine a frame costs little more than its system calls.
//
// For one thread. Descriptors must be taken out before they are closed.
class DescriptorWatch {
 public:
  using Ready = std::function<void()>;

  // Throws LinkError if the system has no more descriptors.
  DescriptorWatch();

  // `ready` is called by wait() as long as the descriptor is readable or has an error. Throws LinkError.
  void add(int descriptor, Ready ready);
  void remove(int descriptor);
  bool empty() const { return entries_.empty(); }
  // Paused, it hears of no descriptor, and a frame that arrives does not pay for telling: for callers that
  // poll themselves. What is ready then is told after resume(), which throws LinkError.
  void pause();
  void resume();

  // From now on wait() returns true once in each `period`, until 0 ends that.
  void tick_every(Time period);

  // Waits for at most `longest` (never: without end), then calls `ready` of the ready ones. True: a period is over.
  bool wait(Time longest = never);

 private:
  struct Entry {
    int descriptor;
    Ready ready;
  };
  void hear(Entry& entry);

  FileDescriptor epoll_;
  FileDescriptor timer_;
  std::vector<std::unique_ptr<Entry>> entries_;
  std::vector<std::unique_ptr<Entry>> removed_;  // while wait() may still come across them
  bool waiting_ = false;
  bool paused_ = false;
};

}  // namespace servodrome::links
