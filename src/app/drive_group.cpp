#include "app/drive_group.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "app/commands.hpp"
#include "catalogue/product.hpp"

namespace servodrome::app {
namespace {

BusOptions options_of(BusOptions options, const DriveGroup::Member& member) {
  if (member.node != 0) options.node_id = member.node;
  if (!member.product.empty()) options.product = member.product;
  return options;
}

}  // namespace

DriveGroup::DriveGroup(const BusOptions& options, const std::vector<Member>& members, std::function<bool()> cancelled)
    : cancelled_(std::move(cancelled)) {
  const auto [kind, link] = bus_kind(options);
  switch (kind) {
    case BusKind::can: open_can(options, members); break;
    case BusKind::modbus: open_modbus(options, members, link); break;
    case BusKind::ethercat: open_ethercat(options, members); break;
    case BusKind::serial10:
      if (members.size() != 1) {
        throw Failure::wrong_use(fmt::format("--bus {}: this protocol is for one drive", options.link));
      }
      single_ = std::make_unique<DriveLink>(options_of(options, members[0]), true);
      axes_.push_back(single_->open_axis({.cancelled = cancelled_}));
      break;
  }
  for (const auto& axis : axes_) pointers_.push_back(axis.get());
}

void DriveGroup::add_axis(std::unique_ptr<master::ObjectClient> objects, const line::Product* product) {
  if (product == nullptr) {
    product = product_of(objects->read_if_present<std::uint32_t>(0x1018, 1),
                         objects->read_if_present<std::uint32_t>(0x1018, 2));
  }
  axes_.push_back(std::make_unique<master::Axis402>(
      *objects,
      master::AxisOptions{.product = &catalogue::product_of(product != nullptr ? product->name : std::string_view{}),
                          .cancelled = cancelled_}));
  objects_.push_back(std::move(objects));
}

void DriveGroup::open_can(const BusOptions& options, const std::vector<Member>& members) {
  bus_ = open_bus(options);
  for (const Member& member : members) {
    const BusOptions own = options_of(options, member);
    if (own.node_id > 127) throw Failure::wrong_use(fmt::format("node {}: node-IDs are 1..127", own.node_id));
    auto sdo = std::make_unique<master::SdoClient>(*bus_, choose_node(*bus_, own, true),
                                                   master::SdoOptions{.timeout = options.answer_timeout()});
    sdos_.push_back(sdo.get());
    add_axis(std::move(sdo), named_product(own));
  }
  if (options.no_watch) return;
  std::vector<master::ObjectClient*> drives;
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (members[i].is_watched) drives.push_back(objects_[i].get());
  }
  watch_.emplace(*bus_, drives, warn);
}

void DriveGroup::while_waiting(const std::function<bool()>& look) {
  for (master::SdoClient* sdo : sdos_) sdo->cancel_when(look);
}

void DriveGroup::operate() {
  std::vector<master::EthercatSlave*> slaves;
  for (const auto& slave : slaves_) slaves.push_back(slave.get());
  operation_.emplace(*ethercat_, segment_, slaves, operation_options_);
  watched_.emplace(*ethercat_, *operation_, master::EthercatCyclicOptions{.stops_drives = false, .watches = true});
}

std::unique_ptr<master::CyclicBus> DriveGroup::open_cyclic(const master::CanDrive& on_can) {
  constexpr master::Time period = std::chrono::milliseconds(1);
  if (operation_) {
    master::Time brake_delay{};
    for (const auto& axis : axes_) brake_delay = std::max(brake_delay, axis->brake_delay());
    return std::make_unique<master::EthercatCyclicBus>(*ethercat_, *operation_,
                                                       master::EthercatCyclicOptions{.brake_delay = brake_delay});
  }
  if (!bus_) throw master::MasterError("there are no process data", "this bus", "use the drive's CAN or EtherCAT port");
  // Some drives answer a SYNC in their next tick, which may be more than half a period later.
  return std::make_unique<master::CanCyclicBus>(*bus_, std::vector{on_can},
                                                master::CanCyclicOptions{.period = period, .waits_whole_period = true});
}

std::unique_ptr<master::CanCyclicBus> DriveGroup::record(const std::vector<master::CanDrive>& drives,
                                                         master::Time period, const std::function<void()>& between) {
  if (!bus_) throw master::MasterError("there are no TPDOs", "this bus", "use the drive's CAN port");
  constexpr master::Time longest_loss = std::chrono::milliseconds(100);
  return std::make_unique<master::CanCyclicBus>(
      *bus_, drives,
      master::CanCyclicOptions{.period = period,
                               .tolerated_losses = static_cast<unsigned>(longest_loss / period),
                               .waits_whole_period = true,
                               .stops_drives = false,
                               .ends_when_lost = true,
                               .between = between});
}

void DriveGroup::to_pre_operational(std::size_t axis) {
  if (bus_) master::Master(*bus_).command(master::NmtCommand::enter_pre_operational, sdos_[axis]->node_id());
}

