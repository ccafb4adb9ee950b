#include "api/version.hpp"

#include <fmt/format.h>
#include <random>

namespace servodrome::api {

const char* version() noexcept { return SERVODROME_VERSION; }

const std::string& run_name() {
  static const std::string name = [] {
    std::random_device random;
    return fmt::format("{:08x}{:08x}", random(), random());
  }();
  return name;
}

}  // namespace servodrome::api
