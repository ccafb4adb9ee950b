#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "api/change_log.hpp"
#include "axis/axis402.hpp"

namespace servodrome::studio {

// The objects of a drive on a bus, with a record of each write. Before a write it reads the present value. The words of
// a motion (api::ChangeLog::is_motion) pass without a record.
class RecordedObjects final : public master::ObjectClient {
 public:
  using Bytes = std::vector<std::byte>;
  // Gets a write that succeeded. `before` is empty if the object cannot be read.
  using Record = std::function<void(master::ObjectAddress object, const Bytes& before, const Bytes& after)>;

  // Owns `objects`, or uses them: then they must outlive this object.
  RecordedObjects(std::unique_ptr<master::ObjectClient> objects, Record record)
      : owned_(std::move(objects)), objects_(*owned_), record_(std::move(record)) {}
  RecordedObjects(master::ObjectClient& objects, Record record) : objects_(objects), record_(std::move(record)) {}

  Bytes upload(master::ObjectAddress object) override { return objects_.upload(object); }
  void download(master::ObjectAddress object, std::span<const std::byte> data) override;
  std::vector<std::vector<std::size_t>> read_together(std::span<const master::ObjectAddress> objects) const override {
    return objects_.read_together(objects);
  }
  std::vector<Bytes> upload_together(std::span<const master::ObjectAddress> objects) override {
    return objects_.upload_together(objects);
  }
  bool size_is_known() const override { return objects_.size_is_known(); }
  std::optional<master::Emergency> latest_emergency() override { return objects_.latest_emergency(); }
  master::Time now() const override { return objects_.now(); }
  void wait(master::Time span) override { objects_.wait(span); }
  std::uint16_t address() const override { return objects_.address(); }
  std::string where() const override { return objects_.where(); }

 private:
  std::unique_ptr<master::ObjectClient> owned_;
  master::ObjectClient& objects_;
  Record record_;
};

}  // namespace servodrome::studio
