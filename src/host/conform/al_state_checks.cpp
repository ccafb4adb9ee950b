#include "host/conform/check_tables.hpp"
namespace servodrome::host::conform {
std::span<const Check> al_state_checks() { return {}; }
}  // namespace servodrome::host::conform
