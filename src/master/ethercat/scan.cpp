#include "master/ethercat/scan.hpp"

#include <fmt/format.h>

#include "master/ethercat/sii_client.hpp"

namespace servodrome::master {

namespace reg = ethercat::reg;
using ethercat::Command;

unsigned count_slaves(EthercatMaster& master) {
  std::array<std::uint8_t, 1> type{};
  EthercatDatagram datagram{.command = Command::brd, .address = ethercat::address_of(0, reg::type), .data = type};
  try {
    master.exchange(datagram);
  } catch (const EthercatError& error) {
    if (error.kind() != EthercatError::Kind::no_answer) throw;
    return 0;
  }
  return datagram.counter;
}

namespace {

// Reads the same register of all slaves, addressed by position.
std::vector<std::uint16_t> read_each(EthercatMaster& master, unsigned count, std::uint16_t offset) {
  std::vector<std::array<std::uint8_t, 2>> data(count);
  std::vector<EthercatDatagram> datagrams;
  for (unsigned i = 0; i < count; ++i) {
    datagrams.push_back({.command = Command::aprd,
                         .address = ethercat::address_of(static_cast<std::uint16_t>(0U - i), offset),
                         .data = data[i]});
  }
  master.exchange(datagrams);
  std::vector<std::uint16_t> values;
  for (unsigned i = 0; i < count; ++i) {
    if (datagrams[i].counter == 0) {
      throw EthercatError(EthercatError::Kind::working_counter,
                          fmt::format("the slave at position {} of {} does not answer", i + 1, count), master.name(),
                          "the segment changes during the scan: check for loose cables, and scan again");
    }
    values.push_back(ethercat::load_u16(data[i].data()));
  }
  return values;
}

// Keeps the station addresses, because another master may be using them. A slave gets a new address only if it has
// none, if a slave before it has the same address, or if another slave answers to this address as its alias.
std::vector<std::uint16_t> give_stations(EthercatMaster& master, const std::vector<std::uint16_t>& aliases) {
  constexpr std::uint16_t alias_enabled = 0x0100;  // bit 24 of DL control, here in its upper half
  const auto count = static_cast<unsigned>(aliases.size());
  const std::vector<std::uint16_t> present = read_each(master, count, reg::station_address);
  const std::vector<std::uint16_t> control = read_each(master, count, reg::dl_control + 2);
  std::vector<std::uint16_t> stations(count, 0);
  const auto taken = [&](unsigned self, std::uint16_t address) {
    for (unsigned i = 0; i < count; ++i) {
      if (i != self && (stations[i] == address || ((control[i] & alias_enabled) != 0 && aliases[i] == address))) {
        return true;
      }
    }
    return address == 0;
  };
  for (unsigned i = 0; i < count; ++i) {
    if (!taken(i, present[i])) stations[i] = present[i];
  }
  for (unsigned i = 0; i < count; ++i) {
    if (stations[i] != 0) continue;
    auto wanted = static_cast<std::uint16_t>(first_station + i);
    while (taken(i, wanted)) ++wanted;
    stations[i] = wanted;
    std::array<std::uint8_t, 2> data{};
    ethercat::store_u16(data.data(), wanted);
    EthercatDatagram datagram{.command = Command::apwr,
                              .address = ethercat::address_of(static_cast<std::uint16_t>(0U - i), reg::station_address),
                              .data = data};
    master.exchange(datagram);
  }
  return stations;
}

}  // namespace

std::vector<FoundSlave> scan_slaves(EthercatMaster& master) {
  const unsigned count = count_slaves(master);
  std::vector<FoundSlave> slaves;
  if (count == 0) return slaves;
  const auto aliases = read_each(master, count, reg::station_alias);
  const auto stations = give_stations(master, aliases);
  const auto dl_status = read_each(master, count, reg::dl_status);
  const auto features = read_each(master, count, reg::features);
  for (unsigned i = 0; i < count; ++i) {
    FoundSlave slave{.position = static_cast<std::uint16_t>(i + 1),
                     .station = stations[i],
                     .alias = aliases[i],
                     .status = {},
                     .dl_status = dl_status[i],
                     .features = features[i],
                     .sii = {}};
    slave.status = read_al_status(master, slave.station);
    slave.sii = SiiClient(master, slave.station).content();
    slaves.push_back(std::move(slave));
  }
  return slaves;
}

std::string text_of_links(const FoundSlave& slave) {
  std::string text;
  for (unsigned port = 0; port < 4; ++port) {
    if (slave.link(port)) text += fmt::format("{}{}", text.empty() ? "" : " ", port);
  }
  return text.empty() ? "-" : text;
}

}  // namespace servodrome::master
