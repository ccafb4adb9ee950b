#pragma once

#include <array>
#include <cstdint>
#include <map>

#include "links/time.hpp"
#include "tools/sniff/decoded.hpp"

namespace servodrome::master {

// Statistics of all decoded frames.
struct SniffSummary {
  std::uint64_t frames = 0;
  std::array<std::uint64_t, frame_kinds> kinds{};  // number of frames (on EtherCAT: datagrams) of each kind
  std::map<std::string, std::uint64_t> sources;
  std::uint64_t errors = 0;
  std::uint64_t wire_bits = 0;  // bits of all frames on the wire
  std::optional<Time> first{};
  Time last{};

  void count(const Decoded& decoded);
  void count_frame(Time time, unsigned bits);
  double seconds() const { return first ? links::to_seconds(last - *first) : 0; }
  // Bus load from the first frame to the last in percent; nullopt for fewer than two frames.
  std::optional<double> bus_load(std::uint32_t bit_rate) const;
};

// Selects the frames to show; all given criteria must match. Parsed from words such as "node=5", "kind=sdo,emcy",
// "object=6041" or "object=6099:01".
struct SniffFilter {
  std::vector<unsigned> nodes;
  std::vector<FrameKind> kinds;
  struct Object {
    ObjectAddress address;
    bool whole;
  };
  std::vector<Object> objects;

  // Throws MasterError for an invalid word.
  void add(std::string_view word, const ObjectCatalogue& catalogue);
  bool passes(const Decoded& decoded) const;
};

}  // namespace servodrome::master
