#include "links/serial_stream.hpp"

#include <array>
#include <boost/asio/serial_port.hpp>
#include <boost/asio/write.hpp>

#include "links/serial/tty.hpp"

namespace servodrome::links {
namespace {

using boost::system::error_code;

constexpr std::uint32_t adapter_bit_rate = 115'200;

// Asio reads and writes a port of Windows without blocking.
class PortStream final : public SerialStream {
 public:
  PortStream(FileDescriptor port, boost::asio::io_context& io, Owner& owner)
      : owner_(owner), port_(io, reinterpret_cast<boost::asio::serial_port::native_handle_type>(port.release())) {}
  PortStream(const PortStream&) = delete;
  PortStream& operator=(const PortStream&) = delete;
  ~PortStream() override { *alive_ = false; }

  bool is_open() const override { return is_open_; }
  std::size_t unwritten() const override { return waiting_.size() + writing_.size(); }
  // A pending read takes the bytes as they come.
  bool settled() override { return true; }

  void read(std::size_t most) override {
    port_.async_read_some(boost::asio::buffer(input_.data(), most),
                          [this, alive = alive_](error_code code, std::size_t size) {
                            if (!*alive) return;
                            if (!code) {
                              owner_.on_bytes({input_.data(), size});
                              return;
                            }
                            is_open_ = false;
                            waiting_.clear();
                            error_code ignored;
                            port_.cancel(ignored);
                            owner_.on_close();
                          });
  }

  void write(std::string_view bytes) override {
    waiting_ += bytes;
    if (writing_.empty()) flush();
  }

 private:
  void flush() {
    std::swap(writing_, waiting_);
    boost::asio::async_write(port_, boost::asio::buffer(writing_),
                             [this, alive = alive_](error_code code, std::size_t) {
                               if (!*alive) return;
                               writing_.clear();
                               if (code) return;  // the pending read fails as well and handles it
                               if (!waiting_.empty()) flush();
                               owner_.on_written();
                             });
  }

  Owner& owner_;
  boost::asio::serial_port port_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::array<char, most_at_once> input_{};
  std::string writing_;
  std::string waiting_;
  bool is_open_ = true;
};

}  // namespace

std::unique_ptr<SerialStream> open_tty_stream(FileDescriptor tty, boost::asio::io_context& io,
                                              SerialStream::Owner& owner) {
  return std::make_unique<PortStream>(std::move(tty), io, owner);
}

std::unique_ptr<SerialStream> open_adapter_stream(const std::string& path, boost::asio::io_context& io,
                                                  SerialStream::Owner& owner) {
  return open_tty_stream(open_tty(path, {.bit_rate = adapter_bit_rate}), io, owner);
}

}  // namespace servodrome::links
