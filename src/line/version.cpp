#include "line/version.hpp"

namespace servodrome::line {

const char* version() noexcept { return SERVODROME_VERSION; }

}  // namespace servodrome::line
