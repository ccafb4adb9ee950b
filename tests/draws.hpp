#pragma once

namespace servodrome::test {

// The number of draws of a random test. With a sanitizer a draw takes some ten times as long, and a tenth of them shows
// the misuse of memory that it looks for; the build without sanitizers takes all.
constexpr int draws(int all) {
#ifdef SERVODROME_SANITIZED
  return all / 10;
#else
  return all;
#endif
}

}  // namespace servodrome::test
