#include "catalogue/object_address.hpp"

#include <fmt/format.h>

namespace servodrome::catalogue {

std::string text_of(ObjectAddress object) { return fmt::format("{:04X}:{:02X}", object.index, object.sub); }

}  // namespace servodrome::catalogue
