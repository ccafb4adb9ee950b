#pragma once

#include <cstring>

#include "canopen/frame.hpp"

// Byte 0 and other fields of SDO frames (CiA 301 7.2.4.3).
namespace servodrome::canopen::sdo {

inline constexpr std::size_t expedited_bytes = 4;  // data of an expedited transfer, at most
inline constexpr std::uint32_t segment_bytes = 7;  // data of a segment, at most
inline constexpr std::uint8_t abort_transfer = 0x80;

constexpr std::uint8_t specifier(std::uint8_t command) { return command >> 5; }

// Client command specifiers.
namespace client {
inline constexpr std::uint8_t download_segment = 0;
inline constexpr std::uint8_t initiate_download = 1;
inline constexpr std::uint8_t initiate_upload = 2;
inline constexpr std::uint8_t upload_segment = 3;
inline constexpr std::uint8_t abort = 4;
inline constexpr std::uint8_t block_upload = 5;
inline constexpr std::uint8_t block_download = 6;
}  // namespace client

// Server responses: command specifier and fixed bits.
namespace server {
inline constexpr std::uint8_t download_initiated = 0x60;
inline constexpr std::uint8_t segment_downloaded = 0x20;
inline constexpr std::uint8_t upload_expedited = 0x43;          // e, s; n goes to bits 3..2
inline constexpr std::uint8_t upload_segmented = 0x41;          // s
inline constexpr std::uint8_t block_download_initiated = 0xA4;  // sc: the server checks CRCs
inline constexpr std::uint8_t block_downloaded = 0xA2;
inline constexpr std::uint8_t block_download_ended = 0xA1;
inline constexpr std::uint8_t block_upload_initiated = 0xC6;  // sc, s
inline constexpr std::uint8_t block_upload_end = 0xC1;        // n goes to bits 4..2
}  // namespace server

// Initiate requests.
inline constexpr std::uint8_t expedited = 0x02;
inline constexpr std::uint8_t size_indicated = 0x01;
// Segments.
inline constexpr std::uint8_t toggle_bit = 0x10;
inline constexpr std::uint8_t last_segment = 0x01;
// Block transfers.
inline constexpr std::uint8_t client_crc = 0x04;
inline constexpr std::uint8_t block_size_indicated = 0x02;
inline constexpr std::uint8_t last_block_segment = 0x80;
inline constexpr std::uint8_t sequence_mask = 0x7F;
inline constexpr std::uint8_t largest_block = 127;
inline constexpr std::uint8_t subcommand_mask = 0x03;
namespace block_upload_subcommand {
inline constexpr std::uint8_t initiate = 0;
inline constexpr std::uint8_t end = 1;
inline constexpr std::uint8_t response = 2;
inline constexpr std::uint8_t start = 3;
}  // namespace block_upload_subcommand
namespace block_download_subcommand {
inline constexpr std::uint8_t initiate = 0;
inline constexpr std::uint8_t end = 1;
}  // namespace block_download_subcommand

inline std::uint16_t multiplexer_index(const Frame& frame) {
  return static_cast<std::uint16_t>(frame.data[1] | frame.data[2] << 8);
}
inline std::uint32_t get_u32(const Frame& frame) {
  std::uint32_t value = 0;
  std::memcpy(&value, &frame.data[4], sizeof value);
  return value;
}
inline void put_u32(Frame& frame, std::uint32_t value) { std::memcpy(&frame.data[4], &value, sizeof value); }

}  // namespace servodrome::canopen::sdo
