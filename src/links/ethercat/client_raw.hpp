#pragma once

#include "links/ethercat/client.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/ethercat/packet_socket.hpp"

namespace servodrome::links {

// Sends Ethernet frames on an interface. The source address is random for each client, so that it can tell its frames
// from those of other masters. Slave controllers set one bit of it (locally administered), which the client ignores.
class RawEthercatClient final : public EthercatClient {
 public:
  explicit RawEthercatClient(const RawName& name);

  void send(std::span<const std::uint8_t> content) override;
  std::size_t receive(std::span<std::uint8_t> into, Time timeout) override;
  Time now() const override;
  void wait(Time span) override;
  std::string name() const override { return to_string(name_); }

 private:
  std::size_t take(std::span<std::uint8_t> into);
  [[noreturn]] void lost(int reason) const;

  RawName name_;
  PacketSocket socket_;
  std::array<std::uint8_t, 6> source_{};
  std::array<std::uint8_t, 14 + most_ethercat_content> outgoing_{};
};

}  // namespace servodrome::links
