#include "studio/line_traffic.hpp"

#include "ethercat/esc/esc.hpp"
#include "line/registry.hpp"

namespace servodrome::studio {
namespace {

// The objects of a drive, with its present PDO mappings.
master::DeviceModel model_of(line::Axis& axis) {
  const dictionary::Dictionary& dictionary = axis.device().dictionary();
  master::DeviceModel model = master::DeviceModel::of(dictionary.table(), axis.settings().product->name);
  if (!axis.powered()) return model;
  for (master::DeviceModel::Default& one : model.pdo_defaults) {
    const dictionary::Entry* entry = dictionary.find(one.object.index, one.object.sub);
    dictionary::ReadValue value;
    if (entry == nullptr || dictionary.read(*entry, value) != dictionary::AbortCode::none) continue;
    one.value = static_cast<std::uint32_t>(dictionary::decode_number(entry->type, value.bytes));
    one.adds_node_id = false;
  }
  return model;
}

}  // namespace

LineTraffic::LineTraffic(line::Line& line, line::bench::AnyBus bus) : line_(line), bus_(bus) {
  for (const auto& axis : line_.axes()) {
    const line::AxisSettings& its = axis->settings();
    if (const auto* can = std::get_if<line::NamedBus*>(&bus_); can != nullptr && its.bus) {
      if (line_.buses()[*its.bus].get() == *can) senders_[static_cast<std::uint32_t>(axis->port())] = its.name;
    }
    if (const auto* serial = std::get_if<line::NamedSerialBus*>(&bus_); serial != nullptr && its.serial) {
      if (line_.serial_buses()[its.serial->bus].get() == *serial) {
        senders_[static_cast<std::uint32_t>(axis->serial_line_port())] = its.name;
      }
    }
  }
}

const std::string& LineTraffic::name() const {
  return std::visit([](auto* bus) -> const std::string& { return bus->settings.name; }, bus_);
}

Medium LineTraffic::medium() const {
  if (std::holds_alternative<line::NamedBus*>(bus_)) return Medium::can;
  return std::holds_alternative<line::NamedSerialBus*>(bus_) ? Medium::serial : Medium::ethercat;
}

std::unique_ptr<line::TrafficTap> LineTraffic::tap(line::TrafficRing& ring) {
  return std::visit([&ring](auto* bus) { return line::TrafficTap::on(*bus, ring); }, bus_);
}

std::string LineTraffic::sender(std::uint32_t sender) const {
  const auto found = senders_.find(sender);
  return found != senders_.end() ? found->second : "";
}

void LineTraffic::introduce(TrafficDecoders& decoders) {
  for (const auto& axis : line_.axes()) {
    const line::AxisSettings& its = axis->settings();
    if (const auto* can = std::get_if<line::NamedBus*>(&bus_); can != nullptr && its.bus) {
      if (line_.buses()[*its.bus].get() == *can) decoders.can.set_model(axis->device().node_id(), model_of(*axis));
    }
    if (const auto* ethercat = std::get_if<line::NamedEthercatBus*>(&bus_); ethercat != nullptr && its.ethercat) {
      if (line_.ethercat_buses()[its.ethercat->bus].get() != *ethercat) continue;
      const auto position = static_cast<unsigned>(axis->position());
      decoders.ethercat.set_model(position, model_of(*axis));
      ethercat::Esc* esc = axis->device().ethercat_controller();
      if (!axis->powered() || esc == nullptr) continue;
      const std::uint8_t* address = esc->registers(ethercat::reg::station_address);
      const auto station = static_cast<std::uint16_t>(address[0] | address[1] << 8);
      if (station == 0) continue;  // no master has configured the slave
      for (const auto& [offset, bytes] :
           {std::pair{ethercat::reg::fmmu, 8 * 16}, std::pair{ethercat::reg::sync_manager, 8 * 8}}) {
        decoders.ethercat.preset(position, station, offset, {esc->registers(offset), static_cast<std::size_t>(bytes)});
      }
    }
    if (const auto* serial = std::get_if<line::NamedSerialBus*>(&bus_); serial != nullptr && its.serial) {
      if (line_.serial_buses()[its.serial->bus].get() != *serial || axis->device().serial_port() == nullptr) continue;
      const line::SerialInterface* interface = its.product->serial;
      const auto table = axis->device().dictionary().table();
      const std::string_view name = its.product->name;
      const auto model = interface != nullptr
                             ? master::SerialModel::of(table, interface->registers, interface->profile, name)
                             : master::SerialModel::of(table, {}, nullptr, name);
      decoders.serial.set_model(axis->device().serial_port()->station(), model);
      decoders.modbus_tcp.set_model(axis->device().serial_port()->station(), model);
    }
  }
}

}  // namespace servodrome::studio
