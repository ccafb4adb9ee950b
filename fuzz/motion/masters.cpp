#include "masters.hpp"

#include <algorithm>
#include <chrono>

#include "drive/drive.hpp"
#include "ethercat/slave/slave.hpp"

namespace servodrome::motion {

namespace reg = ethercat::reg;
using dictionary::AbortCode;
using ethercat::Command;

namespace {

constexpr std::uint32_t cob_invalid = 0x80000000;
constexpr line::Time sdo_timeout = std::chrono::milliseconds(20);
constexpr std::uint16_t mailbox_bytes = 128;

void store(std::uint8_t* place, std::int64_t value, unsigned bytes) {
  for (unsigned i = 0; i < bytes; ++i) place[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> 8 * i);
}

unsigned size_of(dictionary::Dictionary& objects, std::uint16_t index, std::uint8_t sub) {
  const dictionary::Entry* entry = objects.find(index, sub);
  return entry == nullptr ? 0 : static_cast<unsigned>(dictionary::size_of(entry->type));
}

// Maps those of the objects that the device allows to be mapped. Returns the number of bytes.
std::size_t map(dictionary::Dictionary& objects, std::uint16_t mapping, std::span<const std::uint16_t> wanted,
                std::vector<std::uint16_t>* taken = nullptr) {
  objects.set_number(mapping, 0, 0);
  std::uint8_t count = 0;
  std::size_t bytes = 0;
  for (const std::uint16_t index : wanted) {
    const unsigned size = size_of(objects, index, 0);
    if (size == 0) continue;
    const auto entry = static_cast<std::int64_t>(std::uint32_t{index} << 16 | 8 * size);
    const auto next = static_cast<std::uint8_t>(count + 1);
    if (objects.set_number(mapping, next, entry) != AbortCode::none) continue;
    count = next;
    bytes += size;
    if (taken != nullptr) taken->push_back(index);
  }
  objects.set_number(mapping, 0, count);
  return bytes;
}

}  // namespace

bool ProcessValues::set(std::uint16_t index, std::int64_t value) {
  switch (index) {
    case 0x6040: controlword = static_cast<std::uint16_t>(value); return true;
    case 0x6060: mode = static_cast<std::int8_t>(value); return true;
    case 0x607A: position = static_cast<std::int32_t>(value); return true;
    case 0x60FF: velocity = static_cast<std::int32_t>(value); return true;
    case 0x6071: torque = static_cast<std::int16_t>(value); return true;
    case 0x60C1: record = static_cast<std::int32_t>(value); return true;
    default: return false;
  }
}

std::int64_t ProcessValues::get(std::uint16_t index) const {
  switch (index) {
    case 0x6040: return controlword;
    case 0x6060: return mode;
    case 0x607A: return position;
    case 0x60FF: return velocity;
    case 0x6071: return torque;
    case 0x60C1: return record;
    default: return 0;
  }
}

// --- CAN

CanMaster::CanMaster(line::Line& line, FrameListener& listener)
    : Master(line), listener_(listener), bus_(line.buses().front()->bus), nodes_(line.axes().size()) {
  port_ = bus_.attach(*this, 256);
  for (std::size_t i = 0; i < nodes_.size(); ++i) nodes_[i].id = line.axes()[i]->device().node_id();
}

CanMaster::~CanMaster() { bus_.detach(port_); }

// RPDO 1: controlword and mode; RPDOs 2 to 4: targets; TPDO 1: statusword, mode and error code; TPDO 2: position and
// velocity. Written without frames, because configuration is not tested here.
void CanMaster::set_up(std::size_t axis, bool mapped) {
  Node& node = nodes_[axis];
  node.id = line_.axes()[axis]->device().node_id();
  node.first = node.waiting = 0;
  node.busy = false;
  node.mapped = {};
  if (mapped) {
    dictionary::Dictionary& objects = line_.axes()[axis]->device().bus_dictionary();
    const auto pdo = [&](std::uint16_t parameter, std::uint16_t mapping, std::uint32_t cob,
                         std::initializer_list<std::uint16_t> wanted, std::vector<std::uint16_t>* taken) {
      objects.set_number(parameter, 1, cob_invalid | cob);
      const std::vector<std::uint16_t> list(wanted);
      const std::size_t bytes = map(objects, mapping, list, taken);
      if (bytes != 0) objects.set_number(parameter, 1, cob);
    };
    std::vector<std::uint16_t> taken;
    pdo(0x1400, 0x1600, 0x200U + node.id, {0x6040, 0x6060}, &taken);
    pdo(0x1401, 0x1601, 0x300U + node.id, {0x607A}, &taken);
    pdo(0x1402, 0x1602, 0x400U + node.id, {0x60FF}, &taken);
    pdo(0x1403, 0x1603, 0x500U + node.id, {0x6071}, &taken);
    pdo(0x1800, 0x1A00, 0x180U + node.id, {0x6041, 0x6061, 0x603F}, nullptr);
    pdo(0x1801, 0x1A01, 0x280U + node.id, {0x6064, 0x606C}, nullptr);
    objects.set_number(0x1800, 3, 10);
    objects.set_number(0x1801, 3, 10);
    for (std::size_t i = 0; i < process_objects.size(); ++i) {
      node.mapped[i] = std::find(taken.begin(), taken.end(), process_objects[i]) != taken.end();
    }
    node.mapped[1] = node.mapped[1] && node.mapped[0];
  }
  command(axis, Kind::nmt, 1);
}

void CanMaster::send(const canopen::Frame& frame) {
  if (!bus_.transmit(port_, frame, now())) ++refused_;
}

void CanMaster::command(std::size_t axis, Kind kind, std::int64_t value) {
  if (kind == Kind::heartbeat) {
    heartbeat_ = std::chrono::milliseconds(value);
    next_heartbeat_ = now();
  }
  if (kind != Kind::nmt) return;
  canopen::Frame frame{.id = 0, .length = 2};
  frame.data[0] = static_cast<std::uint8_t>(value);
  frame.data[1] = nodes_[axis].id;
  send(frame);
}

bool CanMaster::in_process_data(std::size_t axis, std::uint16_t index) const {
  const auto found = std::find(process_objects.begin(), process_objects.end(), index);
  return found != process_objects.end() &&
         nodes_[axis].mapped[static_cast<std::size_t>(found - process_objects.begin())];
}

void CanMaster::send_pdo(std::size_t axis, std::uint16_t index) {
  const ProcessValues& values = values_[axis];
  const std::uint8_t id = nodes_[axis].id;
  canopen::Frame frame;
  switch (index) {
    case 0x6040:
    case 0x6060:
      frame.id = 0x200U + id;
      frame.length = nodes_[axis].mapped[1] ? 3 : 2;
      store(frame.data.data(), values.controlword, 2);
      frame.data[2] = static_cast<std::uint8_t>(values.mode);
      break;
    case 0x607A:
      frame.id = 0x300U + id, frame.length = 4;
      store(frame.data.data(), values.position, 4);
      break;
    case 0x60FF:
      frame.id = 0x400U + id, frame.length = 4;
      store(frame.data.data(), values.velocity, 4);
      break;
    default: frame.id = 0x500U + id, frame.length = 2; store(frame.data.data(), values.torque, 2);
  }
  send(frame);
}

void CanMaster::write(std::size_t axis, std::uint16_t index, std::uint8_t sub, std::int64_t value, unsigned bytes,
                      bool pdo) {
  values_[axis].set(index, value);
  if (pdo && sub == 0 && in_process_data(axis, index)) return send_pdo(axis, index);
  if (bytes == 0 || bytes > 4) return;
  Node& node = nodes_[axis];
  if (node.waiting == node.requests.size()) return;
  Request& request = node.requests[(node.first + node.waiting++) % node.requests.size()];
  request.frame = {.id = 0x600U + node.id, .length = 8};
  request.frame.data = {static_cast<std::uint8_t>(0x23U | (4U - bytes) << 2U), static_cast<std::uint8_t>(index),
                        static_cast<std::uint8_t>(index >> 8), sub};
  store(&request.frame.data[4], value, bytes);
  if (!node.busy) next_request(node);
}

void CanMaster::next_request(Node& node) {
  node.busy = node.waiting != 0;
  if (!node.busy) return;
  send(node.requests[node.first].frame);
  node.first = (node.first + 1) % node.requests.size();
  --node.waiting;
  node.deadline = now() + sdo_timeout;
}

void CanMaster::cycle(bool sync) {
  if (sync) send({.id = 0x80});
}

bool CanMaster::poll() {
  for (Node& node : nodes_) {
    if (node.busy && now() >= node.deadline) next_request(node);
  }
  if (heartbeat_ <= line::Time{} || now() < next_heartbeat_) return false;
  canopen::Frame frame{.id = 0x700 + 127, .length = 1};
  frame.data[0] = 5;  // operational
  send(frame);
  next_heartbeat_ += heartbeat_;
  return true;
}

std::size_t CanMaster::axis_of(std::uint32_t id) const {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (nodes_[i].id == (id & 0x7F)) return i;
  }
  return nodes_.size();
}

