#include "api/version.hpp"

namespace servodrome::api {

const char* version() noexcept { return SERVODROME_VERSION; }

}  // namespace servodrome::api
