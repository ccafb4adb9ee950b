#pragma once

#include "master/object_client.hpp"

namespace servodrome::master {

// Passes each call on to another client. A class that changes some of the calls derives from it.
class ForwardedObjects : public ObjectClient {
 public:
  // `target` must outlive this object.
  explicit ForwardedObjects(ObjectClient& target) : target_(&target) {}

  std::vector<std::byte> upload(ObjectAddress object) override { return target_->upload(object); }
  void download(ObjectAddress object, std::span<const std::byte> data) override { target_->download(object, data); }
  bool size_is_known() const override { return target_->size_is_known(); }
  std::optional<Emergency> latest_emergency() override { return target_->latest_emergency(); }
  Time now() const override { return target_->now(); }
  void wait(Time span) override { target_->wait(span); }
  std::uint16_t address() const override { return target_->address(); }
  std::string where() const override { return target_->where(); }

 protected:
  ForwardedObjects() = default;
  // All calls go to `target` from now on. Needed before the first call if the constructor got no target.
  void set_target(ObjectClient& target) { target_ = &target; }
  ObjectClient& target() const { return *target_; }

 private:
  void set_wait_limit(std::optional<Time> longest) override { target_->limit_wait(longest); }

  ObjectClient* target_ = nullptr;
};

}  // namespace servodrome::master