void CanMaster::on_frame(const canopen::Frame& frame, line::Time at) {
  const std::size_t axis = axis_of(frame.id);
  if (axis == nodes_.size() || frame.extended) return;
  listener_.heard(axis, frame, at);
  Node& node = nodes_[axis];
  if ((frame.id & 0x780) == 0x580 && node.busy) {
    node.busy = node.waiting != 0;
    if (!node.busy) return;
    if (!bus_.transmit(port_, node.requests[node.first].frame, at)) ++refused_;
    node.first = (node.first + 1) % node.requests.size();
    --node.waiting;
    node.deadline = at + sdo_timeout;
  }
}

// --- EtherCAT

EthercatMaster::EthercatMaster(line::Line& line, std::int64_t cycle_us, bool sync0)
    : Master(line),
      bus_(line.ethercat_buses().front()->bus),
      cycle_us_(cycle_us),
      sync0_(sync0),
      slaves_(line.axes().size()) {}

unsigned EthercatMaster::send(Command command, std::uint32_t address, std::span<const std::uint8_t> data) {
  auto writer = ethercat::FrameWriter::ethernet(memory_);
  const auto place = writer.add(command, 0, address, data.size());
  std::copy(data.begin(), data.end(), place.begin());
  const auto passage = bus_.exchange(writer.bytes(), now());
  if (passage.exit == links::EthercatBus::Exit::lost) return 0;
  std::copy_n(place.begin(), std::min(place.size(), answer_.size()), answer_.begin());
  return ethercat::load_u16(place.data() + place.size());
}

