#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drive/transforms.hpp"

namespace servodrome::drive {

// In-place radix-2 fast Fourier transform, computed a few steps at a time so that it fits between two control cycles.
// X(k) = sum over n of x(n) exp(-2 pi i k n / N), N = 2^Log2Size.
template <unsigned Log2Size>
class Fft {
 public:
  static constexpr std::size_t size = std::size_t{1} << Log2Size;
  using Values = std::array<float, size>;

  void begin() { *this = {}; }
  bool finished() const { return stage_ == Log2Size; }

  // Executes at most `count` steps; a step is one exchange of the bit-reversal or one butterfly. Returns true when the
  // transform is complete.
  bool advance(Values& real, Values& imaginary, std::size_t count) {
    for (; count > 0 && !finished(); --count) {
      if (reordered_ < size) {
        reorder(real, imaginary);
      } else {
        butterfly(real, imaginary);
      }
    }
    return finished();
  }

 private:
  void reorder(Values& real, Values& imaginary) {
    const std::size_t from = reordered_++;
    std::size_t to = 0;
    for (unsigned bit = 0; bit < Log2Size; ++bit) to |= (from >> bit & 1) << (Log2Size - 1 - bit);
    if (to <= from) return;
    exchange(real[from], real[to]);
    exchange(imaginary[from], imaginary[to]);
  }
  static void exchange(float& a, float& b) {
    const float kept = a;
    a = b;
    b = kept;
  }

  void butterfly(Values& real, Values& imaginary) {
    const std::size_t half = std::size_t{1} << stage_;
    const std::size_t within = next_ & (half - 1);
    const std::size_t upper = ((next_ >> stage_) << (stage_ + 1)) + within;
    const std::size_t lower = upper + half;
    const SinCos turn = sin_cos(static_cast<Phase>(within) << (31 - stage_));
    const float re = real[lower] * turn.cosine + imaginary[lower] * turn.sine;
    const float im = imaginary[lower] * turn.cosine - real[lower] * turn.sine;
    real[lower] = real[upper] - re;
    imaginary[lower] = imaginary[upper] - im;
    real[upper] += re;
    imaginary[upper] += im;
    if (++next_ == size / 2) {
      next_ = 0;
      ++stage_;
    }
  }

  std::size_t reordered_ = 0;
  std::size_t next_ = 0;  // next butterfly of the stage
  unsigned stage_ = 0;
};

}  // namespace servodrome::drive
