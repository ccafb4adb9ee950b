#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "links/time.hpp"

namespace servodrome::links {

// The master's end of an EtherCAT link, for host tools. It sends and receives the contents of frames, which begin with
// the two bytes of the EtherCAT header (ETG.1000.4 clause 5.3.3) and have at most 1500 bytes; the client adds and
// removes Ethernet or UDP headers. Not thread-safe.
class EthercatClient {
 public:
  virtual ~EthercatClient() = default;
  // Sends without waiting for an answer, so several frames may be on their way. Throws LinkError if the link is lost or
  // does not accept the frame.
  virtual void send(std::span<const std::uint8_t> content) = 0;
  // Waits at most `timeout` (0: does not wait) for the next frame that comes back and copies its content to `into`.
  // Returns its size, 0 if none came. A content that does not fit is cut off; padding may follow the EtherCAT frame.
  // Skips answers to other masters. Throws LinkError if the link is lost.
  virtual std::size_t receive(std::span<std::uint8_t> into, Time timeout) = 0;
  // The master's clock, monotonic: CLOCK_MONOTONIC, or virtual time (`mem:`).
  virtual Time now() const = 0;
  // Waits for `span`. Frames that come meanwhile wait for receive().
  virtual void wait(Time span) = 0;
  virtual std::string name() const = 0;
};

inline constexpr std::size_t most_ethercat_content = 1500;
// Throws LinkError if `size` is larger than most_ethercat_content; `link` is the name in the message.
void check_content_size(std::size_t size, const std::string& link);

// Opens `raw:INTERFACE` or `udp:HOST:PORT` as a client (link_name.hpp). Throws LinkError, also for `mem:`, whose client
// is MemoryEthercatClient (memory_client.hpp).
std::unique_ptr<EthercatClient> open_ethercat_client(std::string_view link);

}  // namespace servodrome::links
