#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "master/canopen/master.hpp"
#include "master/object_client.hpp"

namespace servodrome::master {

// A watchdog by heartbeat. While this object exists, the drives monitor this master's heartbeat (1016h, CiA 301
// 7.2.8.3.2.2), so that an axis stops by itself if the cable is pulled or this program ends unexpectedly. Without it a
// CANopen drive would continue its last command. If a drive's abort connection option code (6007h, CiA 402) is 0, no
// action, it is set to 1, malfunction.
//
// The heartbeat has one of the node-IDs from 120 to 127, one that is silent, so that several programs on one bus send
// different heartbeats. To find it, the constructor listens for up to `listening_time`. Limits: two programs that begin
// in the same moment may choose the same node-ID; this is rare if their drives differ, because the search begins at a
// node-ID that depends on the first drive. The search does not notice a node that has such a node-ID but sends no
// heartbeat. Then two nodes have the same node-ID; only the heartbeats of this object contain it.
//
// The destructor restores both objects. Two kinds of drive keep the changed values until their next reset (neither
// object is stored): a drive that no longer answers, and a drive whose axis still moves, which then stops by itself
// when the heartbeat ceases.
//
// A drive is left unchanged if it has no consumer heartbeat time, refuses to have it written, or already monitors
// another master in any sub-index; also if all these node-IDs are in use. If 1016h has the value of a program like this
// one, and the heartbeat is silent, the program was killed or lost its link: its value is replaced.
class MasterWatch {
 public:
  static constexpr Time heartbeat_period = std::chrono::milliseconds(250);
  static constexpr std::chrono::milliseconds longest_silence{1500};
  // Without a heartbeat for this time (a period, and a delay of the sender), a node-ID is silent.
  static constexpr Time listening_time = heartbeat_period + std::chrono::milliseconds(50);
  // 127 is the usual node-ID of a master in the manuals' examples (Kinco, Table 9-17).
  static constexpr std::uint8_t highest_node_id = 127;
  static constexpr std::uint8_t lowest_node_id = 120;

  // Receives a sentence about each drive whose objects could not be restored.
  using Tell = std::function<void(const std::string& sentence)>;

  // Starts the supervision for the drives at `bus`; both must outlive this. Throws MasterError if a drive does not
  // answer.
  MasterWatch(Bus& bus, std::span<ObjectClient* const> drives, Tell tell = {});
  ~MasterWatch() { end(); }
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;

  // True if the drive has sent a boot-up since its supervision began: the restart has cleared 1016h.
  bool has_restarted(const ObjectClient& drive) const;
  // Sets the supervision up again for a drive that has restarted or come back. Throws like the constructor.
  void renew(ObjectClient& drive);
  // Restores one drive, as the destructor does, for example before it stores its objects. renew() starts its
  // supervision again.
  void release(ObjectClient& drive) noexcept;
  // Restores the drives, as the destructor does, and ends the heartbeat. renew() starts the supervision again.
  void end() noexcept;

  // Number of drives that monitor this master; one that has restarted counts until renew().
  std::size_t watched() const { return watching_.size(); }
  // The drive monitors this master.
  bool is_watching(const ObjectClient& drive) const;

 private:
  struct Watching {
    ObjectClient* drive;
    bool option_changed;
    unsigned boot_ups;  // of the node, when its supervision began
  };
  const Watching* find(const ObjectClient& drive) const;
  unsigned boot_ups(const ObjectClient& drive) const;
  void begin(ObjectClient& drive);
  void restore(const Watching& watching) noexcept;
  void tell(const std::string& sentence) noexcept;
  void beat();
  bool is_free(ObjectClient& drive);
  bool is_left_over(std::uint32_t entry);
  bool hears(std::uint8_t node_id);
  std::uint8_t silent_node_id();

  Tell tell_;
  Master master_;
  std::vector<ObjectClient*> drives_;
  Time listens_since_{};
  std::uint8_t node_id_ = 0;  // of this master's heartbeat; 0: not chosen yet
  std::optional<Bus::Subscription> heartbeat_;
  std::vector<Watching> watching_;
};

}  // namespace servodrome::master
