#include "links/heard_clients.hpp"

#include <type_traits>

namespace servodrome::links {
namespace {

class HeardCanClient final : public CanClient {
 public:
  HeardCanClient(std::unique_ptr<CanClient> client, Heard hear) : client_(std::move(client)), hear_(std::move(hear)) {}
  void send(const canopen::Frame& frame) override {
    client_->send(frame);
    tell(true, frame);
  }
  std::optional<canopen::Frame> receive(Time timeout) override {
    auto frame = client_->receive(timeout);
    if (frame) tell(false, *frame);
    return frame;
  }
  Descriptor native_handle() const override { return client_->native_handle(); }

 private:
  void tell(bool sent, const canopen::Frame& frame) const {
    static_assert(std::is_trivially_copyable_v<canopen::Frame>);
    hear_(sent, {reinterpret_cast<const std::uint8_t*>(&frame), sizeof frame});
  }

  std::unique_ptr<CanClient> client_;
  Heard hear_;
};

class HeardEthercatClient final : public EthercatClient {
 public:
  HeardEthercatClient(std::unique_ptr<EthercatClient> client, Heard hear)
      : client_(std::move(client)), hear_(std::move(hear)) {}
  void send(std::span<const std::uint8_t> content) override {
    client_->send(content);
    hear_(true, content);
  }
  std::size_t receive(std::span<std::uint8_t> into, Time timeout) override {
    const std::size_t size = client_->receive(into, timeout);
    if (size != 0) hear_(false, into.first(size));
    return size;
  }
  Time now() const override { return client_->now(); }
  void wait(Time span) override { client_->wait(span); }
  std::string name() const override { return client_->name(); }

 private:
  std::unique_ptr<EthercatClient> client_;
  Heard hear_;
};

class HeardByteClient final : public ByteClient {
 public:
  HeardByteClient(std::unique_ptr<ByteClient> client, Heard hear)
      : client_(std::move(client)), hear_(std::move(hear)) {}
  void send(std::span<const std::uint8_t> bytes) override {
    client_->send(bytes);
    hear_(true, bytes);
  }
  bool receive(std::vector<std::uint8_t>& bytes, Time timeout) override {
    const std::size_t before = bytes.size();
    const bool came = client_->receive(bytes, timeout);
    if (bytes.size() > before) hear_(false, std::span(bytes).subspan(before));
    return came;
  }
  Time now() const override { return client_->now(); }
  void wait(Time span) override { client_->wait(span); }

 private:
  std::unique_ptr<ByteClient> client_;
  Heard hear_;
};

template <typename Client, typename Interface>
std::unique_ptr<Interface> wrapped(std::unique_ptr<Interface> client, Heard hear) {
  if (!hear) return client;
  return std::make_unique<Client>(std::move(client), std::move(hear));
}

}  // namespace

std::unique_ptr<CanClient> heard(std::unique_ptr<CanClient> client, Heard hear) {
  return wrapped<HeardCanClient>(std::move(client), std::move(hear));
}
std::unique_ptr<EthercatClient> heard(std::unique_ptr<EthercatClient> client, Heard hear) {
  return wrapped<HeardEthercatClient>(std::move(client), std::move(hear));
}
std::unique_ptr<ByteClient> heard(std::unique_ptr<ByteClient> client, Heard hear) {
  return wrapped<HeardByteClient>(std::move(client), std::move(hear));
}

}  // namespace servodrome::links
