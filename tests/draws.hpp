#pragma once

#include <cstdlib>
#include <string_view>

namespace servodrome::test {

#ifdef SERVODROME_SANITIZED
constexpr bool sanitized = true;
#else
constexpr bool sanitized = false;
#endif

// The number of draws or repetitions of a test, at least 1. With a sanitizer each takes about ten times as long, so
// only a tenth of them run: they are enough to find misuse of memory. With SERVODROME_DRAWS=few (long tests in
// `./test`) a quarter of them run; `./test --all` and a test that is run by hand make all.
inline int draws(int all) {
  const char* wanted = std::getenv("SERVODROME_DRAWS");
  const int part = sanitized ? 10 : wanted != nullptr && std::string_view(wanted) == "few" ? 4 : 1;
  return all < part ? 1 : all / part;
}
// Of a loop over moments or places: it looks at each, with a sanitizer at each fifth.
constexpr int stride = sanitized ? 5 : 1;

}  // namespace servodrome::test
