#pragma once

#include <memory>
#include <mutex>

#include "capi/open_line.hpp"

// Handles of the C interface, and the reasons of failures.
namespace servodrome::capi {

// A failure of a call: its result, and its reason for servodrome_last_error.
struct Failure {
  int result = SERVODROME_FAILED;
  api::Json reason;
};

// {"what", "where", "hint"}
Failure failure(int result, std::string what, std::string where, std::string hint);

// Keeps the reason for servodrome_last_error in this thread.
void keep_reason(const api::Json& reason);
const std::string& last_reason();

servodrome_handle new_handle();
void add_handle(servodrome_handle handle, const std::shared_ptr<OpenLine>& line);
void remove_handle(servodrome_handle handle);

// The line that a handle belongs to, locked. Throws Failure if the handle was closed.
class LockedLine {
 public:
  explicit LockedLine(servodrome_handle handle);

  OpenLine* operator->() const { return line_.get(); }
  OpenLine& operator*() const { return *line_; }
  // The item behind the handle. Throws Failure if it is of another kind.
  template <typename Kind>
  Kind& item() const {
    const auto found = line_->items.find(handle_);
    Kind* item = found == line_->items.end() ? nullptr : dynamic_cast<Kind*>(found->second.get());
    if (item == nullptr) throw closed();
    return *item;
  }
  // Adds an item and its handle.
  servodrome_handle add(std::unique_ptr<Item> item) const;
  // Throws Failure if the handle is that of an item, and not of the line.
  const LockedLine& itself() const;

 private:
  static Failure closed();

  servodrome_handle handle_;
  std::shared_ptr<OpenLine> line_;
  std::unique_lock<std::mutex> lock_;
};

}  // namespace servodrome::capi