unsigned EthercatMaster::put(std::size_t axis, std::uint16_t offset, std::span<const std::uint8_t> data) {
  return send(Command::apwr, ethercat::address_of(address(axis), offset), data);
}

void EthercatMaster::channel(std::size_t axis, unsigned number, std::uint16_t start, std::size_t length,
                             std::uint8_t control) {
  std::array<std::uint8_t, 8> settings{};
  store(settings.data(), start, 2);
  store(&settings[2], static_cast<std::int64_t>(length), 2);
  settings[4] = control;
  settings[6] = length != 0 ? 1 : 0;
  put(axis, static_cast<std::uint16_t>(reg::sync_manager + 8 * number), settings);
}

// Sets up mailbox, mapping (without frames) and SYNC0. poll() then requests the states step by step.
void EthercatMaster::set_up(std::size_t axis, bool mapped) {
  Slave& slave = slaves_[axis];
  slave = {};
  slave.wanted = 1;
  const std::array<std::uint8_t, 2> init{0x11, 0};
  put(axis, reg::al_control, init);
  channel(axis, 0, 0x1000, mailbox_bytes, 0x26);
  channel(axis, 1, 0x1100, mailbox_bytes, 0x22);
  const std::array<std::uint8_t, 2> pre{2, 0};
  put(axis, reg::al_control, pre);
  dictionary::Dictionary& objects = line_.axes()[axis]->device().bus_dictionary();
  if (mapped) {
    static constexpr std::array<std::uint16_t, 6> inputs{0x6041, 0x6061, 0x6064, 0x606C, 0x6077, 0x603F};
    map(objects, 0x1600, process_objects);
    map(objects, 0x1A00, inputs);
  }
  const auto layout = [&](std::uint16_t assignment, std::vector<Mapped>* list) {
    std::size_t bits = 0;
    for (int pdo = 1; pdo <= objects.number(assignment, 0); ++pdo) {
      const auto mapping = static_cast<std::uint16_t>(objects.number(assignment, static_cast<std::uint8_t>(pdo)));
      for (int entry = 1; entry <= objects.number(mapping, 0); ++entry) {
        const auto word = static_cast<std::uint32_t>(objects.number(mapping, static_cast<std::uint8_t>(entry)));
        if (list != nullptr && bits % 8 == 0) {
          list->push_back({static_cast<std::uint16_t>(word >> 16), bits / 8, (word & 0xFF) / 8});
        }
        bits += word & 0xFF;
      }
    }
    return (bits + 7) / 8;
  };
  slave.output_bytes = layout(0x1C12, &slave.outputs);
  slave.input_bytes = layout(0x1C13, nullptr);
  if (sync0_) {
    std::array<std::uint8_t, 8> bytes{};
    const std::int64_t cycle_ns = cycle_us_ * 1000;
    store(bytes.data(), cycle_ns, 4);
    put(axis, reg::sync0_cycle, std::span(bytes).first(4));
    send(Command::aprd, ethercat::address_of(address(axis), reg::system_time), bytes);
    std::uint64_t time = 0;
    for (unsigned i = 8; i-- > 0;) time = time << 8 | answer_[i];
    const auto period = static_cast<std::uint64_t>(cycle_ns);
    store(bytes.data(), static_cast<std::int64_t>((time / period + 2) * period), 8);
    put(axis, reg::sync_start_time, bytes);
    bytes[0] = 3;
    put(axis, reg::sync_activation, std::span(bytes).first(1));
  }
  channel(axis, 2, 0x1200, slave.output_bytes, 0x64);
  channel(axis, 3, 0x1500, slave.input_bytes, 0x20);
  slave.wanted = 8;
}

