#pragma once

#include "links/pty.hpp"
#include "links/serial/stream_link.hpp"

namespace servodrome::links {

// `pty:PATH`: a pty at PATH. Programs may open it one after the other.
class PtyLink final : public StreamLink {
 public:
  PtyLink(const PtyName& name, SerialLine& line, boost::asio::io_context& io, LineHost& host);

  std::string name() const override { return to_string(name_); }

 private:
  PtyLink(const PtyName& name, std::unique_ptr<Pty> pty, SerialLine& line, boost::asio::io_context& io, LineHost& host);

  void lost() override;
  void look_for_client() override;
  void wait_for_client();

  PtyName name_;
  std::unique_ptr<Pty> pty_;
};

}  // namespace servodrome::links
