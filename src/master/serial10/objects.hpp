#pragma once

#include "master/object_client.hpp"
#include "master/serial10/client.hpp"

namespace servodrome::master {

// Access to the objects of a drive by the iSMK's 10-byte protocol: numbers of up to 32 bits.
class Serial10Objects final : public ObjectClient {
 public:
  // `id` as in Serial10Client. `client` must outlive this.
  Serial10Objects(Serial10Client& client, std::uint8_t id) : client_(client), id_(id) {}

  std::vector<std::byte> upload(ObjectAddress object) override { return client_.upload(id_, object); }
  void download(ObjectAddress object, std::span<const std::byte> data) override { client_.download(id_, object, data); }
  Time now() const override { return client_.now(); }
  void wait(Time span) override { client_.wait(span); }
  std::uint16_t address() const override { return id_; }
  std::string where() const override { return client_.where(id_); }

 private:
  void set_wait_limit(std::optional<Time> longest) override { client_.limit_wait(longest); }

  Serial10Client& client_;
  std::uint8_t id_;
};

}  // namespace servodrome::master
