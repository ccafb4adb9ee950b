#include "app/drive_buses.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "app/commands.hpp"
#include "app/drive_group.hpp"
#include "links/number_text.hpp"
#include "links/time.hpp"

namespace servodrome::app {
namespace {

// Adapts a group of drives to the threads of the studio.
class OpenGroup final : public studio::OpenBus {
 public:
  OpenGroup(const BusOptions& options, const std::vector<DriveGroup::Member>& members) : group_(options, members) {}
  std::vector<master::ObjectClient*> drives() override {
    std::vector<master::ObjectClient*> drives;
    for (master::Axis402* axis : group_.axes()) drives.push_back(&axis->objects());
    return drives;
  }
  void back(std::size_t drive) override { group_.renew_watch(drive); }
  bool has_restarted(std::size_t drive) const override { return group_.has_lost_watch(drive); }
  void release(std::size_t drive) override { group_.release_watch(drive); }
  // All drives share the bus, so any of them can wait.
  void wait(master::Time span) override { group_.axes().front()->objects().wait(span); }
  void while_waiting(std::function<bool()> look) override { group_.while_waiting(look); }
  Cyclic open_cyclic(std::size_t drive, const master::CanDrive& exchanged) override {
    return {group_.open_cyclic(exchanged), group_.operates() ? drive : 0};
  }
  master::CyclicBus* cycle() override { return group_.cycle(); }
  std::unique_ptr<master::CanCyclicBus> record(const std::vector<master::CanDrive>& drives, master::Time period,
                                               const std::function<void()>& between) override {
    return group_.record(drives, period, between);
  }
  void to_pre_operational(std::size_t drive) override { group_.to_pre_operational(drive); }
  std::optional<bool> is_operational(std::size_t drive) override { return group_.is_operational(drive); }
  void configure(std::size_t drive, const Action& action, const Action& undo) override {
    group_.configure(drive, action, undo);
  }
  void show_process_data(const Registers& show) override { group_.show_process_data(show); }
  std::vector<Found> scan() override { return group_.scan(); }
  std::optional<Watch> watch_of(std::size_t drive) override {
    const auto within = group_.watched_within(drive);
    if (!within) return std::nullopt;
    return Watch{group_.operates() ? "sync manager" : "heartbeat", links::to_seconds(*within)};
  }

