#pragma once

#include "links/ethercat/client.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/file_descriptor.hpp"

namespace servodrome::links {

// Sends the contents of frames in UDP packets, from a UDP port of its own.
class UdpEthercatClient final : public EthercatClient {
 public:
  explicit UdpEthercatClient(const EthercatUdpName& name);

  void send(std::span<const std::uint8_t> content) override;
  std::size_t receive(std::span<std::uint8_t> into, Time timeout) override;
  Time now() const override;
  void wait(Time span) override;
  std::string name() const override { return to_string(name_); }

 private:
  [[noreturn]] void lost(int reason) const;

  EthercatUdpName name_;
  FileDescriptor socket_;
};

}  // namespace servodrome::links
