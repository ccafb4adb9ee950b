#pragma once

#include <array>
#include <string>

#include "links/can/client.hpp"
#include "links/can/link_name.hpp"
#include "links/file_descriptor.hpp"

namespace servodrome::links {

// The host's end of a serial CAN adapter (LAWICEL protocol) on a tty or pty. A real serial port runs at 115200 baud.
class SlcanClient final : public CanClient {
 public:
  SlcanClient(const SlcanName& name, const CanClientOptions& options);
  ~SlcanClient() override;  // closes the channel
  SlcanClient(const SlcanClient&) = delete;
  SlcanClient& operator=(const SlcanClient&) = delete;

  void send(const canopen::Frame& frame) override;
  std::optional<canopen::Frame> receive(Time timeout) override;
  Descriptor native_handle() const override { return tty_.get(); }

 private:
  void open_tty();
  void command(std::string_view line, Deadline deadline);
  void write(std::string_view text);
  bool next_line(Deadline deadline);
  [[noreturn]] void fail(std::error_code code, std::string_view what, std::string_view advice) const;

  static constexpr std::size_t longest_line = 32;

  SlcanName name_;
  FileDescriptor tty_;
  std::array<char, 1024> input_{};
  std::string_view unread_;
  std::string line_;         // without CR or BEL
  bool line_ended_ = false;  // line_ is complete
  bool ended_in_bell_ = false;
};

}  // namespace servodrome::links
