#pragma once

#include <deque>
#include <functional>

#include "app/drive_link.hpp"
#include "app/interrupt_guard.hpp"
#include "studio/drive_bus.hpp"

namespace servodrome::app {

// Several drives on one --bus.
class DriveGroup {
 public:
  struct Member {
    unsigned node = 0;         // 0: the node of --node, or the only one
    std::string product = {};  // "": asked from the drive, or --product
    bool is_watched = true;    // on CANopen: monitors this program's heartbeat
    // On EtherCAT: of the only slave that may be at this position; nullopt: any.
    std::optional<master::EthercatIdentity> identity{};
  };

  // EtherCAT slaves go to OP together, and stay there as long as this object lives and waits; their axes stop when the
  // cycles cease (master::LostMasterReaction). CANopen drives monitor this program's heartbeat as long as this object
  // lives (master::MasterWatch), unless the options disable it. Each axis gets `cancelled` (master::AxisOptions).
  // Throws Failure if a drive cannot be determined, MasterError if the link cannot be opened or a drive does not
  // answer.
  DriveGroup(const BusOptions& options, const std::vector<Member>& members,
             std::function<bool()> cancelled = InterruptGuard::interrupted);

  const std::vector<master::Axis402*>& axes() const { return pointers_; }
  // Call it when a drive has come back, maybe from a reset: a CANopen drive monitors the heartbeat again, and 6007h of
  // an EtherCAT drive is written again. Throws MasterError.
  void renew_watch(std::size_t axis);
  // True if the drive has restarted and no longer monitors this program's heartbeat: call renew_watch().
  bool has_lost_watch(std::size_t axis) const { return watch_ && watch_->has_restarted(*objects_[axis]); }
  // Restores what the monitoring has changed in the drive; renew_watch() sets it again.
  void release_watch(std::size_t axis);
  // Time without this program after which the axis begins to stop by itself; empty: it does not stop.
  std::optional<master::Time> watched_within(std::size_t axis) const;
  // True for EtherCAT slaves in OP. A slave that leaves OP while its motor is on goes to fault, so disable it before.
  bool operates() const { return operation_.has_value(); }
  // Exchanges process data at a fixed rate: on CANopen those of the drive in `on_can`, every millisecond; on EtherCAT
  // those that all slaves map. Throws MasterError on a bus without process data.
  std::unique_ptr<master::CyclicBus> open_cyclic(const master::CanDrive& on_can);
  // The cycle of EtherCAT slaves in OP, for a caller that only watches the inputs; nullptr on other buses. Valid until
  // configure().
  master::CyclicBus* cycle() { return watched_ ? &*watched_ : nullptr; }
  // Sets up TPDOs of these nodes and sends SYNC for a recording (studio::OpenBus::record). Throws MasterError.
  std::unique_ptr<master::CanCyclicBus> record(const std::vector<master::CanDrive>& drives, master::Time period,
                                               const std::function<void()>& between);
  void to_pre_operational(std::size_t axis);
  std::optional<bool> is_operational(std::size_t axis);
  // Runs `action` in a state in which the drive accepts changes of its process data: all EtherCAT slaves go to PREOP
  // for it. Then they operate with the change. If they cannot, runs `undo` and throws the reason. Afterwards the axes
  // on EtherCAT must not be used any more.
  using Action = std::function<void(master::ObjectClient& objects)>;
  void configure(std::size_t axis, const Action& action, const Action& undo);
  // On CAN, SDO transfers call `look` while they wait, and end with a MasterError as soon as it returns true.
  void while_waiting(const std::function<bool()>& look);
  // The devices that answer now. Throws MasterError; also on a serial line, where each missing station costs a second.
  std::vector<studio::OpenBus::Found> scan();
  // Calls `show` with the FMMUs and sync managers of the slaves; does nothing on other buses. Throws MasterError.
  using Registers = std::function<void(std::size_t axis, std::uint16_t station, std::uint16_t offset,
                                       std::span<const std::uint8_t> bytes)>;
  void show_process_data(const Registers& show);

 private:
  void open_can(const BusOptions& options, const std::vector<Member>& members);
  void open_modbus(const BusOptions& options, const std::vector<Member>& members, const std::string& link);
  void open_ethercat(const BusOptions& options, const std::vector<Member>& members);
  void operate();
  // If `product` is nullptr, reads the identity from the drive.
  void add_axis(std::unique_ptr<master::ObjectClient> objects, const line::Product* product);

  std::function<bool()> cancelled_;
  std::unique_ptr<DriveLink> single_;  // for a protocol with a single drive
  std::unique_ptr<master::Bus> bus_;
  std::unique_ptr<master::ModbusClient> modbus_;
  std::unique_ptr<master::EthercatMaster> ethercat_;
  std::vector<master::FoundSlave> segment_;
  std::vector<std::unique_ptr<master::EthercatSlave>> slaves_;
  std::deque<master::LostMasterReaction> reactions_;  // of the slaves; they end after the operation
  master::OperationOptions operation_options_{};
  std::optional<master::EthercatOperation> operation_;
  std::optional<master::EthercatCyclicBus> watched_;
  std::vector<std::unique_ptr<master::ObjectClient>> objects_;
  std::vector<master::SdoClient*> sdos_;  // the objects on CAN
  std::optional<master::MasterWatch> watch_;
  std::vector<std::unique_ptr<master::Axis402>> axes_;
  std::vector<master::Axis402*> pointers_;
};

}  // namespace servodrome::app
