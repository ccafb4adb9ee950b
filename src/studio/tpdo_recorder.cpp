#include "studio/tpdo_recorder.hpp"

#include <algorithm>

#include "studio/drive_bus.hpp"

namespace servodrome::studio {
namespace {

constexpr std::uint8_t most_tpdos = 8;  // that master::CanCyclicBus sets up
constexpr std::uint8_t every_sync = 1;
constexpr std::uint32_t not_in_use = 0x80000000U;

// What master::CanCyclicBus makes of a TPDO: one with these objects at every SYNC, or off.
master::PdoParameters changed(master::PdoParameters pdo, const std::vector<std::vector<master::PdoObject>>& wanted) {
  if (pdo.number >= wanted.size()) {
    pdo.cob_id |= not_in_use;
    return pdo;
  }
  pdo.transmission_type = every_sync;
  pdo.mapping.clear();
  for (const master::PdoObject& its : wanted[pdo.number]) {
    pdo.mapping.push_back(static_cast<std::uint32_t>(its.object.index) << 16U |
                          static_cast<std::uint32_t>(its.object.sub) << 8U | its.bits);
  }
  return pdo;
}

bool is_still(const master::PdoParameters& now, const master::PdoParameters& during) {
  return now.transmission_type == during.transmission_type && now.mapping == during.mapping;
}

bool is_same(const master::PdoParameters& a, const master::PdoParameters& b) {
  return a.cob_id == b.cob_id && is_still(a, b);
}

}  // namespace

void TpdoRecorder::begin(OpenBus& open, const Wish& wish, const std::function<void()>& between) {
  if (running_ && !running_->wanted.expired()) {
    throw master::MasterError("another recording has set up the TPDOs of this bus", "this bus", "wait for its end");
  }
  end();
  std::map<std::size_t, std::vector<Changed>> left;
  std::vector<master::CanDrive> exchanged;
  std::vector<std::size_t> members;
  for (const Drive& its : wish.drives) {
    if (must_restore(its.drive)) restore(open, its.drive, between);
    const auto& wanted = its.exchanged.tpdos;
    for (std::uint8_t number = 0; number < most_tpdos; ++number) {
      between();
      const std::size_t entries = number < wanted.size() ? wanted[number].size() : 0;
      const auto before = master::read_pdo(*open.drives()[its.drive], true, number, entries);
      if (!before) break;
      left[its.drive].push_back({*before, changed(*before, wanted)});
    }
    exchanged.push_back(its.exchanged);
    members.push_back(its.drive);
  }
  left_.merge(left);
  running_ = std::make_unique<Running>(Running{open.record(exchanged, wish.period, between), members, wish.wanted});
  cycle_.attach(running_->bus.get(), members);
}

bool TpdoRecorder::is_over() const {
  if (!running_) return false;
  try {
    running_->bus->check();
  } catch (const master::MasterError&) {
    return true;
  }
  return running_->wanted.expired();
}

bool TpdoRecorder::has(std::size_t drive) const {
  return running_ && std::find(running_->drives.begin(), running_->drives.end(), drive) != running_->drives.end();
}

void TpdoRecorder::end() {
  if (!running_) return;
  cycle_.attach(nullptr);
  try {
    running_->bus->close();
    for (const std::size_t drive : running_->drives) left_.erase(drive);
  } catch (const std::exception&) {
    // A drive does not answer: restore() follows.
  }
  running_.reset();
  pdos_.forget(links::steady_now());
}

void TpdoRecorder::restore(OpenBus& open, std::size_t drive, const std::function<void()>& between) {
  master::ObjectClient& objects = *open.drives()[drive];
  bool is_pre_operational = false;
  for (Changed& its : left_.at(drive)) {
    between();
    const auto now = master::read_pdo(objects, true, its.before.number);
    // A drive that was switched off has its own TPDOs again.
    const bool is_changed = now && !is_same(*now, its.before) && (its.is_begun || is_still(*now, its.during));
    if (!is_changed) continue;
    if (!std::exchange(is_pre_operational, true)) open.to_pre_operational(drive);
    its.is_begun = true;
    master::write_pdo(objects, its.before);
  }
  left_.erase(drive);
}

}  // namespace servodrome::studio
