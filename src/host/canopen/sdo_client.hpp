#pragma once

#include <cstring>
#include <type_traits>

#include "host/canopen/bus.hpp"
#include "host/canopen/sdo_transfer.hpp"
#include "host/error.hpp"

namespace servodrome::host {

// An SDO transfer failed: refused by the node (from_node) or given up here (protocol_timed_out and the like).
class SdoError : public HostError {
 public:
  SdoError(const std::string& bus, std::uint8_t node_id, ObjectAddress object, bool upload, AbortCode code,
           bool from_node);

  std::uint8_t node_id() const { return node_id_; }
  std::uint16_t index() const { return object_.index; }
  std::uint8_t sub() const { return object_.sub; }
  AbortCode code() const { return code_; }
  bool from_node() const { return from_node_; }
  // The object is not in the node's dictionary at all.
  bool object_is_absent() const {
    return code_ == AbortCode::object_does_not_exist || code_ == AbortCode::sub_index_does_not_exist;
  }

 private:
  std::uint8_t node_id_;
  ObjectAddress object_;
  AbortCode code_;
  bool from_node_;
};

struct SdoOptions {
  Time timeout = std::chrono::seconds(1);  // for each answer
  // How often an upload that got no answer is started again. A download is never repeated by itself: it may have
  // acted. Within a block transfer it is also how often the sub-block is acknowledged again.
  unsigned retries = 1;
};

// "6041:00"
std::string text_of(ObjectAddress object);

// The SDO client of one node, over the default channel (600h and 580h + node-ID). One transfer at a time; others on the
// bus go on being heard meanwhile. All calls throw SdoError, or HostError if the link is lost.
class SdoClient {
 public:
  SdoClient(Bus& bus, std::uint8_t node_id, const SdoOptions& options = {});

  std::vector<std::byte> upload(ObjectAddress object, SdoProtocol protocol = SdoProtocol::ordinary);
  void download(ObjectAddress object, std::span<const std::byte> data, SdoProtocol protocol = SdoProtocol::ordinary);

  // Numbers. A node may send fewer bytes than T has: the value is extended; more is an error.
  template <typename T>
  requires std::is_arithmetic_v<T> T read(std::uint16_t index, std::uint8_t sub = 0) {
    const std::vector<std::byte> bytes = upload({index, sub});
    check_size(bytes, sizeof(T), {index, sub});
    const bool negative = std::is_signed_v<T> && !bytes.empty() && std::to_integer<unsigned>(bytes.back()) >= 0x80;
    T value{};
    std::memset(&value, negative ? 0xFF : 0, sizeof value);
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), bytes.size());
    return value;
  }
  template <typename T>
  requires std::is_arithmetic_v<T>
  void write(std::uint16_t index, std::uint8_t sub, std::type_identity_t<T> value) {
    download({index, sub}, std::as_bytes(std::span(&value, 1)));
  }
  // A VISIBLE_STRING, without trailing zeros.
  std::string read_text(std::uint16_t index, std::uint8_t sub = 0);

  // The number, or nothing if the node does not have the object.
  template <typename T>
  std::optional<T> read_if_present(std::uint16_t index, std::uint8_t sub = 0) {
    try {
      return read<T>(index, sub);
    } catch (const SdoError& error) {
      if (error.object_is_absent()) return std::nullopt;
      throw;
    }
  }

  std::uint8_t node_id() const { return node_id_; }
  Bus& bus() { return bus_; }

 private:
  void run(SdoTransfer& transfer);
  void send_waiting(SdoTransfer& transfer);
  void check_size(const std::vector<std::byte>& bytes, std::size_t at_most, ObjectAddress object) const;

  Bus& bus_;
  std::uint8_t node_id_;
  SdoOptions options_;
};

}  // namespace servodrome::host
