#include "capi/handles.hpp"

#include <atomic>
#include <pthread.h>
#include <unordered_map>

namespace servodrome::capi {
namespace {

// All open handles of the process. The functions hold its lock only to look up, so that calls on different lines do not
// wait for each other.
struct Table {
  std::mutex mutex;
  std::unordered_map<servodrome_handle, std::shared_ptr<OpenLine>> lines;
};

Table& table();

// A child of fork() has only the thread that called it. The table is locked during fork(), because otherwise a lock of
// a thread that the child does not have could stay in the child.
Table* make_table() {
  ::pthread_atfork([] { table().mutex.lock(); }, [] { table().mutex.unlock(); }, [] { table().mutex.unlock(); });
  return new Table;
}

// Never destroyed: a thread may still call while the process ends.
Table& table() {
  static Table& table = *make_table();
  return table;
}

std::string& reason() {
  thread_local std::string reason = "{}";
  return reason;
}

}  // namespace

Failure failure(int result, std::string what, std::string where, std::string hint) {
  return {result, {{"what", std::move(what)}, {"where", std::move(where)}, {"hint", std::move(hint)}}};
}

void keep_reason(const api::Json& json) { reason() = api::to_text(json); }

const std::string& last_reason() { return reason(); }

servodrome_handle new_handle() {
  static std::atomic<servodrome_handle> last{0};
  return ++last;
}

void add_handle(servodrome_handle handle, const std::shared_ptr<OpenLine>& line) {
  const std::unique_lock lock(table().mutex);
  table().lines.emplace(handle, line);
}

void remove_handle(servodrome_handle handle) {
  std::shared_ptr<OpenLine> last;  // destroyed after the lock is released
  const std::unique_lock lock(table().mutex);
  const auto found = table().lines.find(handle);
  if (found == table().lines.end()) return;
  last = std::move(found->second);
  table().lines.erase(found);
}

Failure LockedLine::closed() {
  return failure(SERVODROME_CLOSED, "the handle is closed, or is of another kind", "handle",
                 "use a handle that an open function returned, until it or its line is closed");
}

LockedLine::LockedLine(servodrome_handle handle) : handle_(handle) {
  {
    const std::unique_lock lock(table().mutex);
    const auto found = table().lines.find(handle);
    if (found == table().lines.end()) throw closed();
    line_ = found->second;
  }
  lock_ = std::unique_lock(line_->mutex);
  if (line_->closed) throw closed();
}

servodrome_handle LockedLine::add(std::unique_ptr<Item> item) const {
  const servodrome_handle handle = new_handle();
  line_->items.emplace(handle, std::move(item));
  add_handle(handle, line_);
  return handle;
}

const LockedLine& LockedLine::itself() const {
  if (line_->items.contains(handle_)) throw closed();
  return *this;
}

}  // namespace servodrome::capi
