#include "master/abort_text.hpp"

#include <fmt/format.h>

namespace servodrome::master {

using dictionary::AbortCode;

std::string text_of_failed_access(bool upload, AbortCode code, bool from_drive) {
  const char* access = upload ? "read" : "write";
  if (!from_drive && code == AbortCode::protocol_timed_out) return fmt::format("no answer to the {}", access);
  return fmt::format("{} {}: {} ({:04X} {:04X}h)", access, from_drive ? "refused" : "given up", dictionary::text(code),
                     static_cast<std::uint32_t>(code) >> 16, static_cast<std::uint32_t>(code) & 0xFFFF);
}

const char* remedy_of_failed_access(AbortCode code, bool from_drive) {
  if (!from_drive && code == AbortCode::protocol_timed_out) return nullptr;
  switch (code) {
    case AbortCode::object_does_not_exist:
    case AbortCode::sub_index_does_not_exist: return "look up the object in the node's EDS or manual";
    case AbortCode::read_only: return "this value cannot be written";
    case AbortCode::write_only: return "this value cannot be read back";
    case AbortCode::value_invalid:
    case AbortCode::value_too_high:
    case AbortCode::value_too_low: return "give a value within the object's range";
    case AbortCode::length_mismatch:
    case AbortCode::length_too_high:
    case AbortCode::length_too_low: return "give the object's own data type with --type";
    case AbortCode::device_state:
    case AbortCode::local_control: return "bring the drive into another state first (disable it, stop the motion)";
    default: return "see the node's manual for this abort code";
  }
}

bool is_absent(AbortCode code) {
  return code == AbortCode::object_does_not_exist || code == AbortCode::sub_index_does_not_exist;
}

}  // namespace servodrome::master
