#pragma once

#include "links/can/client.hpp"
#include "links/can/link_name.hpp"
#include "links/file_descriptor.hpp"

namespace servodrome::links {

// A client on a CAN interface of this computer (SocketCAN).
class SocketcanClient final : public CanClient {
 public:
  explicit SocketcanClient(const SocketcanName& name);

  void send(const canopen::Frame& frame) override;
  std::optional<canopen::Frame> receive(Time timeout) override;
  Descriptor native_handle() const override { return socket_.get(); }

 private:
  [[noreturn]] void lost(int reason) const;

  SocketcanName name_;
  FileDescriptor socket_;
};

}  // namespace servodrome::links
