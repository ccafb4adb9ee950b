#include "links/descriptor_watch.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

constexpr int most_events = 16;

[[noreturn]] void fail(const char* what) {
  const std::error_code code(errno, std::generic_category());
  throw LinkError(code, std::string(what) + ": " + code.message());
}

void watch(int epoll, int descriptor, std::uint32_t events, void* entry) {
  epoll_event event{};
  event.events = events;
  event.data.ptr = entry;
  if (::epoll_ctl(epoll, EPOLL_CTL_ADD, descriptor, &event) != 0) fail("cannot wait for a link");
}

}  // namespace

DescriptorWatch::DescriptorWatch()
    : epoll_(::epoll_create1(EPOLL_CLOEXEC)), timer_(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)) {
  if (!epoll_.is_open() || !timer_.is_open()) fail("cannot wait for links");
  watch(epoll_.get(), timer_.get(), EPOLLIN, nullptr);
}

void DescriptorWatch::add(Descriptor descriptor, Ready ready) {
  auto entry = std::make_unique<Entry>(Entry{descriptor, std::move(ready)});
  if (!paused_) hear(*entry);
  entries_.push_back(std::move(entry));
}

void DescriptorWatch::hear(Entry& entry) { watch(epoll_.get(), entry.descriptor, EPOLLIN, &entry); }

void DescriptorWatch::pause() {
  paused_ = true;
  for (const auto& entry : entries_) ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, entry->descriptor, nullptr);
}

void DescriptorWatch::resume() {
  paused_ = false;
  for (const auto& entry : entries_) hear(*entry);
}

void DescriptorWatch::remove(Descriptor descriptor) {
  const auto found = std::find_if(entries_.begin(), entries_.end(),
                                  [descriptor](const auto& entry) { return entry->descriptor == descriptor; });
  if (found == entries_.end()) return;
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, descriptor, nullptr);
  (*found)->descriptor = -1;
  if (waiting_) removed_.push_back(std::move(*found));
  entries_.erase(found);
}

void DescriptorWatch::tick_every(Time period) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(period);
  const timespec span{seconds.count(), (period - seconds).count()};
  const itimerspec setting{span, span};
  ::timerfd_settime(timer_.get(), 0, &setting, nullptr);
}

bool DescriptorWatch::wait(Time longest) {
  const int milliseconds = longest == never ? -1
                                            : static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(
                                                                   std::clamp(longest, Time{}, Time{60'000'000'000}))
                                                                   .count());
  std::array<epoll_event, most_events> events{};
  const int count = ::epoll_wait(epoll_.get(), events.data(), most_events, milliseconds);
  bool tick = false;
  waiting_ = true;
  for (int i = 0; i < count; ++i) {
    auto* const entry = static_cast<Entry*>(events[static_cast<std::size_t>(i)].data.ptr);
    if (entry == nullptr) {
      std::uint64_t periods = 0;  // reading restarts the count of expirations
      tick = ::read(timer_.get(), &periods, sizeof periods) == sizeof periods;
    } else if (entry->descriptor >= 0) {
      entry->ready();
    }
  }
  waiting_ = false;
  removed_.clear();
  return tick;
}

}  // namespace servodrome::links
