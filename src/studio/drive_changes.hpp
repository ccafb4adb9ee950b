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

// A queue of the writes that another thread carries out. DriveChanges::collect() moves them to the change log.
class HandedWrites {
 public:
  HandedWrites(std::size_t drive, std::string author) : drive_(drive), author_(std::move(author)) {}
  // Keeps the writes, for the thread that carries them out. This object must outlive the result.
  RecordedObjects::Record record();

 private:
  friend class DriveChanges;
  struct Write {
    master::ObjectAddress object;
    RecordedObjects::Bytes before;
    RecordedObjects::Bytes after;
  };
  std::size_t drive_;
  std::string author_;
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
  // For writes that another thread carries out for the present author; collect() notes them, also after the author has
  // left, as long as that thread holds the result.
  std::shared_ptr<HandedWrites> hand_out(std::size_t drive);
  void collect();
  // Sets a callback before each own write is noted: it notes the earlier writes of others.
  void before_each_own(std::function<void()> callback) { before_own_ = std::move(callback); }
  // Notes a write. `before` is empty if it is not known.
  void note(std::size_t drive, master::ObjectAddress object, const RecordedObjects::Bytes& before,
            const RecordedObjects::Bytes& after, std::string_view who);

 private:
  const dictionary::Entry& entry_of(std::size_t drive, master::ObjectAddress object);

  std::vector<Drive> drives_;
  std::function<master::Time()> now_;
  master::Time wall_epoch_;
  api::ChangeLog log_;
  std::vector<std::shared_ptr<HandedWrites>> handed_;
  std::function<void()> before_own_;
  std::map<std::pair<std::size_t, master::ObjectAddress>, dictionary::Entry> unknown_;  // objects that are in no table
};

}  // namespace servodrome::studio
