#pragma once

#include <cerrno>

namespace servodrome::links {

// What to do about an error that keeps something from being opened: whatever was to be opened, the limit of descriptors
// is not its fault.
template <typename Advice>
Advice advice_for(int reason, Advice otherwise) {
  if (reason != EMFILE && reason != ENFILE) return otherwise;
  return "too many files are open; end other programs, or raise the limit (ulimit -n)";
}

}  // namespace servodrome::links
