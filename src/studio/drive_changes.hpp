#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "api/change_log.hpp"
#include "dictionary/dictionary.hpp"
#include "studio/recorded_objects.hpp"

namespace servodrome::studio {

// Writes that another thread carries out, on their way to the change log.
class HandedWrites {
 public:
  // Keeps the writes, for the thread that carries them out.
  RecordedObjects::Record record();

 private:
  friend class DriveChanges;
  struct Write {
    master::ObjectAddress object;
    RecordedObjects::Bytes before;
    RecordedObjects::Bytes after;
  };
  std::mutex mutex_;
  std::vector<Write> writes_;
};

// Notes what this program writes to drives on buses, and what other masters of a CAN bus write by SDO.
class DriveChanges {
 public:
  struct Drive {
    std::string name;
    const dictionary::Dictionary* dictionary;  // of its product; must outlive this object
  };

  // `now` is the time of the changes, `wall_epoch` the wall-clock time of its 0.
  DriveChanges(const std::vector<Drive>& drives, std::function<master::Time()> now, master::Time wall_epoch);

  api::ChangeLog& log() { return log_; }

  // The objects with a record of each write by the author that the calling thread works for. `drive` is an index.
  std::unique_ptr<master::ObjectClient> recorded(std::size_t drive, std::unique_ptr<master::ObjectClient> objects);
  // Notes the writes that another thread has carried out meanwhile.
  void take(std::size_t drive, HandedWrites& handed);
  // Notes a write of another master. The value before is not known.
  void note_foreign(std::size_t drive, master::ObjectAddress object, const RecordedObjects::Bytes& after,
                    std::string_view who) {
    note(drive, object, {}, after, who);
  }

 private:
  void note(std::size_t drive, master::ObjectAddress object, const RecordedObjects::Bytes& before,
            const RecordedObjects::Bytes& after, std::string_view who);
  const dictionary::Entry& entry_of(std::size_t drive, master::ObjectAddress object);

  std::vector<Drive> drives_;
  std::function<master::Time()> now_;
  master::Time wall_epoch_;
  api::ChangeLog log_;
  std::map<std::pair<std::size_t, master::ObjectAddress>, dictionary::Entry> unknown_;  // objects that are in no table
};

}  // namespace servodrome::studio
