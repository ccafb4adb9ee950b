#pragma once

#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>

#include "dictionary/abort_code.hpp"
#include "links/heard_clients.hpp"
#include "master/object_client.hpp"
#include "master/wait_limit.hpp"
#include "serial10/frame.hpp"

namespace servodrome::master {

// A request of the 10-byte protocol failed: the drive refused it or did not answer (code() is protocol_timed_out).
class Serial10Error : public ObjectError {
 public:
  Serial10Error(const std::string& link, std::uint8_t id, std::uint16_t index, std::uint8_t sub,
                dictionary::AbortCode code, bool from_drive);

  dictionary::AbortCode code() const { return code_; }
  bool from_drive() const { return from_drive_; }

 private:
  dictionary::AbortCode code_;
  bool from_drive_;
};

struct Serial10Options {
  modbus::CharacterFormat format{.bit_rate = 115200, .parity = modbus::Parity::none};  // the iSMK's factory setting
  Time timeout = std::chrono::milliseconds(500);                                       // for an answer
  unsigned retries = 1;  // of reads only; a write without answer may have taken effect
  links::Heard heard{};  // observer of sent and received bytes
};

// Master for the iSMK's 10-byte protocol. One request at a time. All calls throw Serial10Error, or MasterError if the
// link cannot be opened or is lost.
class Serial10Client {
 public:
  // `name` appears in error messages.
  Serial10Client(std::unique_ptr<links::ByteClient> client, std::string name, const Serial10Options& options = {})
      : client_(std::move(client)), name_(std::move(name)), options_(options) {}
  // `link`: `pty:PATH` or `serial:DEVICE`.
  static Serial10Client open(const std::string& link, const Serial10Options& options = {});

  // `id`: number of the drive, or 127 if there is only one. If the object is shorter than T, the drive extends it.
  template <typename T>
  requires(std::is_integral_v<T> && sizeof(T) <= 4) T read(std::uint8_t id, std::uint16_t index, std::uint8_t sub = 0) {
    return static_cast<T>(request(id, serial10::Command::read, index, sub, 0, options_.retries).data());
  }
  // An object of 1, 2 or 4 bytes, in the drive's size.
  std::vector<std::byte> upload(std::uint8_t id, ObjectAddress object);
  void download(std::uint8_t id, ObjectAddress object, std::span<const std::byte> data);

  // As ObjectClient::limit_wait(), for all drives.
  void limit_wait(std::optional<Time> longest) { limit_.set(longest); }

  // Time on the link's clock.
  Time now() const { return client_->now(); }
  void wait(Time span) { client_->wait(span); }
  // Link and id, for error messages.
  std::string where(std::uint8_t id) const;

  // T must be the object's type.
  template <typename T>
  requires(std::is_integral_v<T> && sizeof(T) <= 4) void write(std::uint8_t id, std::uint16_t index, std::uint8_t sub,
                                                               std::type_identity_t<T> value) {
    constexpr auto command = sizeof(T) == 4   ? serial10::Command::write_4
                             : sizeof(T) == 2 ? serial10::Command::write_2
                                              : serial10::Command::write_1;
    request(id, command, index, sub, static_cast<std::uint32_t>(static_cast<std::make_unsigned_t<T>>(value)), 0);
  }

 private:
  serial10::Frame request(std::uint8_t id, serial10::Command command, std::uint16_t index, std::uint8_t sub,
                          std::uint32_t data, unsigned retries);
  std::optional<serial10::Frame> exchange(const serial10::Frame& request);

  std::unique_ptr<links::ByteClient> client_;
  std::string name_;
  Serial10Options options_;
  WaitLimit limit_{};
};

}  // namespace servodrome::master