 private:
  DriveGroup group_;
};

struct Named {
  BusOptions options;
  std::vector<unsigned> nodes;
};

Named read_bus(const std::string& text, BusOptions options) {
  const std::size_t equals = text.rfind('=');
  options.link = text.substr(0, equals);
  Named bus{std::move(options), {}};
  if (equals == std::string::npos) return bus;
  for (std::string_view rest = std::string_view(text).substr(equals + 1);;) {
    const std::string_view number = rest.substr(0, rest.find(','));
    const unsigned node = links::number_of_text<unsigned>(number).value_or(0);
    const bool known = std::find(bus.nodes.begin(), bus.nodes.end(), node) != bus.nodes.end();
    if (node == 0 || node > 65535 || known) {
      throw Failure::wrong_use(
          fmt::format("--bus {}: \"{}\" {}; write node-IDs, stations or positions behind the link, as LINK=1,3", text,
                      number, known ? "is given twice" : "is not a drive number"));
    }
    bus.nodes.push_back(node);
    if (number.size() == rest.size()) return bus;
    rest.remove_prefix(number.size() + 1);
  }
}

std::string product_name(const line::Product* product) {
  return product != nullptr ? std::string(product->name) : std::string();
}

std::vector<DriveGroup::Member> drives_on_can(const Named& named) {
  const auto bus = open_bus(named.options);
  master::ScanOptions scan;
  std::vector<DriveGroup::Member> drives;
  const std::vector<master::FoundNode> found = master::scan(*bus, scan);
  for (const master::FoundNode& node : found) {
    const bool wanted = std::find(named.nodes.begin(), named.nodes.end(), node.node_id) != named.nodes.end();
    if (named.nodes.empty() ? node.is_drive() : wanted) {
      drives.push_back({.node = node.node_id, .product = product_name(product_of(node))});
    }
  }
  for (const unsigned node : named.nodes) {
    if (std::none_of(drives.begin(), drives.end(), [node](const auto& drive) { return drive.node == node; })) {
      throw Failure::did_not_work(
          fmt::format("{}: node {} does not answer; check its node-ID, bit rate and power", bus->name(), node));
    }
  }
  return drives;
}

// After a change of the cables another slave may be at a position. So each member has the identity of its slave.
std::vector<DriveGroup::Member> drives_on_ethercat(const Named& named) {
  const auto master = open_ethercat_master(named.options);
  const std::vector<master::FoundSlave> slaves = scan_segment(*master);
  std::vector<DriveGroup::Member> drives;
  if (!named.nodes.empty()) {
    for (const unsigned node : named.nodes) {
      BusOptions one = named.options;
      one.node_id = node;
      const master::FoundSlave& slave = choose_slave(*master, slaves, one);
      drives.push_back(
          {.node = slave.position, .product = product_name(product_of(slave)), .identity = slave.sii.identity});
    }
    return drives;
  }
  for (const master::FoundSlave& found : slaves) {
    master::EthercatSlave slave(*master, found, named.options.answer_timeout());
    if (!is_drive(slave)) continue;
    drives.push_back(
        {.node = found.position, .product = product_name(product_of(found)), .identity = found.sii.identity});
  }
  return drives;
}

// A serial line is not scanned, because every missing station costs one second.
std::vector<DriveGroup::Member> drives_on_modbus(const Named& named, const std::string& link) {
  master::ModbusClient client = open_modbus_client(named.options, link, {.timeout = named.options.answer_timeout()});
  std::vector<unsigned> nodes = named.nodes;
  if (nodes.empty()) nodes.push_back(0);  // the only one behind a TCP address
  std::vector<DriveGroup::Member> drives;
  for (const unsigned node : nodes) {
    BusOptions one = named.options;
    one.node_id = node;
    const std::uint8_t unit = modbus_unit(one, link);
    const line::Product* product = named_product(one);
    if (product == nullptr) product = &modbus_product(client, unit);
    check_that_it_moves(*product, fmt::format("{}, unit {}", link, unit));
    drives.push_back({.node = node, .product = product_name(product)});
  }
  return drives;
}

std::vector<DriveGroup::Member> drives_on_serial10(const Named& named) {
  if (named.nodes.size() > 1) {
    throw Failure::wrong_use(fmt::format("--bus {}: this protocol is for one drive", named.options.link));
  }
  BusOptions one = named.options;
  if (!named.nodes.empty()) one.node_id = named.nodes.front();
  DriveLink link(one, true);
  link.objects().read<std::uint16_t>(0x6041);
  return {{.node = one.node_id, .product = product_name(link.product())}};
}

studio::BusPlan plan_of(const Named& named) {
  const auto [kind, link] = bus_kind(named.options);
  studio::BusPlan plan{named.options.link, "", {}, {}};
  std::vector<DriveGroup::Member> members;
  switch (kind) {
    case BusKind::can:
      plan.type = "can";
      members = drives_on_can(named);
      break;
    case BusKind::ethercat:
      plan.type = "ethercat";
      members = drives_on_ethercat(named);
      break;
    case BusKind::modbus:
      plan.type = "rs485";
      members = drives_on_modbus(named, link);
      break;
    case BusKind::serial10:
      plan.type = "rs485";
      members = drives_on_serial10(named);
      break;
  }
  if (members.empty()) {
    throw Failure::did_not_work(
        fmt::format("{}: no CiA 402 drive answers; check bit rate and power, or name the drives: --bus {}=1,2",
                    plan.link, plan.link));
  }
  for (const DriveGroup::Member& member : members) plan.drives.push_back({{}, member.product, member.node});
  plan.open = [options = named.options, members](const links::Heard& heard) {
    BusOptions heard_options = options;
    heard_options.heard = heard;
    return std::make_unique<OpenGroup>(heard_options, members);
  };
  return plan;
}

}  // namespace

std::vector<studio::BusPlan> find_drives(const std::vector<std::string>& buses, const BusOptions& common) {
  std::vector<studio::BusPlan> plans;
  std::vector<std::string> names;
  for (const std::string& text : buses) {
    const Named named = read_bus(text, common);
    const auto same = [&named](const studio::BusPlan& plan) { return plan.link == named.options.link; };
    if (std::any_of(plans.begin(), plans.end(), same)) {
      throw Failure::wrong_use(fmt::format("--bus {}: the bus is given twice; give all its drives in one --bus", text));
    }
    plans.push_back(plan_of(named));
    // Name and address: "ismc-1"; "ismk" without an address. A repeated name gets a number: "ismc-1-2".
    for (studio::DrivePlan& drive : plans.back().drives) {
      const std::string what = drive.product.empty() ? "drive" : drive.product;
      const std::string plain = drive.address == 0 ? what : fmt::format("{}-{}", what, drive.address);
      drive.name = plain;
      for (int n = 2; std::find(names.begin(), names.end(), drive.name) != names.end(); ++n) {
        drive.name = fmt::format("{}-{}", plain, n);
      }
      names.push_back(drive.name);
    }
  }
  return plans;
}

}  // namespace servodrome::app
