#include "tools/sniff/ethercat_decoder.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "ethercat/esc/registers.hpp"
#include "tools/sniff/ethercat_names.hpp"

namespace servodrome::master {
namespace {

namespace reg = ethercat::reg;
using ethercat::Command;
using ethercat::Datagram;

constexpr std::size_t most_under_way = 64;    // frames that a master may have sent before the first returns
constexpr std::uint8_t processed_bit = 0x02;  // in the first byte of the source address

bool writes(Command command) {
  switch (command) {
    case Command::apwr:
    case Command::aprw:
    case Command::fpwr:
    case Command::fprw:
    case Command::bwr:
    case Command::brw:
    case Command::lwr:
    case Command::lrw: return true;
    default: return false;
  }
}
bool is_logical(Command command) {
  return command == Command::lrd || command == Command::lwr || command == Command::lrw;
}
bool is_by_position(Command command) {
  return command == Command::aprd || command == Command::apwr || command == Command::aprw || command == Command::armw;
}
bool is_by_station(Command command) {
  return command == Command::fprd || command == Command::fpwr || command == Command::fprw || command == Command::frmw;
}

std::uint32_t signature(const Datagram& datagram) {
  return static_cast<std::uint32_t>(datagram.header[0]) << 24 | static_cast<std::uint32_t>(datagram.header[1]) << 16 |
         datagram.length;
}

}  // namespace

EthercatDecoder::EthercatDecoder() : standard_(DeviceModel::standard()) {}

void EthercatDecoder::set_model(unsigned position, DeviceModel model) {
  models_[position] = std::make_shared<const DeviceModel>(std::move(model));
}

std::shared_ptr<const DeviceModel> EthercatDecoder::model_of(unsigned position) const {
  for (const unsigned wanted : {position, 0U}) {
    if (const auto found = models_.find(wanted); found != models_.end()) return found->second;
  }
  return standard_;
}

EthercatDecoder::Slave& EthercatDecoder::slave(std::uint16_t station) {
  const auto [place, is_new] = slaves_.try_emplace(station);
  if (is_new) {
    place->second.model = model_of(0);
    place->second.pdos = place->second.model->pdo_objects(0);
  }
  return place->second;
}

void EthercatDecoder::preset(unsigned position, std::uint16_t station, std::uint16_t offset,
                             std::span<const std::uint8_t> registers) {
  Slave& one = slave(station);
  if (one.position != position) {
    one.position = position;
    one.model = model_of(position);
    one.pdos = one.model->pdo_objects(0);
  }
  learn(one, offset, registers);
}

// Finds the oldest outstanding frame with the same datagrams as `frame`. Outstanding frames older than that count as
// lost.
bool EthercatDecoder::match(const Sent& frame, Sent& found) {
  const auto place =
      std::find_if(sent_.begin(), sent_.end(), [&](const Sent& one) { return one.datagrams == frame.datagrams; });
  if (place == sent_.end()) return false;
  lost_ += static_cast<std::uint64_t>(place - sent_.begin());
  found = std::move(*place);
  sent_.erase(sent_.begin(), place + 1);
  return true;
}

std::vector<Decoded> EthercatDecoder::decode(std::span<const std::uint8_t> ethernet_frame, Time time) {
  std::vector<std::uint8_t> bytes(ethernet_frame.begin(), ethernet_frame.end());
  ethercat::Frame frame;
  const auto kind = ethercat::parse_ethernet(bytes, frame);
  if (kind != ethercat::FrameKind::ethercat) {
    Decoded decoded;
    decoded.time = time;
    decoded.raw = hex_text(ethernet_frame, 16);
    decoded.error = kind == ethercat::FrameKind::malformed;
    decoded.text = decoded.error ? "EtherCAT frame whose datagrams do not fit into it" : "no EtherCAT frame";
    return {std::move(decoded)};
  }
  Sent own;
  for (const Datagram& datagram : frame.datagrams()) {
    own.datagrams.push_back(signature(datagram));
    own.positions.push_back(datagram.position());
  }
  const bool returned = (frame.source_address[0] & processed_bit) != 0;
  Sent sent;
  bool known = false;
  if (returned) {
    ++returned_frames_;
    known = match(own, sent);
  } else {
    ++sent_frames_;
    sent_.push_back(own);
    if (sent_.size() > most_under_way) sent_.pop_front(), ++lost_;
    if (!show_sent_) return {};
  }
  std::vector<Decoded> all;
  std::size_t number = 0;
  for (const Datagram& datagram : frame.datagrams()) {
    all.push_back(
        decode_datagram(datagram, known || !returned ? (returned ? &sent : &own) : nullptr, number++, time, returned));
  }
  return all;
}

Decoded EthercatDecoder::decode_datagram(const Datagram& datagram, const Sent* sent, std::size_t number, Time time,
                                         bool returned) {
  Decoded decoded;
  decoded.time = time;
  decoded.kind = FrameKind::registers;
  const std::span<const std::uint8_t> data(datagram.data(), datagram.length);
  const Command command = datagram.command;
  const char* word = name(command);
  if (word == nullptr) {
    decoded.kind = FrameKind::garbage;
    decoded.error = true;
    decoded.text = fmt::format("there is no command {}", datagram.header[0]);
    decoded.raw = hex_text(data, 16);
    return decoded;
  }
  const unsigned working_counter = datagram.working_counter();
  decoded.raw = fmt::format("{} {:08X}h [{}]", word, datagram.logical(), datagram.length);
  if (returned) decoded.raw += fmt::format(" wkc {}", working_counter);
  const bool addressed = is_by_position(command) || is_by_station(command);
  const std::uint16_t offset = datagram.offset();
  // A read datagram has no data yet when the master sends it.
  const bool has_data = returned ? working_counter != 0 : writes(command);
  const bool write = writes(command);
  if (command == Command::nop) {
    decoded.text = "nothing";
  } else if (is_logical(command)) {
    decoded.kind = FrameKind::process_data;
    describe_logical(datagram, decoded);
  } else if (addressed) {
    Slave* one = nullptr;
    if (is_by_station(command)) {
      const std::uint16_t station = datagram.position();
      one = &slave(station);
      decoded.node = one->position != 0 ? one->position : station;
      decoded.source =
          one->position != 0 ? fmt::format("slave {}", one->position) : fmt::format("slave {:04X}h", station);
    } else if (sent != nullptr) {
      const auto position = static_cast<std::uint16_t>(1U - sent->positions[number]);
      decoded.node = position;
      decoded.source = fmt::format("slave {}", position);
      if (command == Command::apwr && offset == reg::station_address && data.size() >= 2 && has_data) {
        const std::uint16_t station = ethercat::load_u16(data.data());
        slaves_.erase(station);
        Slave& made = slave(station);
        made.position = position;
        made.model = model_of(position);
        made.pdos = made.model->pdo_objects(0);
      }
    } else {
      decoded.source = "a slave";
    }
    if (returned && working_counter == 0) {
      decoded.error = true;
      decoded.text = fmt::format("no slave answered: {} {}", write ? "write" : "read", register_name(offset));
    } else if (one != nullptr && has_data) {
      describe_memory(*one, offset, data, write, decoded);
    } else {
      if (offset == reg::al_control || offset == reg::al_status) decoded.kind = FrameKind::state;
      decoded.text = has_data ? register_text(offset, data) : register_name(offset);
      decoded.text = (write ? "write " : has_data ? "" : "read ") + decoded.text;
    }
  } else {
    decoded.source = "all slaves";
    if (offset == reg::al_control || offset == reg::al_status) decoded.kind = FrameKind::state;
    decoded.text = (write ? "write " : "") + (has_data ? register_text(offset, data) : register_name(offset));
    if (returned) decoded.text += fmt::format(", {} of them", working_counter);
  }
  return decoded;
}

// Learns the sync managers and FMMUs from the master's writes, which may start at any register.
void EthercatDecoder::learn(Slave& slave, std::uint16_t offset, std::span<const std::uint8_t> data) {
  const auto whole = [&](std::uint16_t first, unsigned bytes, unsigned least, unsigned count, const auto& take) {
    for (unsigned i = 0; i < count; ++i) {
      const unsigned begin = first + i * bytes;
      if (begin < offset || begin + least > offset + data.size()) continue;
      take(i, &data[begin - offset]);
    }
  };
  whole(reg::sync_manager, reg::sync_manager_bytes, 4, 16, [&](unsigned i, const std::uint8_t* at) {
    slave.sync_managers[i] = {ethercat::load_u16(at), ethercat::load_u16(at + 2)};
  });
  whole(reg::fmmu, ethercat::Fmmu::size, 13, 16,
        [&](unsigned i, const std::uint8_t* at) { slave.fmmus[i] = ethercat::Fmmu::from(at); });
}

void EthercatDecoder::describe_memory(Slave& slave, std::uint16_t offset, std::span<const std::uint8_t> data,
                                      bool write, Decoded& decoded) {
  if (write) learn(slave, offset, data);
  if (offset < reg::process_memory) {
    if (offset == reg::al_control || offset == reg::al_status) decoded.kind = FrameKind::state;
    decoded.error = offset == reg::al_status && data.size() >= 2 && (data[0] & 0x10) != 0;
    decoded.text = (write ? "write " : "") + register_text(offset, data);
    return;
  }
  for (const auto& [number, area] : slave.sync_managers) {
    if (number > 1 || area.length == 0 || offset != area.start) continue;
    return describe_mailbox(slave, data.first(std::min<std::size_t>(data.size(), area.length)), write, decoded);
  }
  decoded.text = fmt::format("{}{}", write ? "write " : "", register_text(offset, data));
}

// Process data of all slaves whose FMMUs map into the datagram.
void EthercatDecoder::describe_logical(const Datagram& datagram, Decoded& decoded) {
  const std::uint64_t begin = std::uint64_t{datagram.logical()} * 8;
  const std::uint64_t end = begin + datagram.length * 8U;
  const std::span<const std::uint8_t> data(datagram.data(), datagram.length);
  for (const auto& [station, slave] : slaves_) {
    for (const auto& [number, fmmu] : slave.fmmus) {
      const std::uint64_t first = fmmu.logical_bit();
      if (!fmmu.active || first < begin || first >= end) continue;
      const auto manager =
          std::find_if(slave.sync_managers.begin(), slave.sync_managers.end(), [&fmmu = fmmu](const auto& one) {
            return one.first >= 2 && one.second.length != 0 && one.second.start == fmmu.physical;
          });
      if (manager == slave.sync_managers.end()) continue;
      const bool outputs = fmmu.writes && !fmmu.reads;
      const auto mapping =
          slave.pdos.assigned(static_cast<std::uint16_t>(PdoObjects::output_assignment + (outputs ? 0 : 1)));
      const std::string who =
          slave.position != 0 ? fmt::format("slave {}", slave.position) : fmt::format("slave {:04X}h", station);
      std::string what;
      if (mapping) {
        auto values = values_of(*mapping, data, static_cast<unsigned>(first - begin), slave.model->catalogue);
        what = text_of(values);
        for (DecodedValue& value : values) {
          decoded.objects.push_back(value.object);
          decoded.values.push_back(std::move(value));
        }
      } else if (fmmu.whole_bytes()) {
        const auto at = static_cast<std::size_t>((first - begin) / 8);
        what = hex_text(data.subspan(at, std::min<std::size_t>(fmmu.length, data.size() - at)));
      }
      decoded.text += fmt::format("{}{} {}: {}", decoded.text.empty() ? "" : "; ", who, outputs ? "out" : "in", what);
    }
  }
  if (decoded.text.empty()) decoded.text = fmt::format("process data {}", hex_text(data));
  // A lower working counter than before means that a slave did not take part.
  const std::uint64_t key =
      std::uint64_t{datagram.header[0]} << 48 | std::uint64_t{datagram.length} << 32 | datagram.logical();
  std::uint16_t& best = best_working_counter_[key];
  const std::uint16_t counter = datagram.working_counter();
  if (counter < best) {
    decoded.error = true;
    decoded.text += fmt::format(" (working counter {}, it was {})", counter, best);
  }
  best = std::max(best, counter);
}

}  // namespace servodrome::master
