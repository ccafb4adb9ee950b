#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "api/change_log.hpp"
#include "master/forwarded_objects.hpp"

namespace servodrome::studio {

// The objects of a drive on a bus, with a record of each write. Before a write it reads the present value. The words of
// a motion (api::ChangeLog::is_motion) pass without a record.
class RecordedObjects final : public master::ForwardedObjects {
 public:
  using Bytes = std::vector<std::byte>;
  // Gets a write that succeeded. `before` is empty if the object cannot be read.
  using Record = std::function<void(master::ObjectAddress object, const Bytes& before, const Bytes& after)>;

  // Owns `objects`, or uses them: then they must outlive this object.
  RecordedObjects(std::unique_ptr<master::ObjectClient> objects, Record record)
      : ForwardedObjects(*objects), owned_(std::move(objects)), record_(std::move(record)) {}
  RecordedObjects(master::ObjectClient& objects, Record record)
      : ForwardedObjects(objects), record_(std::move(record)) {}

  void download(master::ObjectAddress object, std::span<const std::byte> data) override;
  std::vector<std::vector<std::size_t>> read_together(std::span<const master::ObjectAddress> objects) const override {
    return target().read_together(objects);
  }
  std::vector<Bytes> upload_together(std::span<const master::ObjectAddress> objects) override {
    return target().upload_together(objects);
  }

 private:
  std::unique_ptr<master::ObjectClient> owned_;
  Record record_;
};

}  // namespace servodrome::studio
