#include "links/serial/client.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <fmt/format.h>
#include <thread>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"
#include "links/serial/tty.hpp"
#include "links/socket_addresses.hpp"

namespace servodrome::links {
namespace {

constexpr auto send_timeout = std::chrono::seconds(1);

[[noreturn]] void fail(int reason, const std::string& name, std::string_view what, std::string_view advice) {
  const std::error_code code(reason, std::generic_category());
  throw LinkError(code, fmt::format("\"{}\": {} ({}); {}", name, what, code.message(), advice_for(reason, advice)));
}

class DescriptorClient final : public ByteClient {
 public:
  DescriptorClient(FileDescriptor descriptor, std::string name)
      : descriptor_(std::move(descriptor)), name_(std::move(name)) {}

  void send(std::span<const std::uint8_t> bytes) override {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (!write_all(descriptor_.get(), text, std::chrono::steady_clock::now() + send_timeout)) lost(errno);
  }

  bool receive(std::vector<std::uint8_t>& bytes, Time timeout) override {
    if (!wait_readable(descriptor_.get(), std::chrono::steady_clock::now() + timeout)) return false;
    std::array<std::uint8_t, 512> buffer{};
    const std::ptrdiff_t size = read_some(descriptor_.get(), buffer.data(), buffer.size());
    if (size == 0) lost(ECONNRESET);
    if (size < 0) {
      if (errno == EAGAIN || errno == EINTR) return false;
      lost(errno);
    }
    bytes.insert(bytes.end(), buffer.begin(), buffer.begin() + size);
    return true;
  }

  Time now() const override { return steady_now(); }
  void wait(Time span) override { std::this_thread::sleep_for(span); }

 private:
  [[noreturn]] void lost(int reason) const { fail(reason, name_, "the link is lost", "is the line still up?"); }

  FileDescriptor descriptor_;
  std::string name_;
};

FileDescriptor connect_to(const ModbusTcpName& name, std::chrono::milliseconds timeout) {
  const std::string text = to_string(name);
  const SocketAddresses addresses = resolve(name.endpoint, Transport::tcp);
  if (addresses.unknown != nullptr) {
    throw LinkError(std::make_error_code(std::errc::host_unreachable),
                    fmt::format("\"{}\": host \"{}\" is unknown ({}); check its name", text, name.endpoint.host,
                                addresses.unknown));
  }
  int reason = 0;
  FileDescriptor socket = connect_tcp(addresses, std::chrono::steady_clock::now() + timeout, reason);
  if (socket.is_open()) return socket;
  fail(reason, text, "cannot connect", "is the device or the line up, and does it listen at this address?");
}

struct OpenByteClient {
  const modbus::CharacterFormat& format;
  std::chrono::milliseconds connect_timeout;

  std::unique_ptr<ByteClient> operator()(const PtyName& name) const {
    return std::make_unique<DescriptorClient>(open_tty(name.path, format), to_string(name));
  }
  std::unique_ptr<ByteClient> operator()(const TtyName& name) const {
    return std::make_unique<DescriptorClient>(open_tty(name.device, format), to_string(name));
  }
  std::unique_ptr<ByteClient> operator()(const ModbusTcpName& name) const {
    return std::make_unique<DescriptorClient>(connect_to(name, connect_timeout), to_string(name));
  }
  std::unique_ptr<ByteClient> operator()(const MemName&) const { refuse_mem_client("serial", serial_schemes); }
};

}  // namespace

std::unique_ptr<ByteClient> open_byte_client(const SerialLinkName& name, const modbus::CharacterFormat& format,
                                             std::chrono::milliseconds connect_timeout) {
  return std::visit(OpenByteClient{format, connect_timeout}, name);
}

bool MemoryByteClient::receive(std::vector<std::uint8_t>& bytes, Time timeout) {
  const Time deadline = clock_.now() + timeout;
  while (received_.empty() && clock_.now() < deadline) clock_.step(deadline);
  bytes.insert(bytes.end(), received_.begin(), received_.end());
  const bool any = !received_.empty();
  received_.clear();
  return any;
}

void MemoryByteClient::wait(Time span) {
  const Time deadline = clock_.now() + span;
  while (clock_.now() < deadline) clock_.step(deadline);
}

void MemoryByteClient::receive(std::uint8_t character, bool /*intact*/, Time /*at*/) { received_.push_back(character); }

}  // namespace servodrome::links
