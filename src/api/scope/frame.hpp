#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>

// The binary format of a block of samples, little endian: u32 id, u32 stride in ticks, u64 tick of the first sample,
// u32 number n of samples, u32 number m of channels, then m times n f64, channel by channel.
namespace servodrome::api {

static_assert(std::endian::native == std::endian::little, "numbers travel as they are kept");

struct FrameHeader {
  std::uint32_t id = 0;
  std::uint32_t stride = 0;
  std::uint64_t first_tick = 0;
  std::uint32_t samples = 0;
  std::uint32_t channels = 0;
};
static_assert(sizeof(FrameHeader) == 24);

inline void append(std::string& bytes, const void* data, std::size_t size) {
  bytes.append(static_cast<const char*>(data), size);
}

// Returns the header of a frame without the samples.
inline std::string head_of_frame(const FrameHeader& header) {
  return {reinterpret_cast<const char*>(&header), sizeof header};
}

// Returns a frame with space for the samples, to which `values` points.
inline std::string make_frame(const FrameHeader& header, double*& values) {
  std::string bytes(sizeof header + std::size_t{header.samples} * header.channels * sizeof(double), '\0');
  std::memcpy(bytes.data(), &header, sizeof header);
  values = reinterpret_cast<double*>(bytes.data() + sizeof header);
  return bytes;
}

}  // namespace servodrome::api
