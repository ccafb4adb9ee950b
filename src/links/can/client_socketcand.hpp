#pragma once

#include <array>

#include "links/can/client.hpp"
#include "links/can/link_name.hpp"
#include "links/can/socketcand_protocol.hpp"
#include "links/file_descriptor.hpp"

namespace servodrome::links {

// A client of a socketcand server, ours or the original, in raw mode.
class SocketcandClient final : public CanClient {
 public:
  SocketcandClient(const SocketcandName& name, std::chrono::milliseconds timeout);

  void send(const canopen::Frame& frame) override;
  std::optional<canopen::Frame> receive(Time timeout) override;
  Descriptor native_handle() const override { return socket_.get(); }

 private:
  void connect(Deadline deadline);
  void write(std::string_view text);
  bool next_element(Deadline deadline);
  void expect(std::string_view word, std::string_view step, Deadline deadline);
  [[noreturn]] void lost(int reason) const;

  SocketcandName name_;
  FileDescriptor socket_;
  std::array<char, 4096> input_{};
  std::string_view unread_;
  socketcand::ElementReader reader_;
};

}  // namespace servodrome::links
