#include "tools/sampling/can_process_data.hpp"

#include <algorithm>

namespace servodrome::master::sampling {

namespace {

using namespace std::chrono_literals;

constexpr Time shortest_listening = 150ms;
constexpr Time longest_listening = 3s;

constexpr std::size_t pdo_bytes = 8;
constexpr std::size_t entries_of_every_drive = 4;  // entries that every drive's PDO has; ProNet has the fewest

}  // namespace

std::vector<std::vector<PdoObject>> pack_into_pdos(const std::vector<Channel>& channels) {
  std::vector<std::vector<PdoObject>> pdos;
  const auto bits = [](const std::vector<PdoObject>& pdo) {
    unsigned sum = 0;
    for (const PdoObject& object : pdo) sum += object.bits;
    return sum;
  };
  for (const Channel& channel : channels) {
    const auto fits = [&](const std::vector<PdoObject>& pdo) {
      return pdo.size() < entries_of_every_drive && bits(pdo) + channel.bits <= 8 * pdo_bytes;
    };
    auto room = std::find_if(pdos.begin(), pdos.end(), fits);
    if (room == pdos.end()) room = pdos.emplace(pdos.end());
    room->push_back({channel.object, static_cast<std::uint8_t>(channel.bits)});
  }
  return pdos;
}

std::optional<UseOfPdos> use_of_pdos(const Frame& frame) {
  constexpr std::uint32_t heartbeat = 0x700;
  constexpr std::uint8_t operational = 5;
  if (frame.extended || frame.remote) return std::nullopt;
  const auto node_id = static_cast<std::uint8_t>(frame.id & 0x7F);
  if (frame.id == sync_id) return UseOfPdos{UseOfPdos::By::sync, 0};
  if (frame.id >= first_pdo && frame.id < after_pdos) return UseOfPdos{UseOfPdos::By::pdo, node_id};
  if (frame.id > heartbeat && frame.id <= heartbeat + 0x7F && frame.length == 1 &&
      (frame.data[0] & 0x7F) == operational) {
    return UseOfPdos{UseOfPdos::By::operational, node_id};
  }
  return std::nullopt;
}

Time time_to_listen(Time heartbeat) { return std::clamp<Time>(2 * heartbeat, shortest_listening, longest_listening); }

}  // namespace servodrome::master::sampling
