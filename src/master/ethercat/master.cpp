#include "master/ethercat/master.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "links/link_error.hpp"

namespace servodrome::master {

using ethercat::Command;

namespace {

constexpr const char* check_wiring =
    "check that the link leads to slaves, that they are powered and the cable is plugged";

constexpr const char* start_or_choose = "start `servodrome up` or give --bus LINK";

[[noreturn]] void throw_segment_failure(const std::string& name, const links::LinkError& error) {
  // UDP reports a missing listener only after the first frame.
  if (error.code() == std::errc::connection_refused)
    throw MasterError("no server listens there", name, start_or_choose);
  throw MasterError("the link failed: " + error.code().message(), name,
                    "check that the program or device at its other end still runs");
}

}  // namespace

std::string slave_text(const EthercatMaster& master, std::uint16_t station) {
  return fmt::format("{}, slave {:04X}h", master.name(), station);
}

std::unique_ptr<EthercatMaster> EthercatMaster::open(std::string_view link, const EthercatOptions& options) {
  try {
    return std::make_unique<EthercatMaster>(links::heard(links::open_ethercat_client(link), options.heard), options);
  } catch (const links::LinkError& error) {
    const auto& code = error.code();
    if (code == std::errc::operation_not_permitted || code == std::errc::permission_denied) {
      throw MasterError(error.what(), std::string(link),
                        "raw Ethernet needs CAP_NET_RAW: run it with sudo, or in a user namespace (tools/with-veth)");
    }
    throw MasterError(error.what(), std::string(link), "check --bus LINK, for example udp:127.0.0.1:34980");
  }
}

void EthercatMaster::no_answer() const {
  throw EthercatError(
      EthercatError::Kind::no_answer,
      fmt::format("frames do not come back within {} ms, {} times",
                  std::chrono::duration<double, std::milli>(options_.timeout).count(), options_.retries + 1),
      name(), check_wiring);
}

void EthercatMaster::absent(std::uint16_t station, std::uint16_t offset, const char* doing) const {
  throw EthercatError(EthercatError::Kind::working_counter,
                      fmt::format("{} {:04X}h: the slave does not answer (working counter 0)", doing, offset),
                      slave_text(*this, station),
                      "check with `servodrome scan` that it is still connected and powered");
}

// ---- Time ----

void EthercatMaster::run_cyclic_task() {
  if (task_ == nullptr || task_runs_ || now() < task_->due()) return;
  task_runs_ = true;
  struct End {
    bool& runs;
    ~End() { runs = false; }
  } const end{task_runs_};
  task_->run();
}

void EthercatMaster::wait(Time span) {
  const Time end = now() + span;
  while (true) {
    run_cyclic_task();
    const Time at = now();
    if (at >= end) return;
    const Time next = task_ != nullptr && !task_runs_ ? std::clamp(task_->due(), at, end) : end;
    try {
      if (next > at) client_->wait(next - at);
    } catch (const links::LinkError& error) {
      throw_segment_failure(name(), error);
    }
  }
}

// ---- Frames ----

void EthercatMaster::send(std::span<EthercatDatagram> datagrams, std::vector<Sent>& sent) {
  std::array<std::uint8_t, ethercat::max_payload> memory;
  for (std::size_t next = 0; next < datagrams.size();) {
    if (datagrams[next].answered) {
      ++next;
      continue;
    }
    auto writer = ethercat::FrameWriter::payload(memory);
    Sent frame{.first = next, .count = 0, .index = ++index_};
    for (; next < datagrams.size() && !datagrams[next].answered; ++next, ++frame.count) {
      EthercatDatagram& datagram = datagrams[next];
      if (writer.room() < static_cast<int>(datagram.data.size())) break;
      const auto place = writer.add(datagram.command, frame.index, datagram.address, datagram.data.size());
      std::copy(datagram.data.begin(), datagram.data.end(), place.begin());
      datagram.index = frame.index;
    }
    if (frame.count == 0) {
      throw MasterError(fmt::format("a datagram of {} bytes does not fit into a frame", datagrams[next].data.size()),
                        name(), "this is a mistake of the program; please report it");
    }
    try {
      client_->send(writer.bytes());
    } catch (const links::LinkError& error) {
      throw_segment_failure(name(), error);
    }
    sent.push_back(frame);
  }
}

// Returns true if the received frame belongs to one of `sent`, and copies its data.
bool EthercatMaster::take_answer(std::span<EthercatDatagram> datagrams, std::vector<Sent>& sent, std::size_t size) {
  ethercat::Frame frame;
  if (ethercat::parse_payload(std::span(received_).first(size), frame) != ethercat::FrameKind::ethercat) return false;
  const std::span<ethercat::Datagram> back = frame.datagrams();
  const auto match = std::find_if(sent.begin(), sent.end(), [&](const Sent& one) {
    if (one.back || one.count != back.size() || one.index != back[0].header[1]) return false;
    for (std::size_t i = 0; i < one.count; ++i) {
      const EthercatDatagram& datagram = datagrams[one.first + i];
      if (datagram.command != back[i].command || datagram.data.size() != back[i].length) return false;
    }
    return true;
  });
  if (match == sent.end()) {
    if (task_ != nullptr) task_->overdue(back);
    return false;
  }
  match->back = true;
  for (std::size_t i = 0; i < match->count; ++i) {
    EthercatDatagram& datagram = datagrams[match->first + i];
    std::copy_n(back[i].data(), back[i].length, datagram.data.begin());
    datagram.counter = back[i].working_counter();
    datagram.answered = true;
  }
  return true;
}

bool EthercatMaster::try_exchange(std::span<EthercatDatagram> datagrams, Time timeout) {
  run_cyclic_task();
  std::vector<Sent> sent;
  send(datagrams, sent);
  const Time deadline = now() + timeout;
  std::size_t missing = sent.size();
  while (missing > 0) {
    const Time at = now();
    std::size_t size = 0;
    try {
      size = client_->receive(received_, std::max(Time{0}, deadline - at));
    } catch (const links::LinkError& error) {
      throw_segment_failure(name(), error);
    }
    if (size != 0) {
      if (take_answer(datagrams, sent, size)) --missing;
    } else if (now() >= deadline) {
      lost_frames_ += missing;
      return false;
    }
  }
  return true;
}

void EthercatMaster::exchange(std::span<EthercatDatagram> datagrams) {
  for (EthercatDatagram& datagram : datagrams) datagram.answered = false;
  for (unsigned attempt = 0; attempt <= options_.retries; ++attempt) {
    if (try_exchange(datagrams, options_.timeout)) return;
  }
  no_answer();
}

// ---- Registers ----

unsigned EthercatMaster::read_if_there(std::uint16_t station, std::uint16_t offset, std::span<std::uint8_t> into) {
  EthercatDatagram datagram{.command = Command::fprd, .address = ethercat::address_of(station, offset), .data = into};
  exchange(datagram);
  return datagram.counter;
}

void EthercatMaster::read(std::uint16_t station, std::uint16_t offset, std::span<std::uint8_t> into) {
  if (read_if_there(station, offset, into) == 0) absent(station, offset, "reading");
}

unsigned EthercatMaster::write_if_accepted(std::uint16_t station, std::uint16_t offset,
                                           std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> data(bytes.begin(), bytes.end());
  EthercatDatagram datagram{.command = Command::fpwr, .address = ethercat::address_of(station, offset), .data = data};
  exchange(datagram);
  return datagram.counter;
}

void EthercatMaster::write(std::uint16_t station, std::uint16_t offset, std::span<const std::uint8_t> bytes) {
  if (write_if_accepted(station, offset, bytes) == 0) absent(station, offset, "writing");
}

unsigned EthercatMaster::write_all(std::uint16_t offset, std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> data(bytes.begin(), bytes.end());
  EthercatDatagram datagram{.command = Command::bwr, .address = ethercat::address_of(0, offset), .data = data};
  exchange(datagram);
  return datagram.counter;
}

}  // namespace servodrome::master
