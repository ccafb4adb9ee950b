#pragma once

#include <cerrno>

namespace servodrome::links {

// Returns the advice for an error on opening something: `otherwise`, unless the reason is the limit of open files,
// which does not depend on what was to be opened.
template <typename Advice>
Advice advice_for(int reason, Advice otherwise) {
  if (reason != EMFILE && reason != ENFILE) return otherwise;
  return "too many files are open; end other programs, or raise the limit (ulimit -n)";
}

}  // namespace servodrome::links
