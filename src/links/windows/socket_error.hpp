#pragma once

#include <boost/system/error_code.hpp>
#include <cerrno>

namespace servodrome::links {

// Returns the errno value for an error of Winsock or Windows, so that callers need to know only one kind of number.
inline int error_number(unsigned long windows_error) {
  const boost::system::error_code code(static_cast<int>(windows_error), boost::system::system_category());
  const auto condition = code.default_error_condition();
  if (condition == boost::system::errc::operation_would_block) return EAGAIN;
  return condition.category() == boost::system::generic_category() ? condition.value() : EIO;
}

}  // namespace servodrome::links
