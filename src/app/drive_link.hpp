#pragma once

#include <memory>

#include "app/bus_options.hpp"
#include "host/canopen/master_watch.hpp"
#include "host/conform/subject.hpp"
#include "host/cyclic/can_cyclic_bus.hpp"
#include "host/cyclic/ethercat_cyclic_bus.hpp"
#include "host/ethercat/coe_objects.hpp"
#include "host/modbus/objects.hpp"
#include "host/scope/sampler.hpp"
#include "host/serial10/objects.hpp"
#include "line/registry.hpp"

namespace servodrome::app {

// One drive behind --bus, whatever bus that is.
class DriveLink {
 public:
  // The drive of --node, or the only one there is (`drives`: the only CiA 402 drive of a CAN bus). Throws Failure if
  // that cannot be told, HostError if the link cannot be opened.
  DriveLink(const BusOptions& options, bool drives);

  host::ObjectClient& objects() { return *objects_; }
  // The same for a CANopen node; nullptr on other buses.
  host::SdoClient* sdo() { return sdo_; }
  // What --product names or the drive says it is; nullptr: not known.
  const line::Product* product();
  // "node", "station", "slave" or "drive", as its bus calls it.
  const char* noun() const { return bus_ ? "node" : modbus_ ? "station" : slave_ ? "slave" : "drive"; }

  // Before an axis is moved: be_watched(), and an EtherCAT slave goes to OP, and stays there as long as this lives and
  // waits. On other buses nothing happens.
  // Axes opened before are not to be used any more.
  void operate(const BusOptions& options);
  bool operates() const { return operation_.has_value(); }
  // A CANopen drive watches this program's heartbeat as long as this lives (host::MasterWatch), unless the options say
  // no.
  void be_watched(const BusOptions& options);
  // The process data of the drive, at the cycle of the options: of a CANopen node those that `on_can` names, of an
  // EtherCAT slave, which is to operate, those that it maps. A CANopen drive gets this program's heartbeat as long as
  // this lives. Throws Failure on a bus that has none.
  std::unique_ptr<host::CyclicBus> open_cyclic(const host::CanDrive& on_can, const BusOptions& options);
  // Speaks the product's dialect; Ctrl-C, where an InterruptGuard lives, cancels its waits. Throws Failure if this port
  // of the drive has parameters only.
  std::unique_ptr<host::Axis402> open_axis(host::AxisOptions options) { return open_axis(*objects_, options); }
  // By other objects of the same drive.
  std::unique_ptr<host::Axis402> open_axis(host::ObjectClient& objects, host::AxisOptions options);
  // What its product or the standard calls its objects.
  const host::ObjectCatalogue& catalogue();
  // Whatever is quickest on its bus; of complete channels. Lives no longer than this.
  std::unique_ptr<host::scope::Sampler> open_sampler(std::vector<host::scope::Channel> channels,
                                                     const host::scope::SamplerOptions& options);
  // The drive as `conform` checks it: beside its objects the frames of its bus. Throws Failure on a bus it has no
  // checks for.
  std::unique_ptr<host::conform::Subject> open_subject(const host::conform::SubjectSettings& settings,
                                                       const BusOptions& options);

 private:
  void open_can(const BusOptions& options, bool drives);
  void open_modbus(const BusOptions& options, const std::string& link);
  void open_serial10(const BusOptions& options, const std::string& link);
  void open_ethercat(const BusOptions& options, bool drives);
  host::RegisterList register_list() const;

  std::unique_ptr<host::Bus> bus_;
  std::unique_ptr<host::ModbusClient> modbus_;
  std::unique_ptr<host::Serial10Client> serial10_;
  std::unique_ptr<host::EthercatMaster> ethercat_;
  std::vector<host::FoundSlave> line_;  // all slaves of the segment
  std::unique_ptr<host::EthercatSlave> slave_;
  std::optional<host::EthercatOperation> operation_;
  std::unique_ptr<host::ObjectClient> objects_;
  std::optional<host::MasterWatch> watch_;
  host::SdoClient* sdo_ = nullptr;
  const line::Product* product_ = nullptr;
  bool asked_product_ = false;
  std::optional<host::ObjectCatalogue> catalogue_;
};

// Of a protocol that only one product has, its drives need not be named. nullptr: several products have it.
const line::Product* product_that_speaks(products::SerialProtocol protocol);
// That of --product; nullptr: none is given. Throws Failure if there is none of that name.
const line::Product* named_product(const BusOptions& options);
// The product that a drive with this identity (1018h) is; nullptr: none of ours.
const line::Product* product_of(std::optional<std::uint32_t> vendor_id, std::optional<std::uint32_t> product_code);

const line::Product* product_of(const host::FoundNode& node);
const line::Product* product_of(const host::FoundSlave& slave);
// What the node calls itself; what it is by its identity if it has no name (1008h); "-".
std::string name_of(const host::FoundNode& node);
// Width of a table's column of names: the longest and a gap.
int name_width(const std::vector<host::FoundNode>& nodes);

// An EtherCAT master for --bus; throws Failure if the link is no name of one.
std::unique_ptr<host::EthercatMaster> open_ethercat_master(const BusOptions& options);
// All slaves; throws Failure if there is none.
std::vector<host::FoundSlave> scan_segment(host::EthercatMaster& master);
// The one at position --node, or with that alias; without --node the only one. Throws Failure.
const host::FoundSlave& choose_slave(const host::EthercatMaster& master, const std::vector<host::FoundSlave>& slaves,
                                     const BusOptions& options);
// Does it have the objects of a CiA 402 drive? Asks it in PREOP.
bool is_drive(host::EthercatSlave& slave);
host::OperationOptions operation_options(const BusOptions& options);

// A Modbus master for --bus modbus:LINK, without a drive.
host::ModbusClient open_modbus_client(const BusOptions& options, const std::string& link,
                                      const host::ModbusOptions& modbus_options);
// The unit of --node, or the one alone behind a TCP address. Throws Failure.
std::uint8_t modbus_unit(const BusOptions& options, const std::string& link);
// What a station says it is. Throws Failure if it does not, or is none of ours.
const line::Product& modbus_product(host::ModbusClient& client, std::uint8_t unit);
// The port of a PC program may have parameters alone: throws Failure if the product's Modbus has no statusword.
void check_that_it_moves(const line::Product& product, const std::string& where);
// Throws Failure if the product has no Modbus registers.
host::RegisterList register_list_of(const line::Product& product);
host::Serial10Client open_serial10_client(const BusOptions& options, const std::string& link,
                                          const host::Serial10Options& serial10_options);

}  // namespace servodrome::app
