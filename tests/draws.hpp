#pragma once

namespace servodrome::test {

// The number of draws of a random test. With a sanitizer a draw takes about ten times as long, so only a tenth of the
// draws run: they are enough to find misuse of memory. The build without sanitizers runs all draws.
constexpr int draws(int all) {
#ifdef SERVODROME_SANITIZED
  return all / 10;
#else
  return all;
#endif
}

}  // namespace servodrome::test
