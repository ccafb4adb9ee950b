#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "axis/axis402.hpp"
#include "axis/cyclic/lost_master.hpp"
#include "axis/master_watch.hpp"
#include "catalogue/product.hpp"
#include "master/canopen/master.hpp"
#include "master/canopen/sdo_client.hpp"
#include "master/ethercat/coe_objects.hpp"
#include "master/forwarded_objects.hpp"
#include "master/modbus/objects.hpp"
#include "master/restored.hpp"
#include "tools/conform/check.hpp"
#include "tools/conform/pdo_configuration.hpp"

// The drive under test.
namespace servodrome::master::conform {

// Access to the drive's bus, besides its objects. All references must outlive the Subject.
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
  const catalogue::Product* product = &catalogue::cia402::product;
  std::optional<double> units_per_revolution{};  // used if neither the dialect nor the drive's factors define it
  double revolutions = 0.5;                      // size of a motion in either direction
  std::string foe_file{};                        // a file that the slave offers; empty: the dialect's
  Time patience = std::chrono::seconds(3);       // timeout of a transition, a mode change or a handshake
  Time poll_interval = std::chrono::milliseconds(2);
  std::function<bool()> cancelled{};  // called at each wait; true ends all checks by throwing Cancelled
};

// The position values before they wrap around: 607Bh, or 32 bits.
struct PositionRange {
  std::int64_t lowest = std::numeric_limits<std::int32_t>::min();
  std::int64_t highest = std::numeric_limits<std::int32_t>::max();

  // The shorter way from one position to another.
  double way(std::int64_t from, std::int64_t to) const {
    return std::remainder(static_cast<double>(to - from), static_cast<double>(highest - lowest + 1));
  }
};

// Thrown through a check when the user cancels.
struct Cancelled {};

// Access to the drive's objects that restores them afterwards: it remembers the value before the first write.
class KeptObjects final : public ForwardedObjects {
 public:
  explicit KeptObjects(std::function<bool()> cancelled) : cancelled_(std::move(cancelled)) {}

  using ForwardedObjects::set_target;
  void ignore_cancellation() { ignores_cancellation_ = true; }
  // Cancellation has no effect as long as the returned object exists.
  [[nodiscard]] Restored<bool> without_cancellation() { return {ignores_cancellation_, true}; }

  void download(ObjectAddress object, std::span<const std::byte> data) override;
  void wait(Time span) override;

  // Remembers the value of an object that the check will write by raw frames instead of this client. Throws ObjectError
  // if the drive does not answer, because the object could not be restored.
  void keep(ObjectAddress object);
  // Restores the remembered values, the latest first, and tries each twice. Returns the objects that the drive refused
  // or did not confirm. Calls `answers` after a failure; if it returns false, the other objects stay remembered.
  std::vector<ObjectAddress> put_back(const std::function<bool()>& answers);
  // Number of objects whose values are remembered.
  std::size_t remembered() const { return before_.size(); }

 private:
  std::function<bool()> cancelled_;
  bool ignores_cancellation_ = false;
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

  // The objects as an application accesses them. On EtherCAT this brings the slave to OP first; mapped objects are then
  // accessed by process data.
  KeptObjects& objects();
  // Access by SDO or register only, in any state of the bus.
  ObjectClient& services();
  void leave_operation();
  // True if the slave was in OP and has left it: by itself, or because this computer sent too late.
  bool lost_operation() const;
  // The same at any time since the last settle().
  bool has_lost_operation() const { return has_lost_operation_ || lost_operation(); }

  CanAccess& can() { return *can_; }
  Master& master() { return *master_; }  // NMT master of the CAN bus
  EthercatAccess& ethercat() { return *ethercat_; }
  EthercatOperation& operation() { return *operation_; }
  ModbusAccess& modbus() { return *modbus_; }

  // One motor revolution, one revolution/s and one revolution/s2 in the drive's units; nullopt: neither the drive nor
  // the settings define them.
  std::optional<AxisUnits> units();

  // Throws MasterError if the axis is enabled or a stop is under way: another master may be moving it, and the checks
  // would interfere.
  void refuse_if_enabled();

  // Until end_watch() or settle() the axis stops by itself if this program is killed: on CAN the drive monitors the
  // program's heartbeat, on EtherCAT it reacts to missing cycles (6007h). Does nothing on Modbus. Throws MasterError if
  // the drive does not answer.
  void be_watched();
  // For a check that uses 1016h itself.
  void end_watch();
  // Adds a problem to those that settle() returns.
  void note(std::string sentence) { problems_.push_back(std::move(sentence)); }

  // The time in which the drive closes its brake before it switches off.
  Time brake_delay();
  // Timeout of a transition: the patience and the brake_delay().
  Time patience_of_power() { return settings_.patience + brake_delay(); }
  PositionRange position_range();

  // A check homes the axis, after which it must show this position value. The next settle() in which the axis stands
  // compares the two.
  void expect_position(std::int64_t value, double tolerance) { expected_position_ = {value, tolerance}; }

  // After a check: brings the axis to rest, resets a fault, switches power off, restores the objects and ends the
  // watch. Objects are restored only if is_off(), because a value from before, for example a target, could move the
  // axis. Returns the problems.
  std::vector<std::string> settle();
  // True if the last settle() has seen that the motor is off and the shaft at rest.
  bool is_off() const { return is_off_; }
  // True if the drive did not answer in the last settle().
  bool is_lost() const { return is_lost_; }
  // After all checks: settle(), and, if is_off(), restores the bus state and the objects that a reset of the node has
  // lost. Returns the problems.
  std::vector<std::string> restore();

 private:
  void remember();
  void to_rest();
  void switch_off();
  bool stands_within(Time span);
  std::optional<std::int32_t> position();
  void compare_position();
  // nullopt: the drive has no statusword.
  std::optional<PowerState> power_state();
  bool answers();
  void restore_node();

  unsigned kind_;
  SubjectSettings settings_;
  std::optional<CanAccess> can_;
  std::optional<Master> master_;
  std::vector<std::string> problems_;  // since the last settle()
  bool is_lost_ = false;
  bool is_off_ = false;
  bool has_lost_operation_ = false;
  std::optional<MasterWatch> watch_;
  std::optional<EthercatAccess> ethercat_;
  std::optional<ModbusAccess> modbus_;
  std::unique_ptr<ObjectClient> by_service_;  // on EtherCAT and Modbus
  std::unique_ptr<CoeObjects> by_process_data_;
  std::optional<LostMasterReaction> reaction_;  // ends after the operation
  std::optional<EthercatOperation> operation_;
  KeptObjects kept_;
  std::map<ObjectAddress, std::vector<std::byte>> snapshot_;
  std::vector<PdoConfiguration> pdos_;
  std::optional<NmtState> nmt_state_;
  std::optional<AlState> al_state_;
  std::optional<AxisUnits> units_;
  struct ExpectedPosition {
    std::int64_t value;
    double tolerance;
  };
  std::optional<ExpectedPosition> expected_position_;
};

}  // namespace servodrome::master::conform
