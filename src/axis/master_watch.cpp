#include "axis/master_watch.hpp"

#include <algorithm>
#include <cstdlib>
#include <fmt/format.h>

#include "axis/axis402.hpp"
#include "axis/cia402_words.hpp"
#include "axis/standstill.hpp"

namespace servodrome::master {
namespace {

constexpr std::uint16_t consumer_heartbeat_time = 0x1016;
constexpr auto monitored_ms = static_cast<std::uint32_t>(MasterWatch::longest_silence.count());

// The value of 1016h with which a drive monitors the heartbeat of this node-ID.
constexpr std::uint32_t entry_for(std::uint8_t node_id) { return std::uint32_t{node_id} << 16 | monitored_ms; }

// Compares positions, because 606Ch is noisy and not every drive has it.
bool moves(ObjectClient& drive) {
  constexpr Time between_looks = std::chrono::milliseconds(20);
  Axis402 axis(drive);
  const PowerState state = axis.state();
  if (state != PowerState::operation_enabled && state != PowerState::quick_stop_active) return false;
  const std::int64_t before = axis.position();
  drive.wait(between_looks);
  return std::abs(axis.position() - before) > still_counts;
}

}  // namespace

MasterWatch::MasterWatch(Bus& bus, std::span<ObjectClient* const> drives, Tell tell)
    : tell_(std::move(tell)), master_(bus), drives_(drives.begin(), drives.end()) {
  bus.drain();  // a waiting heartbeat may be of a program that has been killed since
  listens_since_ = bus.now();
  try {
    for (ObjectClient* drive : drives) begin(*drive);
  } catch (const MasterError&) {
    end();
    throw;
  }
  if (!watching_.empty()) beat();
}

// A drive starts its supervision with the first heartbeat that it receives.
void MasterWatch::beat() {
  heartbeat_.emplace(master_.produce_heartbeat(node_id_, heartbeat_period, NmtState::operational));
}

// True if a heartbeat with this node-ID has arrived within the last `listening_time`. The first calls wait until this
// object has listened for that time. Only other programs and nodes are heard: the bus does not deliver frames of this
// program.
bool MasterWatch::hears(std::uint8_t node_id) {
  Bus& bus = master_.bus();
  const NodeHealth& health = master_.health(node_id);
  return bus.run_until(listens_since_ + listening_time,
                       [&] { return health.heard > listens_since_ && health.heard + listening_time >= bus.now(); });
}

// Returns a node-ID that is silent and that no drive of this object has; 0: there is none. The search begins at a
// node-ID that depends on the first drive. So programs with different drives mostly choose different node-IDs, also if
// they begin in the same moment, or if a program begins while the drives of a killed program still wait for its next
// heartbeat.
std::uint8_t MasterWatch::silent_node_id() {
  constexpr unsigned candidates = highest_node_id - lowest_node_id + 1;
  const unsigned first = drives_.front()->address() - 1U;
  for (unsigned i = 0; i < candidates; ++i) {
    const auto id = static_cast<std::uint8_t>(highest_node_id - (first + i) % candidates);
    const bool is_drive =
        std::any_of(drives_.begin(), drives_.end(), [id](const ObjectClient* drive) { return drive->address() == id; });
    if (!is_drive && !hears(id)) return id;
  }
  return 0;
}

// True for the value of 1016h of a program that no longer sends its heartbeat.
bool MasterWatch::is_left_over(std::uint32_t entry) {
  const auto node_id = static_cast<std::uint8_t>(entry >> 16);
  return node_id >= lowest_node_id && node_id <= highest_node_id && entry == entry_for(node_id) && !hears(node_id);
}

// True if the drive has a consumer heartbeat time, and monitors neither a node nor another master.
bool MasterWatch::is_free(ObjectClient& drive) {
  const auto entries = drive.read_if_present<std::uint8_t>(consumer_heartbeat_time, 0).value_or(0);
  for (unsigned sub = 1; sub <= entries; ++sub) {
    const auto entry =
        drive.read_if_present<std::uint32_t>(consumer_heartbeat_time, static_cast<std::uint8_t>(sub)).value_or(0);
    const bool is_own = node_id_ != 0 && entry == entry_for(node_id_);
    if (entry != 0 && !is_own && !is_left_over(entry)) return false;
  }
  return entries > 0;
}

void MasterWatch::begin(ObjectClient& drive) {
  try {
    if (!is_free(drive)) return;
    if (node_id_ == 0) node_id_ = silent_node_id();
    if (node_id_ == 0) return;
    const unsigned boot_ups_before = boot_ups(drive);  // a restart after this point is noticed
    drive.write<std::uint32_t>(consumer_heartbeat_time, 1, entry_for(node_id_));
    watching_.push_back({&drive, false, boot_ups_before});
    if (drive.read_if_present<std::int16_t>(abort_connection_option) == no_action_at_abort) {
      drive.write<std::int16_t>(abort_connection_option, 0, malfunction_at_abort);
      watching_.back().option_changed = true;
    }
  } catch (const ObjectError& error) {
    if (!error.answered()) throw;
  }
}

void MasterWatch::renew(ObjectClient& drive) {
  const auto known =
      std::find_if(watching_.begin(), watching_.end(), [&](const auto& its) { return its.drive == &drive; });
  // Keep this flag: unless the drive was reset, 6007h still has the changed value, so begin() would not set the flag
  // again.
  const bool option_changed = known != watching_.end() && known->option_changed;
  if (known != watching_.end()) watching_.erase(known);
  begin(drive);
  if (option_changed && !watching_.empty() && watching_.back().drive == &drive) watching_.back().option_changed = true;
  if (!watching_.empty()) beat();
}

const MasterWatch::Watching* MasterWatch::find(const ObjectClient& drive) const {
  const auto found =
      std::find_if(watching_.begin(), watching_.end(), [&](const auto& its) { return its.drive == &drive; });
  return found == watching_.end() ? nullptr : &*found;
}

unsigned MasterWatch::boot_ups(const ObjectClient& drive) const {
  return master_.health(static_cast<std::uint8_t>(drive.address())).boot_ups;
}

bool MasterWatch::has_restarted(const ObjectClient& drive) const {
  const Watching* const its = find(drive);
  return its != nullptr && its->boot_ups != boot_ups(drive);
}

bool MasterWatch::is_watching(const ObjectClient& drive) const {
  return find(drive) != nullptr && !has_restarted(drive);
}

// An exception of the callback does not keep the other drives from being restored.
void MasterWatch::tell(const std::string& sentence) noexcept {
  try {
    if (tell_) tell_(sentence);
  } catch (...) {
    // The sentence is lost.
  }
}

void MasterWatch::restore(const Watching& watching) noexcept {
  const std::uint32_t own = entry_for(node_id_);
  bool freed = false;
  try {
    const auto entry = watching.drive->read<std::uint32_t>(consumer_heartbeat_time, 1);
    // After a reset of the drive another master may have written its entry: then that master needs 6007h, too.
    if (entry != own && entry != 0) return;
    if (entry == own) {
      if (moves(*watching.drive)) {
        tell(fmt::format("{}: the axis still moves; it stops when the drive misses this program's heartbeat",
                         watching.drive->where()));
        return;
      }
      watching.drive->write<std::uint32_t>(consumer_heartbeat_time, 1, 0);
    }
    freed = true;
    if (watching.option_changed) watching.drive->write<std::int16_t>(abort_connection_option, 0, no_action_at_abort);
  } catch (const MasterError&) {
    // If the drive does not answer, the code that uses the drive reports the reason. This function reports only the
    // objects that keep their values.
    const std::string watch = freed ? "" : fmt::format("1016h:01 = {:08X}h", own);
    const std::string option = watching.option_changed ? fmt::format("6007h = {}", malfunction_at_abort) : "";
    tell(fmt::format("{}: {}{}{} could not be restored and stays until the drive's next reset", watching.drive->where(),
                     watch, !watch.empty() && !option.empty() ? " and " : "", option));
  }
}

void MasterWatch::release(ObjectClient& drive) noexcept {
  for (const Watching& watching : watching_) {
    if (watching.drive == &drive) restore(watching);
  }
}

void MasterWatch::end() noexcept {
  for (const Watching& watching : watching_) restore(watching);
  watching_.clear();
  heartbeat_.reset();
  node_id_ = 0;
}

}  // namespace servodrome::master