// Asks by node guarding. A node with a life time (100Ch, 100Dh) is not asked: after the first guarding request it would
// report an error as soon as further requests do not follow.
std::optional<bool> DriveGroup::is_operational(std::size_t axis) {
  constexpr master::Time timeout = std::chrono::milliseconds(100);
  if (!bus_) return std::nullopt;
  const bool has_life_time = objects_[axis]->read_if_present<std::uint16_t>(0x100C).value_or(0) != 0 &&
                             objects_[axis]->read_if_present<std::uint8_t>(0x100D).value_or(0) != 0;
  if (has_life_time) return std::nullopt;
  const auto answer = master::Master(*bus_).guard(sdos_[axis]->node_id(), timeout);
  if (!answer) return std::nullopt;
  return answer->state == master::NmtState::operational;
}

void DriveGroup::configure(std::size_t axis, const Action& action, const Action& undo) {
  if (!operation_) return action(*objects_[axis]);
  watched_.reset();
  operation_.reset();  // all slaves go to PREOP
  master::EthercatSlave& slave = *slaves_[axis];
  master::CoeObjects objects(slave);
  action(objects);
  try {
    operate();
  } catch (const master::MasterError&) {
    slave.to_pre_operational();
    undo(objects);
    throw;
  }
}

void DriveGroup::show_process_data(const Registers& show) {
  std::array<std::uint8_t, 8 * 16> fmmus{};
  std::array<std::uint8_t, 8 * 8> sync_managers{};
  for (std::size_t i = 0; i < slaves_.size(); ++i) {
    const std::uint16_t station = slaves_[i]->station();
    ethercat_->read(station, ethercat::reg::fmmu, fmmus);
    ethercat_->read(station, ethercat::reg::sync_manager, sync_managers);
    show(i, station, ethercat::reg::fmmu, fmmus);
    show(i, station, ethercat::reg::sync_manager, sync_managers);
  }
}

std::vector<studio::OpenBus::Found> DriveGroup::scan() {
  const auto name = [](const line::Product* product) { return std::string(product != nullptr ? product->name : ""); };
  std::vector<studio::OpenBus::Found> found;
  if (bus_) {
    for (const master::FoundNode& node : master::scan(*bus_)) {
      found.push_back({node.node_id, node.name, master::kind_of(node), name(product_of(node))});
    }
  } else if (ethercat_) {
    // The slaves operate, so they are not read again: their data are from the opening. Slaves behind them are counted.
    const unsigned count = master::count_slaves(*ethercat_);
    for (unsigned position = 1; position <= count; ++position) {
      const master::FoundSlave* slave = position <= segment_.size() ? &segment_[position - 1] : nullptr;
      found.push_back({position, slave != nullptr ? slave->sii.name : "", "",
                       name(slave != nullptr ? product_of(*slave) : nullptr)});
    }
  } else {
    throw master::MasterError("a serial line is not scanned, since each missing station costs a second", "this bus",
                              "name its stations when you start the studio: --bus LINK=1,2");
  }
  return found;
}

void DriveGroup::renew_watch(std::size_t axis) {
  if (watch_) watch_->renew(*objects_[axis]);
  if (operation_) reactions_[axis].begin();
}

void DriveGroup::release_watch(std::size_t axis) {
  if (watch_) watch_->release(*objects_[axis]);
  if (operation_) reactions_[axis].end();
}

std::optional<master::Time> DriveGroup::watched_within(std::size_t axis) const {
  if (operation_) return operation_->exchange().watchdog(axis);
  if (watch_ && watch_->is_watching(*objects_[axis])) return master::MasterWatch::longest_silence;
  return std::nullopt;
}

void DriveGroup::open_modbus(const BusOptions& options, const std::vector<Member>& members, const std::string& link) {
  const master::ModbusOptions modbus_options{.timeout = options.answer_timeout()};
  modbus_ = std::make_unique<master::ModbusClient>(open_modbus_client(options, link, modbus_options));
  for (const Member& member : members) {
    const BusOptions own = options_of(options, member);
    const std::uint8_t unit = modbus_unit(own, link);
    const line::Product* product = named_product(own);
    if (product == nullptr) product = &modbus_product(*modbus_, unit);
    add_axis(std::make_unique<master::ModbusObjects>(*modbus_, unit, register_list_of(*product)), product);
  }
}

void DriveGroup::open_ethercat(const BusOptions& options, const std::vector<Member>& members) {
  ethercat_ = open_ethercat_master(options);
  segment_ = scan_segment(*ethercat_);
  std::vector<const line::Product*> products;
  for (const Member& member : members) {
    const BusOptions own = options_of(options, member);
    const master::FoundSlave& found = choose_slave(*ethercat_, segment_, own);
    slaves_.push_back(std::make_unique<master::EthercatSlave>(*ethercat_, found, options.answer_timeout()));
    if (member.identity && found.sii.identity != *member.identity) {
      throw master::MasterError("another slave is at this position than at the start", slaves_.back()->where(),
                                "connect the slaves in their former order, or start this program again");
    }
    products.push_back(own.product.empty() ? product_of(found) : named_product(own));
    if (!is_drive(*slaves_.back())) {
      throw Failure::wrong_use(fmt::format("{}: it is not a CiA 402 drive", slaves_.back()->where()));
    }
  }
  operation_options_ = operation_options(options);
  for (const auto& slave : slaves_) reactions_.emplace_back(*slave);
  operate();
  for (std::size_t i = 0; i < slaves_.size(); ++i) {
    add_axis(std::make_unique<master::CoeObjects>(*slaves_[i], operation_->exchange(), i), products[i]);
  }
}

}  // namespace servodrome::app
