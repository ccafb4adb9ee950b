#include "studio/traffic_view.hpp"

#include <cstring>

#include "ethercat/esc/esc.hpp"
#include "line/registry.hpp"

namespace servodrome::studio {
namespace {

// The objects of a drive, and its PDOs as they are at this moment.
host::DeviceModel model_of(line::Axis& axis) {
  const dictionary::Dictionary& dictionary = axis.device().dictionary();
  host::DeviceModel model = host::DeviceModel::of(dictionary.table());
  if (!axis.powered()) return model;
  for (host::DeviceModel::Default& one : model.pdo_defaults) {
    const dictionary::Entry* entry = dictionary.find(one.object.index, one.object.sub);
    dictionary::ReadValue value;
    if (entry == nullptr || dictionary.read(*entry, value) != dictionary::AbortCode::none) continue;
    one.value = static_cast<std::uint32_t>(dictionary::decode_number(entry->type, value.bytes));
    one.adds_node_id = false;
  }
  return model;
}

// CAN objects travel through the ring as their bytes.
canopen::Frame frame_of(std::span<const std::uint8_t> bytes) {
  static_assert(std::is_trivially_copyable_v<canopen::Frame>);
  canopen::Frame frame;
  std::memcpy(&frame, bytes.data(), std::min(bytes.size(), sizeof frame));
  return frame;
}

}  // namespace

TrafficView::TrafficView(line::Line& line, line::bench::AnyBus bus) : line_(line), bus_(bus) {
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

void TrafficView::record(bool on) {
  if (on == recording()) return;
  if (!on) {
    flush();
    tap_.reset();
    return;
  }
  while (decode_some(1000)) {
  }
  learn_devices();
  tap_ = std::visit([this](auto* bus) { return line::TrafficTap::on(*bus, ring_); }, bus_);
}

void TrafficView::clear() {
  const bool was_on = recording();
  tap_.reset();
  // Numbers go on, so that nobody takes a new frame for one that he has seen.
  cursor_ = ring_.clear();
  forgotten_rows_ += rows_.size();
  rows_.clear();
  first_kept_ = cursor_.number;
  if (was_on) record(true);
}

void TrafficView::learn_devices() {
  for (const auto& axis : line_.axes()) {
    const line::AxisSettings& its = axis->settings();
    if (const auto* can = std::get_if<line::NamedBus*>(&bus_); can != nullptr && its.bus) {
      if (line_.buses()[*its.bus].get() == *can) can_.set_model(axis->device().node_id(), model_of(*axis));
    }
    if (const auto* ethercat = std::get_if<line::NamedEthercatBus*>(&bus_); ethercat != nullptr && its.ethercat) {
      if (line_.ethercat_buses()[its.ethercat->bus].get() != *ethercat) continue;
      const auto position = static_cast<unsigned>(axis->position());
      ethercat_.set_model(position, model_of(*axis));
      ethercat::Esc* esc = axis->device().ethercat_controller();
      if (!axis->powered() || esc == nullptr) continue;
      const std::uint8_t* address = esc->registers(ethercat::reg::station_address);
      const auto station = static_cast<std::uint16_t>(address[0] | address[1] << 8);
      if (station == 0) continue;  // no master has been there
      for (const auto& [offset, bytes] :
           {std::pair{ethercat::reg::fmmu, 8 * 16}, std::pair{ethercat::reg::sync_manager, 8 * 8}}) {
        ethercat_.preset(position, station, offset, {esc->registers(offset), static_cast<std::size_t>(bytes)});
      }
    }
    if (const auto* serial = std::get_if<line::NamedSerialBus*>(&bus_); serial != nullptr && its.serial) {
      if (line_.serial_buses()[its.serial->bus].get() != *serial || axis->device().serial_port() == nullptr) continue;
      const line::SerialInterface* interface = its.product->serial;
      const auto table = axis->device().dictionary().table();
      const auto model = interface != nullptr ? host::SerialModel::of(table, interface->registers, interface->profile)
                                              : host::SerialModel::of(table, {}, nullptr);
      serial_.set_model(axis->device().serial_port()->station(), model);
      modbus_tcp_.set_model(axis->device().serial_port()->station(), model);
    }
  }
}

bool TrafficView::decode_some(unsigned frames) {
  for (unsigned i = 0; i < frames; ++i) {
    const std::uint64_t expected = cursor_.number;
    const auto frame = ring_.next(cursor_);
    if (!frame) return false;
    missed_ += frame->number - expected;
    decode(*frame);
  }
  return true;
}

std::string TrafficView::sender_of(const line::TrafficFrame& frame) const {
  switch (frame.kind) {
    case line::TrafficKind::ethernet_out: return "master";
    case line::TrafficKind::ethernet_in: return "slaves";
    case line::TrafficKind::modbus_tcp: return frame.from_master ? "master" : "drive";
    default: break;
  }
  const auto found = senders_.find(frame.sender);
  return found != senders_.end() ? found->second : "master";
}

void TrafficView::add(const line::TrafficFrame& frame, host::Decoded decoded) {
  rows_.push_back({frame.number, sender_of(frame), std::move(decoded)});
  if (rows_.size() <= most_rows) return;
  // All of a frame's rows, or none.
  first_kept_ = rows_.front().number + 1;
  while (!rows_.empty() && rows_.front().number < first_kept_) {
    rows_.pop_front();
    ++forgotten_rows_;
  }
}

void TrafficView::decode(const line::TrafficFrame& frame) {
  switch (frame.kind) {
    case line::TrafficKind::can:
    case line::TrafficKind::can_dropped: {
      host::Decoded decoded = can_.decode(frame_of(frame.bytes), frame.at);
      if (frame.kind == line::TrafficKind::can_dropped) {
        decoded.error = true;
        decoded.text += " (dropped: nobody received it)";
      }
      add(frame, std::move(decoded));
      break;
    }
    case line::TrafficKind::can_error: {
      host::Decoded decoded;
      decoded.time = frame.at;
      decoded.kind = host::FrameKind::error;
      decoded.error = true;
      decoded.raw = host::raw_text(frame_of(frame.bytes));
      decoded.text = "error frame: the frame is sent again";
      add(frame, std::move(decoded));
      break;
    }
    case line::TrafficKind::ethernet_out:
    case line::TrafficKind::ethernet_in:
      for (host::Decoded& one : ethercat_.decode(frame.bytes, frame.at)) add(frame, std::move(one));
      break;
    case line::TrafficKind::serial: {
      const auto side = frame.from_master ? links::SerialSender::master : links::SerialSender::drive;
      for (host::Decoded& one : serial_.decode(frame.bytes, frame.at, side)) add(frame, std::move(one));
      break;
    }
    case line::TrafficKind::modbus_tcp:
      add(frame, modbus_tcp_.decode_message(frame.bytes, frame.at, frame.from_master, 0));
      break;
  }
}

}  // namespace servodrome::studio
