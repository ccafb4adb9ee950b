#pragma once

#include "master/object_client.hpp"

namespace servodrome::master::test {

// The objects of a drive. A test derives from it to change some answers or writes.
class ChangedDrive : public ObjectClient {
 public:
  explicit ChangedDrive(ObjectClient& drive) : drive_(drive) {}

  std::vector<std::byte> upload(ObjectAddress object) override { return drive_.upload(object); }
  void download(ObjectAddress object, std::span<const std::byte> data) override { drive_.download(object, data); }
  Time now() const override { return drive_.now(); }
  void wait(Time span) override { drive_.wait(span); }
  std::uint16_t address() const override { return drive_.address(); }
  std::string where() const override { return drive_.where(); }

 private:
  void set_wait_limit(std::optional<Time> longest) override { drive_.limit_wait(longest); }

  ObjectClient& drive_;
};

}  // namespace servodrome::master::test
