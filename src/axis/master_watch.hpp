#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "master/canopen/master.hpp"
#include "master/object_client.hpp"

namespace servodrome::master {

// Usual node-ID of a master in the manuals' examples (Kinco, Table 9-17).
inline constexpr std::uint8_t master_node_id = 127;

// A watchdog by heartbeat. While this object exists, the drives monitor this master's heartbeat (1016h, CiA 301
// 7.2.8.3.2.2), so that an axis stops by itself if the cable is pulled or this program ends unexpectedly. Without it a
// CANopen drive would continue its last command. If a drive's abort connection option code (6007h, CiA 402) is 0, no
// action, it is set to 1, malfunction.
//
// The destructor restores both objects. Two kinds of drive keep the changed values until their next reset (neither
// object is stored): a drive that no longer answers, and a drive whose axis still moves, which then stops by itself
// when the heartbeat ceases.
//
// A drive is left unchanged if it has no consumer heartbeat time, refuses to have it written, or already monitors
// another master in any sub-index.
class MasterWatch {
 public:
  static constexpr Time heartbeat_period = std::chrono::milliseconds(250);
  static constexpr std::chrono::milliseconds longest_silence{1500};

  // Receives a sentence about each drive whose objects could not be restored.
  using Tell = std::function<void(const std::string& sentence)>;

  // Starts the supervision for the drives at `bus`; both must outlive this. Throws MasterError if a drive does not
  // answer.
  MasterWatch(Bus& bus, std::span<ObjectClient* const> drives, Tell tell = {});
  ~MasterWatch() { end(); }
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;

  // Sets the supervision up again for a drive that has come back, for example after a reset, which clears it. Throws
  // like the constructor.
  void renew(ObjectClient& drive);

  // Number of drives that monitor this master.
  std::size_t watched() const { return watching_.size(); }
  bool is_watching(const ObjectClient& drive) const;

 private:
  struct Watching {
    ObjectClient* drive;
    bool option_changed;
  };
  void begin(ObjectClient& drive);
  void beat();
  void end() noexcept;

  Tell tell_;
  Master master_;
  std::optional<Bus::Subscription> heartbeat_;
  std::vector<Watching> watching_;
};

}  // namespace servodrome::master
