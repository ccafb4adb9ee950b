#pragma once

#include <memory>
#include <variant>

#include "app/bus_options.hpp"
#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/cyclic/lost_master.hpp"
#include "axis/master_watch.hpp"
#include "line/registry.hpp"
#include "master/ethercat/coe_objects.hpp"
#include "master/modbus/objects.hpp"
#include "master/serial10/objects.hpp"
#include "tools/conform/subject.hpp"
#include "tools/sampling/sampler.hpp"

namespace servodrome::app {

// One drive on --bus, on any kind of bus.
class DriveLink {
 public:
  // Opens the drive of --node, or the only one (`drives`: the only CiA 402 drive of a CAN bus). Throws Failure if that
  // is not unique, MasterError if the link cannot be opened.
  DriveLink(const BusOptions& options, bool drives);

  master::ObjectClient& objects() { return *objects_; }
  // The same objects for a CANopen node; nullptr on other buses.
  master::SdoClient* sdo() { return on<Can>() != nullptr ? on<Can>()->sdo : nullptr; }
  // The product of --product, or the one that the drive reports; nullptr: unknown.
  const line::Product* product();
  // "node", "station", "slave" or "drive", the usual word for its bus.
  const char* noun() const {
    return std::visit([](const auto& bus) { return bus.noun; }, bus_);
  }

  // Call it before an axis is moved: does be_watched(), and takes an EtherCAT slave to OP, where it stays as long as
  // this object lives and waits; its axis stops when the cycles cease (master::LostMasterReaction). Does nothing on
  // other buses. Axes that were opened before must not be used any more.
  void operate(const BusOptions& options);
  bool operates() const {
    const auto* ethercat = std::get_if<Ethercat>(&bus_);
    return ethercat != nullptr && ethercat->operation;
  }
  // Lets a CANopen drive monitor this program's heartbeat as long as this object lives (master::MasterWatch), unless
  // the options disable it.
  void be_watched(const BusOptions& options);
  // Ends this monitoring now, and restores 6007h, for example before the drive stores its objects. Returns false if the
  // drive could not be restored; warn() has then printed the objects that keep their values.
  bool end_watch();
  // Exchanges the process data of the drive with the cycle of the options: on CANopen those in `on_can`, on EtherCAT
  // those that the slave maps; the slave must operate. A CANopen drive receives this program's heartbeat as long as the
  // result lives. Throws Failure on a bus without process data.
  std::unique_ptr<master::CyclicBus> open_cyclic(const master::CanDrive& on_can, const BusOptions& options);
  // Uses the product's dialect. Ctrl-C cancels its waits if an InterruptGuard lives. Throws Failure if this port of the
  // drive has parameters only.
  std::unique_ptr<master::Axis402> open_axis(master::AxisOptions options) { return open_axis(*objects_, options); }
  // The same with other objects of the same drive.
  std::unique_ptr<master::Axis402> open_axis(master::ObjectClient& objects, master::AxisOptions options);
  // Object names of its product, or of the standard.
  const master::ObjectCatalogue& catalogue();
  // The quickest sampler on this bus; `channels` must be complete. The result must not outlive this object.
  std::unique_ptr<master::sampling::Sampler> open_sampler(std::vector<master::sampling::Channel> channels,
                                                          const master::sampling::SamplerOptions& options);
  // The drive as `conform` checks it: its objects and the frames of its bus. Throws Failure on a bus for which there
  // are no checks.
  std::unique_ptr<master::conform::Subject> open_subject(const master::conform::SubjectSettings& settings,
                                                         const BusOptions& options);

 private:
  struct Can {
    static constexpr const char* noun = "node";
    std::unique_ptr<master::Bus> bus;
    master::SdoClient* sdo;  // objects_
  };
  struct Modbus {
    static constexpr const char* noun = "station";
    std::unique_ptr<master::ModbusClient> client;
  };
  struct Serial10 {
    static constexpr const char* noun = "drive";
    std::unique_ptr<master::Serial10Client> client;
  };
  struct Ethercat {
    static constexpr const char* noun = "slave";
    std::unique_ptr<master::EthercatMaster> master;
    std::vector<master::FoundSlave> line;  // all slaves of the segment
    std::unique_ptr<master::EthercatSlave> slave;
    std::optional<master::LostMasterReaction> reaction;  // ends after the operation
    std::optional<master::EthercatOperation> operation;
  };
  // Each opens its bus, and objects_ on it.
  void open(Can& can, const BusOptions& options, bool drives);
  void open(Modbus& modbus, const BusOptions& options, const std::string& link);
  void open(Serial10& serial10, const BusOptions& options, const std::string& link);
  void open(Ethercat& ethercat, const BusOptions& options, bool drives);
  template <typename Kind>
  Kind* on() {
    return std::get_if<Kind>(&bus_);
  }

  std::variant<Can, Modbus, Serial10, Ethercat> bus_;
  std::unique_ptr<master::ObjectClient> objects_;
  bool watch_is_left_ = false;  // the drive keeps values of watch_ after its end
  std::optional<master::MasterWatch> watch_;
  const line::Product* product_ = nullptr;
  bool asked_product_ = false;
  std::optional<master::ObjectCatalogue> catalogue_;
};

// The product that speaks the protocol; nullptr if several products do.
const line::Product* product_that_speaks(products::SerialProtocol protocol);
// The product of --product; nullptr if none is given. Throws Failure for an unknown name.
const line::Product* named_product(const BusOptions& options);
// The product with this identity (1018h); nullptr: unknown product.
const line::Product* product_of(std::optional<std::uint32_t> vendor_id, std::optional<std::uint32_t> product_code);

const line::Product* product_of(const master::FoundNode& node);
const line::Product* product_of(const master::FoundSlave& slave);
// The name that the node reports (1008h); otherwise the product of its identity; otherwise "-".
std::string name_of(const master::FoundNode& node);
// Width of a table column of names: the longest name and a gap.
int name_width(const std::vector<master::FoundNode>& nodes);

// An EtherCAT master for --bus; throws Failure for an invalid link.
std::unique_ptr<master::EthercatMaster> open_ethercat_master(const BusOptions& options);
// Returns all slaves; throws Failure if there are none.
std::vector<master::FoundSlave> scan_segment(master::EthercatMaster& master);
// The slave at position --node, or with that alias; without --node the only one. Throws Failure.
const master::FoundSlave& choose_slave(const master::EthercatMaster& master,
                                       const std::vector<master::FoundSlave>& slaves, const BusOptions& options);
// Returns true if the slave has the objects of a CiA 402 drive. Reads them in PREOP.
bool is_drive(master::EthercatSlave& slave);
master::OperationOptions operation_options(const BusOptions& options);

// A Modbus master for --bus modbus:LINK, without a drive.
master::ModbusClient open_modbus_client(const BusOptions& options, const std::string& link,
                                        const master::ModbusOptions& modbus_options);
// The unit of --node, or the only one behind a TCP address. Throws Failure.
std::uint8_t modbus_unit(const BusOptions& options, const std::string& link);
// The product that a station reports. Throws Failure if it reports none, or an unknown one.
const line::Product& modbus_product(master::ModbusClient& client, std::uint8_t unit);
// Throws Failure if the product's Modbus has no statusword: the port of a PC program may have parameters only.
void check_that_it_moves(const line::Product& product, const std::string& where);
// Throws Failure if the product has no Modbus registers.
master::RegisterList register_list_of(const line::Product& product);
master::Serial10Client open_serial10_client(const BusOptions& options, const std::string& link,
                                            const master::Serial10Options& serial10_options);

}  // namespace servodrome::app
