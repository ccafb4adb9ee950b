#include <fmt/format.h>

#include "links/can/client_slcan.hpp"
#include "links/link_error.hpp"
#include "links/serial/tty.hpp"

namespace servodrome::links {

void SlcanClient::open_tty() {
  try {
    tty_ = links::open_tty(name_.path, {.bit_rate = 115'200});
  } catch (const LinkError& error) {
    throw LinkError(error.code(), fmt::format("\"{}\": {}", to_string(CanLinkName(name_)), error.what()));
  }
}

}  // namespace servodrome::links
