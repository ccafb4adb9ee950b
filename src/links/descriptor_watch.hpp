#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "links/file_descriptor.hpp"
#include "links/time.hpp"

namespace servodrome::links {

// Waits for file descriptors (epoll) with one system call per wait. Asio makes two for a descriptor that is only waited
// for, and on an EtherCAT segment of usual size a frame costs little more than its system calls.
//
// Not thread-safe. Descriptors must be removed before they are closed.
class DescriptorWatch {
 public:
  using Ready = std::function<void()>;

  // Throws LinkError if the system has no more descriptors.
  DescriptorWatch();

  // While the descriptor is readable or has an error, wait() calls `ready`. Throws LinkError.
  void add(Descriptor descriptor, Ready ready);
  void remove(Descriptor descriptor);
  bool empty() const { return entries_.empty(); }
  // pause() takes all descriptors out of the epoll, so that the kernel need not notify it of each frame: for callers
  // that poll the descriptors themselves. Events that came meanwhile are reported after resume(), which throws
  // LinkError.
  void pause();
  void resume();

  // From now on wait() returns true once per `period`. 0 switches the timer off.
  void tick_every(Time period);

  // Waits for at most `longest` (never: without limit), then calls `ready` of each ready descriptor. Returns true if a
  // period of tick_every() is over.
  bool wait(Time longest = never);

 private:
  struct Entry {
    Descriptor descriptor;
    Ready ready;
  };
  void hear(Entry& entry);

  FileDescriptor epoll_;
  FileDescriptor timer_;
  std::vector<std::unique_ptr<Entry>> entries_;
  std::vector<std::unique_ptr<Entry>> removed_;  // kept until wait() ends, which may still use them
  bool waiting_ = false;
  bool paused_ = false;
};

}  // namespace servodrome::links
