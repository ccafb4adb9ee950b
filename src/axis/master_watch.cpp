#include "axis/master_watch.hpp"

#include <algorithm>
#include <cstdlib>
#include <fmt/format.h>

#include "axis/axis402.hpp"

namespace servodrome::master {
namespace {

constexpr std::uint16_t consumer_heartbeat_time = 0x1016;
constexpr std::uint16_t abort_connection_option = 0x6007;
constexpr std::int16_t no_action = 0;
constexpr std::int16_t malfunction = 1;
constexpr std::uint32_t ours =
    std::uint32_t{master_node_id} << 16 | static_cast<std::uint32_t>(MasterWatch::longest_silence.count());

// True if the drive has a consumer heartbeat time that monitors no node, or this master. The latter is left over from a
// program whose connection was lost.
bool is_free(ObjectClient& drive) {
  const auto entries = drive.read_if_present<std::uint8_t>(consumer_heartbeat_time, 0).value_or(0);
  for (unsigned sub = 1; sub <= entries; ++sub) {
    const auto watched =
        drive.read_if_present<std::uint32_t>(consumer_heartbeat_time, static_cast<std::uint8_t>(sub)).value_or(0);
    if (watched != 0 && watched != ours) return false;
  }
  return entries > 0;
}

// Compares positions, because 606Ch is noisy and not every drive has it.
bool moves(ObjectClient& drive) {
  constexpr std::int64_t still_counts = 10;
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
    : tell_(std::move(tell)), master_(bus) {
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
  heartbeat_.emplace(master_.produce_heartbeat(master_node_id, heartbeat_period, NmtState::operational));
}

void MasterWatch::begin(ObjectClient& drive) {
  try {
    if (!is_free(drive)) return;
    drive.write<std::uint32_t>(consumer_heartbeat_time, 1, ours);
    watching_.push_back({&drive, false});
    if (drive.read_if_present<std::int16_t>(abort_connection_option) == no_action) {
      drive.write<std::int16_t>(abort_connection_option, 0, malfunction);
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

bool MasterWatch::is_watching(const ObjectClient& drive) const {
  return std::any_of(watching_.begin(), watching_.end(), [&](const auto& its) { return its.drive == &drive; });
}

void MasterWatch::end() noexcept {
  for (const Watching& watching : watching_) {
    bool freed = false;
    try {
      if (moves(*watching.drive)) {
        if (tell_)
          tell_(fmt::format("{}: the axis still moves; it stops when the drive misses this program's heartbeat",
                            watching.drive->where()));
        continue;
      }
      watching.drive->write<std::uint32_t>(consumer_heartbeat_time, 1, 0);
      freed = true;
      if (watching.option_changed) watching.drive->write<std::int16_t>(abort_connection_option, 0, no_action);
    } catch (const MasterError&) {
      if (!tell_) continue;
      // If the drive does not answer, the code that uses the drive reports the reason. This function reports only the
      // objects that keep their values.
      const std::string watch = freed ? "" : fmt::format("1016h:01 = {:08X}h", ours);
      const std::string option = watching.option_changed ? fmt::format("6007h = {}", malfunction) : "";
      tell_(fmt::format("{}: {}{}{} could not be restored and stays until the drive's next reset",
                        watching.drive->where(), watch, !watch.empty() && !option.empty() ? " and " : "", option));
    }
  }
  watching_.clear();
}

}  // namespace servodrome::master