void EthercatMaster::lead(std::size_t axis) {
  Slave& slave = slaves_[axis];
  const auto state = static_cast<std::uint8_t>(line_.axes()[axis]->device().ethercat_slave()->state());
  if (slave.wanted == 0) return;
  if (state == slave.wanted) {
    slave.asked = 0;
    return;
  }
  std::uint8_t next = slave.wanted;
  if (slave.wanted > state) next = state == 1 ? 2 : state == 2 ? 4 : 8;
  if (next == slave.asked && next == 8) return;  // already requested: the slave waits for outputs or SYNC0
  slave.asked = next;
  const std::array<std::uint8_t, 2> control{static_cast<std::uint8_t>(next | 0x10), 0};
  put(axis, reg::al_control, control);
}

bool EthercatMaster::poll() {
  for (std::size_t i = 0; i < slaves_.size(); ++i) {
    lead(i);
    if (slaves_[i].wanted <= 1) continue;
    // Reads a waiting message, so that the mailbox is free again.
    constexpr std::uint16_t mailbox_status = reg::sync_manager + 8 + 5;
    constexpr std::uint8_t mailbox_full = 0x08;
    const std::array<std::uint8_t, 1> status{};
    const bool answers = send(Command::aprd, ethercat::address_of(address(i), mailbox_status), status) != 0;
    if (!answers || (answer_[0] & mailbox_full) == 0) continue;
    const std::array<std::uint8_t, mailbox_bytes> mail{};
    send(Command::aprd, ethercat::address_of(address(i), 0x1100), mail);
  }
  return false;
}

void EthercatMaster::command(std::size_t axis, Kind kind, std::int64_t value) {
  if (kind != Kind::al) return;
  slaves_[axis].wanted = static_cast<std::uint8_t>(value);
  slaves_[axis].asked = 0;
  lead(axis);
}

bool EthercatMaster::in_process_data(std::size_t axis, std::uint16_t index) const {
  const auto& outputs = slaves_[axis].outputs;
  return std::any_of(outputs.begin(), outputs.end(), [index](const Mapped& one) { return one.index == index; });
}

void EthercatMaster::write(std::size_t axis, std::uint16_t index, std::uint8_t sub, std::int64_t value, unsigned bytes,
                           bool) {
  values_[axis].set(index, value);
  if (sub == 0 && in_process_data(axis, index)) return;  // with the next cycle
  if (bytes == 0 || bytes > 4) return;
  std::array<std::uint8_t, mailbox_bytes> mail{10, 0, 0, 0, 0, 0x03, 0x00, 0x20};
  slaves_[axis].mail = slaves_[axis].mail % 7 + 1;
  mail[5] = static_cast<std::uint8_t>(0x03U | slaves_[axis].mail << 4);
  mail[8] = static_cast<std::uint8_t>(0x23U | (4U - bytes) << 2U);
  store(&mail[9], index, 2);
  mail[11] = sub;
  store(&mail[12], value, bytes);
  const std::array<std::uint8_t, mailbox_bytes> empty{};
  for (int i = 0; i < 9; ++i) {  // reads waiting emergencies
    if (send(Command::aprd, ethercat::address_of(address(axis), 0x1100), empty) == 0) break;
  }
  put(axis, 0x1000, mail);
  send(Command::aprd, ethercat::address_of(address(axis), 0x1100), empty);
}

void EthercatMaster::cycle(bool) {
  for (std::size_t i = 0; i < slaves_.size(); ++i) {
    const Slave& slave = slaves_[i];
    auto writer = ethercat::FrameWriter::ethernet(memory_);
    if (slave.output_bytes != 0) {
      const auto out = writer.add(Command::apwr, 0, ethercat::address_of(address(i), 0x1200), slave.output_bytes);
      dictionary::Dictionary& objects = line_.axes()[i]->device().bus_dictionary();
      // Mapped objects that the master does not set keep their present values.
      for (const Mapped& one : slave.outputs) {
        const bool own = std::find(process_objects.begin(), process_objects.end(), one.index) != process_objects.end();
        const std::int64_t value = own ? values_[i].get(one.index) : objects.number(one.index, 0);
        if (one.bytes <= 8) store(&out[one.at], value, one.bytes);
      }
    }
    if (slave.input_bytes != 0) {
      writer.add(Command::aprd, 0, ethercat::address_of(address(i), 0x1500), slave.input_bytes);
    }
    bus_.exchange(writer.bytes(), now());
  }
}

}  // namespace servodrome::motion
