#pragma once

#include <cstdint>

namespace servodrome::dictionary {

// SDO abort codes (CiA 301 table 22). `none` is success.
enum class AbortCode : std::uint32_t {
  none = 0,
  toggle_bit_not_alternated = 0x05030000,
  protocol_timed_out = 0x05040000,
  command_specifier_unknown = 0x05040001,
  invalid_block_size = 0x05040002,
  invalid_sequence_number = 0x05040003,
  crc_error = 0x05040004,
  out_of_memory = 0x05040005,
  unsupported_access = 0x06010000,
  write_only = 0x06010001,
  read_only = 0x06010002,
  sub_index_0_not_zero = 0x06010003,           // CoE (ETG.1000.6 table 41)
  complete_access_not_supported = 0x06010004,  // CoE
  object_does_not_exist = 0x06020000,
  not_mappable = 0x06040041,
  mapping_exceeds_pdo_length = 0x06040042,
  parameter_incompatible = 0x06040043,
  internal_incompatibility = 0x06040047,
  hardware_error = 0x06060000,
  length_mismatch = 0x06070010,
  length_too_high = 0x06070012,
  length_too_low = 0x06070013,
  sub_index_does_not_exist = 0x06090011,
  value_invalid = 0x06090030,
  value_too_high = 0x06090031,
  value_too_low = 0x06090032,
  maximum_less_than_minimum = 0x06090036,
  resource_not_available = 0x060A0023,
  general_error = 0x08000000,
  cannot_transfer_or_store = 0x08000020,
  local_control = 0x08000021,
  device_state = 0x08000022,
  no_dictionary = 0x08000023,
  no_data = 0x08000024,
};

// The standard's text for a code, or "unknown abort code".
const char* text(AbortCode code);

}  // namespace servodrome::dictionary
