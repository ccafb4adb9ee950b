#pragma once

#include "app/drive_link.hpp"

namespace servodrome::app {

// Several drives behind one --bus.
class DriveGroup {
 public:
  struct Member {
    unsigned node = 0;         // 0: that of --node, or the only one there is
    std::string product = {};  // "": as the drive or --product says
  };

  // EtherCAT slaves go to OP, together, and stay there as long as this lives and waits; CANopen drives watch this
  // program's heartbeat as long (host::MasterWatch), unless the options say no. Throws Failure if a drive
  // cannot be told, HostError if the link cannot be opened or a drive does not answer.
  DriveGroup(const BusOptions& options, const std::vector<Member>& members);

  const std::vector<host::Axis402*>& axes() const { return pointers_; }
  // A drive has come back, maybe from a reset: a CANopen drive then watches as before. Throws HostError.
  void renew_watch(std::size_t axis);
  // After so long without this program an axis begins to stop by itself; nothing: it goes on.
  std::optional<host::Time> watched_within(std::size_t axis) const;
  // A slave that leaves OP with its motor on takes that for a fault: disable first.
  bool operates() const { return operation_.has_value(); }
  // Process data at a fixed rate: of the one CANopen drive that `on_can` names, each millisecond, or of all EtherCAT
  // slaves as they map them. Throws HostError on a bus that has none.
  std::unique_ptr<host::CyclicBus> open_cyclic(const host::CanDrive& on_can);
  // Does `action` with a drive that takes changes of its process data then: an EtherCAT slave in PREOP, and with it
  // all others. They operate again as the drive is now, or `undo` is done and the reason thrown. Axes on EtherCAT are
  // not to be used any more after it.
  using Action = std::function<void(host::ObjectClient& objects)>;
  void configure(std::size_t axis, const Action& action, const Action& undo);
  // FMMUs and sync managers of the slaves; nothing on other buses. Throws HostError.
  using Registers = std::function<void(std::size_t axis, std::uint16_t station, std::uint16_t offset,
                                       std::span<const std::uint8_t> bytes)>;
  void show_process_data(const Registers& show);

 private:
  void open_can(const BusOptions& options, const std::vector<Member>& members);
  void open_modbus(const BusOptions& options, const std::vector<Member>& members, const std::string& link);
  void open_ethercat(const BusOptions& options, const std::vector<Member>& members);
  void operate();
  // `product` nullptr: the drive is asked.
  void add_axis(std::unique_ptr<host::ObjectClient> objects, const line::Product* product);

  std::unique_ptr<DriveLink> single_;  // of the protocol that has one drive
  std::unique_ptr<host::Bus> bus_;
  std::unique_ptr<host::ModbusClient> modbus_;
  std::unique_ptr<host::EthercatMaster> ethercat_;
  std::vector<host::FoundSlave> segment_;
  std::vector<std::unique_ptr<host::EthercatSlave>> slaves_;
  host::OperationOptions operation_options_{};
  std::optional<host::EthercatOperation> operation_;
  std::vector<std::unique_ptr<host::ObjectClient>> objects_;
  std::optional<host::MasterWatch> watch_;
  std::vector<std::unique_ptr<host::Axis402>> axes_;
  std::vector<host::Axis402*> pointers_;
};

}  // namespace servodrome::app
