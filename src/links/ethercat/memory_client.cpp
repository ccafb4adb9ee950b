#include "links/ethercat/memory_client.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "links/link_error.hpp"

namespace servodrome::links {

void MemoryEthercatClient::send(std::span<const std::uint8_t> content) {
  check_content_size(content.size(), name());
  std::vector<std::uint8_t> bytes(content.begin(), content.end());
  const EthercatBus::Passage passage = bus_.exchange(bytes, now(), port_, EthercatBus::Encapsulation::payload, {this});
  bytes.resize(passage.length);
  if (passage.exit != EthercatBus::Exit::lost) keep(passage.leaves, std::move(bytes));
  for (const std::vector<std::uint8_t>& extra : passage.behind) keep(passage.leaves, extra);
}

void MemoryEthercatClient::keep(Time at, std::vector<std::uint8_t> bytes) {
  const auto later = std::upper_bound(returning_.begin(), returning_.end(), at,
                                      [](Time time, const Returning& frame) { return time < frame.at; });
  returning_.insert(later, {at, std::move(bytes)});
}

std::size_t MemoryEthercatClient::receive(std::span<std::uint8_t> into, Time timeout) {
  const Time deadline = now() + timeout;
  if (returning_.empty() || returning_.front().at > deadline) {
    clock_.run_until(deadline);
    return 0;
  }
  clock_.run_until(returning_.front().at);
  const std::vector<std::uint8_t> content = std::move(returning_.front().content);
  returning_.erase(returning_.begin());
  const std::size_t size = std::min(into.size(), content.size());
  std::copy_n(content.begin(), size, into.begin());
  return size;
}

}  // namespace servodrome::links
