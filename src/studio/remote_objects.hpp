#pragma once

#include "studio/drive_bus.hpp"

namespace servodrome::studio {

// Access to the objects of a drive from a thread other than that of its bus. Waiting lets other tasks run.
class RemoteObjects final : public master::ObjectClient {
 public:
  using Now = std::function<master::Time()>;

  // `bus` must outlive this object.
  RemoteObjects(DriveBus& bus, std::size_t drive, std::string name, Now now, Drives::Wait wait)
      : bus_(bus), drive_(drive), name_(std::move(name)), now_(std::move(now)), wait_(std::move(wait)) {}

  std::vector<std::byte> upload(master::ObjectAddress object) override { return access(object, false, {}); }
  void download(master::ObjectAddress object, std::span<const std::byte> data) override {
    access(object, true, {data.begin(), data.end()});
  }
  bool size_is_known() const override { return size_is_known_; }
  master::Time now() const override { return now_(); }
  void wait(master::Time span) override { wait_(now_() + span); }
  std::uint16_t address() const override { return static_cast<std::uint16_t>(bus_.plan().drives[drive_].address); }
  std::string where() const override { return name_; }

 private:
  void set_wait_limit(std::optional<master::Time> longest) override { longest_wait_ = longest; }
  std::vector<std::byte> access(master::ObjectAddress object, bool writes, std::vector<std::byte> bytes);

  DriveBus& bus_;
  std::size_t drive_;
  std::string name_;
  Now now_;
  Drives::Wait wait_;
  bool size_is_known_ = true;  // of the last upload
  std::optional<master::Time> longest_wait_{};
};

}  // namespace servodrome::studio
