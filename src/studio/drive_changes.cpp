#include "studio/drive_changes.hpp"

#include "api/author.hpp"

namespace servodrome::studio {
namespace {

std::vector<std::string> names_of(const std::vector<DriveChanges::Drive>& drives) {
  std::vector<std::string> names;
  for (const DriveChanges::Drive& drive : drives) names.push_back(drive.name);
  return names;
}

}  // namespace

RecordedObjects::Record HandedWrites::record() {
  return
      [this](master::ObjectAddress object, const RecordedObjects::Bytes& before, const RecordedObjects::Bytes& after) {
        const std::lock_guard lock(mutex_);
        writes_.push_back({object, before, after});
      };
}

DriveChanges::DriveChanges(const std::vector<Drive>& drives, std::function<master::Time()> now, master::Time wall_epoch)
    : drives_(drives), now_(std::move(now)), wall_epoch_(wall_epoch), log_(names_of(drives)) {}

std::unique_ptr<master::ObjectClient> DriveChanges::recorded(std::size_t drive,
                                                             std::unique_ptr<master::ObjectClient> objects) {
  return std::make_unique<RecordedObjects>(
      std::move(objects), [this, drive](master::ObjectAddress object, const RecordedObjects::Bytes& before,
                                        const RecordedObjects::Bytes& after) {
        if (before_own_) before_own_();
        note(drive, object, before, after, api::Author::present());
      });
}

std::shared_ptr<HandedWrites> DriveChanges::hand_out(std::size_t drive) {
  return handed_.emplace_back(std::make_shared<HandedWrites>(drive, api::Author::present()));
}

void DriveChanges::collect() {
  if (before_own_) before_own_();
  std::erase_if(handed_, [this](const std::shared_ptr<HandedWrites>& handed) {
    const bool over = handed.use_count() == 1;  // read first: afterwards the other thread writes nothing more
    std::vector<HandedWrites::Write> writes;
    {
      const std::lock_guard lock(handed->mutex_);
      writes.swap(handed->writes_);
    }
    for (const auto& write : writes) note(handed->drive_, write.object, write.before, write.after, handed->author_);
    return over;
  });
}

const dictionary::Entry& DriveChanges::entry_of(std::size_t drive, master::ObjectAddress object) {
  if (const dictionary::Entry* known = drives_[drive].dictionary->find(object.index, object.sub)) return *known;
  dictionary::Entry& entry = unknown_[{drive, object}];
  entry.index = object.index;
  entry.sub = object.sub;
  entry.type = dictionary::Type::domain;  // its bytes
  return entry;
}

void DriveChanges::note(std::size_t drive, master::ObjectAddress object, const RecordedObjects::Bytes& before,
                        const RecordedObjects::Bytes& after, std::string_view who) {
  api::Change change;
  change.at = now_();
  change.wall = wall_epoch_ + change.at;
  change.axis = static_cast<std::uint32_t>(drive);
  change.entry = &entry_of(drive, object);
  const dictionary::Entry* whole = drives_[drive].dictionary->find(object.index, 0);
  change.object_name = whole != nullptr ? whole->name : "";
  change.before = api::KeptValue(before);
  change.after = api::KeptValue(after);
  log_.add(change, who);
}

}  // namespace servodrome::studio
