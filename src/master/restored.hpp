#pragma once

#include <utility>

namespace servodrome::master {

// Gives a variable another value until the end of a block.
template <typename Value>
class Restored {
 public:
  Restored(Value& variable, Value meanwhile)
      : variable_(variable), before_(std::exchange(variable, std::move(meanwhile))) {}
  ~Restored() { variable_ = std::move(before_); }
  Restored(const Restored&) = delete;
  Restored& operator=(const Restored&) = delete;

 private:
  Value& variable_;
  Value before_;
};

}  // namespace servodrome::master
