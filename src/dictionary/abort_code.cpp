#include "dictionary/abort_code.hpp"

namespace servodrome::dictionary {

const char* text(AbortCode code) {
  switch (code) {
    case AbortCode::none: return "no error";
    case AbortCode::toggle_bit_not_alternated: return "toggle bit not alternated";
    case AbortCode::protocol_timed_out: return "SDO protocol timed out";
    case AbortCode::command_specifier_unknown: return "command specifier not valid or unknown";
    case AbortCode::invalid_block_size: return "invalid block size";
    case AbortCode::invalid_sequence_number: return "invalid sequence number";
    case AbortCode::crc_error: return "CRC error";
    case AbortCode::out_of_memory: return "out of memory";
    case AbortCode::unsupported_access: return "unsupported access to an object";
    case AbortCode::write_only: return "attempt to read a write-only object";
    case AbortCode::read_only: return "attempt to write a read-only object";
    case AbortCode::sub_index_0_not_zero: return "sub-index cannot be written: sub-index 0 must be 0";
    case AbortCode::complete_access_not_supported: return "complete access not supported";
    case AbortCode::object_does_not_exist: return "object does not exist";
    case AbortCode::not_mappable: return "object cannot be mapped to the PDO";
    case AbortCode::mapping_exceeds_pdo_length: return "mapped objects would exceed the PDO length";
    case AbortCode::parameter_incompatible: return "general parameter incompatibility";
    case AbortCode::internal_incompatibility: return "general internal incompatibility in the device";
    case AbortCode::hardware_error: return "access failed due to a hardware error";
    case AbortCode::length_mismatch: return "data type does not match: length of the parameter does not match";
    case AbortCode::length_too_high: return "data type does not match: length too high";
    case AbortCode::length_too_low: return "data type does not match: length too low";
    case AbortCode::sub_index_does_not_exist: return "sub-index does not exist";
    case AbortCode::value_invalid: return "invalid value";
    case AbortCode::value_too_high: return "value too high";
    case AbortCode::value_too_low: return "value too low";
    case AbortCode::maximum_less_than_minimum: return "maximum value is less than minimum value";
    case AbortCode::resource_not_available: return "resource not available: SDO connection";
    case AbortCode::general_error: return "general error";
    case AbortCode::cannot_transfer_or_store: return "data cannot be transferred or stored";
    case AbortCode::local_control: return "data cannot be transferred or stored because of local control";
    case AbortCode::device_state: return "data cannot be transferred or stored because of the present device state";
    case AbortCode::no_dictionary: return "object dictionary not present";
    case AbortCode::no_data: return "no data available";
  }
  return "unknown abort code";
}

}  // namespace servodrome::dictionary
