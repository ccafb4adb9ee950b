#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "links/time.hpp"

namespace servodrome::links {

// The master's end of an EtherCAT link, for host tools: frames' contents go out and come back, from the two bytes of
// the EtherCAT header on (ETG.1000.4 clause 5.3.3); Ethernet or UDP around them is the client's. At most 1500 bytes
// each way. Not for use from several threads at once.
class EthercatClient {
 public:
  virtual ~EthercatClient() = default;
  // Several frames may be on their way. Throws LinkError if the link is lost or does not take the frame.
  virtual void send(std::span<const std::uint8_t> content) = 0;
  // The content of the next frame that is back, waiting for it at most `timeout` (0: look and return). Returns its
  // size, 0 if none came. What does not fit is cut off; padding behind the EtherCAT frame may follow it. Answers to
  // others are skipped. Throws LinkError if the link is lost.
  virtual std::size_t receive(std::span<std::uint8_t> into, Time timeout) = 0;
  // The master's clock, monotonic: CLOCK_MONOTONIC, or virtual time (`mem:`).
  virtual Time now() const = 0;
  // Lets `span` pass. Frames that come meanwhile wait for receive().
  virtual void wait(Time span) = 0;
  virtual std::string name() const = 0;
};

inline constexpr std::size_t most_ethercat_content = 1500;
// Throws LinkError for more than that.
void check_content_size(std::size_t size, const std::string& link);

// Opens `raw:INTERFACE` or `udp:HOST:PORT` as a client (link_name.hpp). Throws LinkError. `mem:` is a
// MemoryEthercatClient (memory_client.hpp).
std::unique_ptr<EthercatClient> open_ethercat_client(std::string_view link);

}  // namespace servodrome::links
