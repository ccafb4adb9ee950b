#pragma once

namespace servodrome::test {

#ifdef SERVODROME_SANITIZED
constexpr bool sanitized = true;
#else
constexpr bool sanitized = false;
#endif

// The number of draws or repetitions of a test, at least 1. With a sanitizer each takes about ten times as long, so
// only a tenth of them run: they are enough to find misuse of memory. The build without sanitizers runs all.
constexpr int draws(int all) { return sanitized ? (all < 10 ? 1 : all / 10) : all; }
// Of a loop over moments or places: it looks at each, with a sanitizer at each fifth.
constexpr int stride = sanitized ? 5 : 1;

}  // namespace servodrome::test
