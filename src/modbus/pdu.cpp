#include "modbus/pdu.hpp"

namespace servodrome::modbus {

const char* text(Exception exception) {
  switch (exception) {
    case Exception::none: return "no exception";
    case Exception::illegal_function: return "illegal function";
    case Exception::illegal_data_address: return "illegal data address";
    case Exception::illegal_data_value: return "illegal data value";
    case Exception::server_device_failure: return "server device failure";
    case Exception::acknowledge: return "acknowledge";
    case Exception::server_device_busy: return "server device busy";
    case Exception::memory_parity_error: return "memory parity error";
    case Exception::gateway_path_unavailable: return "gateway path unavailable";
    case Exception::gateway_target_failed_to_respond: return "gateway target device failed to respond";
  }
  return "unknown exception";
}

}  // namespace servodrome::modbus
