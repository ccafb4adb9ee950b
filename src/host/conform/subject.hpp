#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>

#include "host/axis402.hpp"
#include "host/canopen/master.hpp"
#include "host/canopen/sdo_client.hpp"
#include "host/conform/check.hpp"
#include "host/conform/pdo_configuration.hpp"
#include "host/ethercat/coe_objects.hpp"
#include "host/modbus/objects.hpp"

// The drive that is checked.
namespace servodrome::host::conform {

// How its bus is reached beside its objects. Everything outlives the Subject.
struct CanAccess {
  Bus& bus;
  SdoClient& sdo;
};
struct EthercatAccess {
  EthercatMaster& master;
  std::span<const FoundSlave> line;  // all slaves of the segment
  EthercatSlave& slave;
  OperationOptions options{};
};
struct ModbusAccess {
  ModbusClient& client;
  std::uint8_t unit;
  RegisterList list;
};

struct SubjectSettings {
  Dialect dialect{};                             // of its product
  std::optional<double> units_per_revolution{};  // if neither the dialect nor its factors say
  double revolutions = 0.5;                      // how far a motion goes, either way
  std::string foe_file{};                        // that the slave offers; empty: what the dialect says
  Time patience = std::chrono::seconds(3);       // for a transition, a mode change, a handshake
  Time poll_interval = std::chrono::milliseconds(2);
  std::function<bool()> cancelled{};  // asked whenever time passes; true ends everything with Cancelled
};

// Thrown through a check when the user wants no more.
struct Cancelled {};

// Objects of the drive that are put back: the value before the first write is remembered.
class KeptObjects final : public ObjectClient {
 public:
  explicit KeptObjects(std::function<bool()> cancelled) : cancelled_(std::move(cancelled)) {}

  // Everything goes there from now on.
  void set_target(ObjectClient* target) { target_ = target; }
  void ignore_cancellation() { cancelled_ = nullptr; }

  std::vector<std::byte> upload(ObjectAddress object) override;
  void download(ObjectAddress object, std::span<const std::byte> data) override;
  Time now() const override { return target_->now(); }
  void wait(Time span) override;
  std::uint16_t address() const override { return target_->address(); }
  std::string where() const override { return target_->where(); }
  std::optional<Emergency> latest_emergency() override { return target_->latest_emergency(); }

  // For what is written past this, by frames.
  void keep(ObjectAddress object);
  // The values from before, latest first; what the drive refuses is returned.
  std::vector<ObjectAddress> put_back();

 private:
  ObjectClient* target_ = nullptr;
  std::function<bool()> cancelled_;
  std::vector<std::pair<ObjectAddress, std::vector<std::byte>>> before_;
  std::set<ObjectAddress> kept_;
};

class Subject {
 public:
  Subject(const CanAccess& access, const SubjectSettings& settings);
  Subject(const EthercatAccess& access, const SubjectSettings& settings);
  Subject(const ModbusAccess& access, const SubjectSettings& settings);
  Subject(const Subject&) = delete;
  Subject& operator=(const Subject&) = delete;

  unsigned bus_kind() const { return kind_; }
  const SubjectSettings& settings() const { return settings_; }
  std::string where() const;

  // The objects as an application uses them; an EtherCAT slave is taken to OP first, and what is among its process data
  // goes there.
  KeptObjects& objects();
  // By SDO or register, whatever state the bus is in.
  ObjectClient& services();
  void leave_operation();
  // It was in OP and is not any more: this computer sent too late, or the slave fell out.
  bool lost_operation() const;

  CanAccess& can() { return *can_; }
  Master& master() { return *master_; }  // of the CAN bus
  EthercatAccess& ethercat() { return *ethercat_; }
  EthercatOperation& operation() { return *operation_; }
  ModbusAccess& modbus() { return *modbus_; }

  // A motor revolution and so on in the drive's units; nothing: neither it nor the settings say.
  std::optional<AxisUnits> units();

  // Throws HostError if the axis is enabled: another master may be moving it, and checks would interfere.
  void refuse_if_enabled();

  // After a check: at rest, without power, without fault, its objects as before. Problems are returned, one per line.
  std::string settle();
  // After all checks: its bus state as found, as well as what a reset of the node has lost.
  std::string restore();

 private:
  void remember();
  void to_rest();

  unsigned kind_;
  SubjectSettings settings_;
  std::optional<CanAccess> can_;
  std::optional<Master> master_;
  std::optional<EthercatAccess> ethercat_;
  std::optional<ModbusAccess> modbus_;
  std::unique_ptr<ObjectClient> by_service_;  // EtherCAT, Modbus
  std::unique_ptr<CoeObjects> by_process_data_;
  std::optional<EthercatOperation> operation_;
  KeptObjects kept_;
  std::map<ObjectAddress, std::vector<std::byte>> snapshot_;
  std::vector<PdoConfiguration> pdos_;
  std::optional<NmtState> nmt_state_;
  std::optional<AlState> al_state_;
  std::optional<AxisUnits> units_;
};

}  // namespace servodrome::host::conform
