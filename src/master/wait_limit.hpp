#pragma once

#include <algorithm>
#include <optional>

#include "links/time.hpp"

namespace servodrome::master {

// The limit of ObjectClient::limit_wait(): a shorter timeout, and no retries.
class WaitLimit {
 public:
  void set(std::optional<links::Time> longest) { longest_ = longest; }
  links::Time timeout(links::Time own) const { return longest_ ? std::min(*longest_, own) : own; }
  unsigned retries(unsigned own) const { return longest_ ? 0 : own; }

 private:
  std::optional<links::Time> longest_{};
};

}  // namespace servodrome::master
