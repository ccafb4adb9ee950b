#pragma once

#include <string>
#include <system_error>

namespace servodrome::links {

// A link could not be opened or was lost. what() describes what happened, where, and what to do; code() is the
// operating system's error (or std::errc::invalid_argument for an invalid link name).
class LinkError : public std::system_error {
 public:
  LinkError(std::error_code code, std::string message) : std::system_error(code), message_(std::move(message)) {}

  const char* what() const noexcept override { return message_.c_str(); }

 private:
  std::string message_;
};

}  // namespace servodrome::links
