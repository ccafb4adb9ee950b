#include "studio/remote_objects.hpp"

#include <exception>

#include "studio/task.hpp"

namespace servodrome::studio {
namespace {

constexpr auto answer_poll_period = std::chrono::microseconds(500);

// If the caller leaves, also by an exception, the access is given up.
class Wanted {
 public:
  explicit Wanted(Access& access) : access_(access) {}
  ~Wanted() {
    if (!keeps_) access_.given_up = true;
  }
  void keep() { keeps_ = true; }
  Wanted(const Wanted&) = delete;
  Wanted& operator=(const Wanted&) = delete;

 private:
  Access& access_;
  bool keeps_ = false;
};

}  // namespace

std::vector<std::byte> RemoteObjects::access(master::ObjectAddress object, bool writes, std::vector<std::byte> bytes) {
  const auto access = std::make_shared<Access>();
  access->drive = drive_;
  access->object = object;
  access->writes = writes;
  access->bytes = std::move(bytes);
  access->longest_wait = longest_wait_;
  Wanted wanted(*access);
  bus_.submit(access);
  const bool cleans_up = std::uncaught_exceptions() != 0;
  try {
    while (!access->done) wait_(now_() + answer_poll_period);
  } catch (const Task::Ended&) {
    // A task that is being ended restores what it has changed. It does not wait for these writes; the bus carries them
    // out later.
    if (!writes || !cleans_up) throw;
    wanted.keep();
    return {};
  }
  if (access->error) std::rethrow_exception(access->error);
  size_is_known_ = access->size_is_known;
  return std::move(access->bytes);
}

}  // namespace servodrome::studio
