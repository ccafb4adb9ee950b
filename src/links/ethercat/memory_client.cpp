#include "links/ethercat/memory_client.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "links/link_error.hpp"

namespace servodrome::links {

void MemoryEthercatClient::send(std::span<const std::uint8_t> content) {
  check_content_size(content.size(), name());
  std::vector<std::uint8_t> bytes(content.begin(), content.end());
  const EthercatBus::Passage passage = bus_.exchange(bytes, now(), port_, EthercatBus::Encapsulation::payload);
  if (passage.exit == EthercatBus::Exit::lost) return;
  const auto later = std::upper_bound(returning_.begin(), returning_.end(), passage.leaves,
                                      [](Time at, const Returning& frame) { return at < frame.at; });
  returning_.insert(later, {passage.leaves, std::move(bytes)});
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
