#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host/canopen/master.hpp"
#include "host/object_client.hpp"

namespace servodrome::host {

// The node-ID that the manuals' examples give a master (Kinco, Table 9-17).
inline constexpr std::uint8_t master_node_id = 127;

// As long as it lives, drives watch this master's heartbeat (1016h, CiA 301 7.2.8.3.2.2), so that an axis stops by
// itself when the cable is pulled or this program dies: a CANopen drive otherwise goes on with its last order. A drive
// whose abort connection option code (6007h, CiA 402) is 0, no action, is told that the loss is a malfunction (1).
// Afterwards both objects are what they were. A drive that does not answer any more then keeps them until its next
// reset: neither is stored. So does one that still moves then, whatever ended the program: it stops by itself when the
// heartbeat ceases.
//
// A drive is left as it is if it has no consumer heartbeat time, refuses it, or watches another master already, in
// whichever sub-index.
class MasterWatch {
 public:
  static constexpr Time heartbeat_period = std::chrono::milliseconds(250);
  static constexpr std::chrono::milliseconds longest_silence{1500};

  // Hears a sentence on each drive that could not be given back what it had.
  using Tell = std::function<void(const std::string& sentence)>;

  // Of the drives at `bus`; both outlive this. Throws HostError if one does not answer.
  MasterWatch(Bus& bus, std::span<ObjectClient* const> drives, Tell tell = {});
  ~MasterWatch() { end(); }
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;

  // One of the drives has come back, maybe from a reset, after which it watches no node. Throws as the constructor.
  void renew(ObjectClient& drive);

  // So many of the drives watch.
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

}  // namespace servodrome::host
