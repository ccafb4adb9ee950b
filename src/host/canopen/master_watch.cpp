#include "host/canopen/master_watch.hpp"

namespace servodrome::host {
namespace {

constexpr std::uint16_t consumer_heartbeat_time = 0x1016;
constexpr std::uint16_t abort_connection_option = 0x6007;
constexpr std::int16_t no_action = 0;
constexpr std::int16_t malfunction = 1;
constexpr std::uint32_t ours =
    std::uint32_t{master_node_id} << 16 | static_cast<std::uint32_t>(MasterWatch::longest_silence.count());

}  // namespace

MasterWatch::MasterWatch(Bus& bus, std::span<ObjectClient* const> drives) : master_(bus) {
  try {
    for (ObjectClient* drive : drives) begin(*drive);
  } catch (const HostError&) {
    end();
    throw;
  }
  // A drive watches from the first one it hears.
  if (!watching_.empty()) {
    heartbeat_ = master_.produce_heartbeat(master_node_id, heartbeat_period, NmtState::operational);
  }
}

void MasterWatch::begin(ObjectClient& drive) {
  try {
    const auto time = drive.read_if_present<std::uint32_t>(consumer_heartbeat_time, 1);
    // Ours is what a program left behind whose cable was pulled.
    if (!time || (*time != 0 && *time != ours)) return;
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

void MasterWatch::end() {
  for (const Watching& watching : watching_) {
    try {
      watching.drive->write<std::uint32_t>(consumer_heartbeat_time, 1, 0);
      if (watching.option_changed) watching.drive->write<std::int16_t>(abort_connection_option, 0, no_action);
    } catch (const HostError&) {
      // Why it does not answer is told by whoever wanted something of it.
    }
  }
}

}  // namespace servodrome::host
