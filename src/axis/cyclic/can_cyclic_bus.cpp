#include "axis/cyclic/can_cyclic_bus.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "axis/axis402.hpp"
#include "axis/cia402_words.hpp"
#include "axis/cyclic/interpolation_time.hpp"
#include "axis/cyclic/quick_stop.hpp"

namespace servodrome::master {

namespace {

constexpr std::uint32_t not_in_use = 0x80000000U;
constexpr std::uint8_t every_sync = 1;
constexpr std::uint8_t most_pdos = 8;
constexpr Time stopping = std::chrono::seconds(2);
constexpr Time polling = std::chrono::milliseconds(5);
constexpr unsigned most_attempts = 2;    // to restore one object, and for a step that the program has interrupted
constexpr unsigned most_unanswered = 3;  // attempts in a row before a node is regarded as silent

constexpr PdoObject controlword{{0x6040, 0}, 16};
constexpr PdoObject mode{{0x6060, 0}, 8};
constexpr PdoObject target_position{{0x607A, 0}, 32};
constexpr PdoObject target_velocity{{0x60FF, 0}, 32};
constexpr PdoObject target_torque{{0x6071, 0}, 16};
constexpr PdoObject interpolated_position{{0x60C1, 1}, 32};
constexpr PdoObject statusword{{0x6041, 0}, 16};
constexpr PdoObject mode_display{{0x6061, 0}, 8};
constexpr PdoObject position{{0x6064, 0}, 32};
constexpr PdoObject velocity{{0x606C, 0}, 32};
constexpr PdoObject torque{{0x6077, 0}, 16};
constexpr PdoObject error_code{{0x603F, 0}, 16};

std::uint32_t word_of(const PdoObject& entry) {
  return static_cast<std::uint32_t>(entry.object.index) << 16 | static_cast<std::uint32_t>(entry.object.sub) << 8 |
         entry.bits;
}

// Carries out a step of close(), and stores the first exception in `problem`. A timer or a listener of the program may
// throw while the step waits, for example at Ctrl-C: then the step runs once more.
template <typename Step>
void carry_out(const Step& step, std::exception_ptr& problem) {
  for (unsigned attempt = 1; attempt <= most_attempts; ++attempt) {
    try {
      step();
      return;
    } catch (const MasterError&) {
      if (!problem) problem = std::current_exception();
      return;
    } catch (...) {
      if (!problem) problem = std::current_exception();
    }
  }
}

}  // namespace

CanDrive synchronous_position_drive(std::uint8_t node_id) {
  return {.node_id = node_id,
          .rpdos = {{controlword, mode, target_position}},
          .tpdos = {{statusword, mode_display, position}, {velocity}}};
}

CanDrive synchronous_drive(std::uint8_t node_id) {
  return {.node_id = node_id,
          .rpdos = {{controlword, mode, target_position}, {target_velocity, target_torque}},
          .tpdos = {{statusword, mode_display, position}, {velocity, torque, error_code}}};
}

CanDrive interpolated_position_drive(std::uint8_t node_id) {
  constexpr std::int64_t interpolated_position_mode = 7;
  return {.node_id = node_id,
          .rpdos = {{controlword, interpolated_position}},
          .tpdos = {{statusword, position}},
          .values = {{{0x6060, 0}, interpolated_position_mode, 1}}};
}

// ---- The image ----

std::optional<ProcessObject> CanCyclicBus::Station::find(std::vector<Channel>& channels, ObjectAddress object) {
  for (Channel& channel : channels) {
    unsigned first = 0;
    for (const std::uint32_t word : channel.pdo.mapping) {
      const unsigned bits = word & 0xFF;
      if (word >> 16 == object.index && (word >> 8 & 0xFF) == object.sub) {
        return ProcessObject(channel.bytes.data(), {first, bits});
      }
      first += bits;
    }
  }
  return std::nullopt;
}

bool CanCyclicBus::Station::complete() const {
  return std::all_of(tpdos.begin(), tpdos.end(), [](const Channel& channel) { return channel.arrived; });
}

// ---- Set-up ----

CanCyclicBus::CanCyclicBus(Bus& bus, std::vector<CanDrive> drives, const CanCyclicOptions& options)
    : bus_(bus), master_(bus), options_(options) {
  for (CanDrive& drive : drives) stations_.push_back(std::make_unique<Station>(bus, std::move(drive), options.sdo));
  open_ = true;
  try {
    for (const auto& station : stations_) {
      master_.command(NmtCommand::enter_pre_operational, station->drive.node_id);
      set_up(*station);
    }
    listening_ = bus_.listen([this](const Frame& frame) { receive(frame); });
    for (const auto& station : stations_) master_.command(NmtCommand::start, station->drive.node_id);
    // Two ticks in a period: SYNC at its start; half a period later the waiting for TPDOs ends.
    ticking_ = bus_.every(options_.period / 2, [this] { tick(); });
  } catch (...) {
    try {
      close();
    } catch (...) {
      // The first exception is rethrown below; this one is ignored.
    }
    throw;
  }
}

CanCyclicBus::~CanCyclicBus() {
  try {
    close();
  } catch (...) {
    // The destructor ignores that some objects could not be restored, for example because the node no longer answers.
  }
}

void CanCyclicBus::set_value(Station& station, const CanDrive::Value& value) {
  SdoClient& objects = station.objects;
  const std::vector<std::byte> before = objects.upload(value.object);
  std::int64_t old = 0;
  if (!before.empty()) std::memcpy(&old, before.data(), std::min(before.size(), sizeof old));
  const auto bytes = std::as_bytes(std::span(&value.value, 1)).first(std::min<std::size_t>(value.bytes, 8));
  // Stores the old value before the download, because the object may have the new value even if the answer to the
  // download is lost.
  station.values_before.push_back({value.object, old, value.bytes});
  objects.download(value.object, bytes);
}

void CanCyclicBus::set_interpolation_time(Station& station) {
  if (!station.objects.read_if_present<std::uint8_t>(0x60C2, 1)) return;
  const auto time = interpolation_time_of(options_.period);
  if (!time) {
    throw MasterError(fmt::format("a period of {} us cannot be written to 60C2h", options_.period.count() / 1000),
                      station.where(), periods_that_can_be_written);
  }
  set_value(station, {{0x60C2, 1}, time->value, 1});
  if (station.objects.read_if_present<std::int8_t>(0x60C2, 2)) set_value(station, {{0x60C2, 2}, time->index, 1});
}

void CanCyclicBus::set_up_pdos(Station& station, bool transmit) {
  const auto& wanted = transmit ? station.drive.tpdos : station.drive.rpdos;
  auto& channels = transmit ? station.tpdos : station.rpdos;
  const std::uint32_t default_base = transmit ? 0x180 : 0x200;
  for (std::uint8_t number = 0; number < most_pdos; ++number) {
    const std::size_t entries = number < wanted.size() ? wanted[number].size() : 0;
    if (options_.between) options_.between();
    const auto before = read_pdo(station.objects, transmit, number, entries);
    if (!before) {
      if (number >= wanted.size()) return;
      throw MasterError(fmt::format("it has {} {}PDOs, and {} are needed", number, transmit ? "T" : "R", wanted.size()),
                        station.where(), "exchange fewer objects");
    }
    if (number >= wanted.size()) {
      // A TPDO that is not wanted would use bus bandwidth that the synchronous PDOs need.
      if (!transmit || !before->in_use()) continue;
      PdoParameters off = *before;
      off.cob_id |= not_in_use;
      station.pdos_before.push_back(*before);
      write_pdo(station.objects, off);
      continue;
    }
    PdoParameters pdo{.transmit = transmit, .number = number, .transmission_type = every_sync};
    for (const PdoObject& entry : wanted[number]) pdo.mapping.push_back(word_of(entry));
    if (pdo.bytes() > 8) {
      throw MasterError(fmt::format("{} bytes do not fit into a PDO", pdo.bytes()), station.where(),
                        "map fewer objects");
    }
    const std::uint32_t id =
        before->can_id() != 0 ? before->can_id() : default_base + 0x100U * number + station.drive.node_id;
    pdo.cob_id = (before->cob_id & ~(not_in_use | 0x7FFU)) | id;
    station.pdos_before.push_back(*before);
    write_pdo(station.objects, pdo);
    channels.push_back({.pdo = pdo});
  }
}

void CanCyclicBus::set_up(Station& station) {
  set_up_pdos(station, false);
  set_up_pdos(station, true);
  for (const CanDrive::Value& value : station.drive.values) set_value(station, value);
  if (station.drive.sets_interpolation_time) set_interpolation_time(station);
  // Outputs start with the present values of the objects. The controlword starts with 0, disable voltage: an enabled
  // drive switches its motor off, so the caller stops and disables the drives before.
  for (Station::Channel& channel : station.rpdos) {
    unsigned first = 0;
    for (const std::uint32_t word : channel.pdo.mapping) {
      const ObjectAddress object{static_cast<std::uint16_t>(word >> 16), static_cast<std::uint8_t>(word >> 8)};
      ProcessObject place(channel.bytes.data(), {first, word & 0xFF});
      first += word & 0xFF;
      if (object.index == 0x6040) continue;
      const std::vector<std::byte> bytes = station.objects.upload(object);
      std::uint64_t value = 0;
      if (!bytes.empty()) std::memcpy(&value, bytes.data(), std::min(bytes.size(), sizeof value));
      place.set_raw(value);
    }
  }
}

// Restores the objects, the last changed one first. Repeats each write that gets no answer once. An error does not
// prevent the restoring of the other objects, unless the node has not answered `most_unanswered` attempts in a row:
// then the function gives up, to avoid further timeouts. Throws the first error at the end.
void CanCyclicBus::put_back(Station& station) {
  master_.command(NmtCommand::enter_pre_operational, station.drive.node_id);
  unsigned unanswered = 0;  // attempts in a row
  std::exception_ptr problem;
  const auto restore = [&](const auto& write) {
    for (unsigned attempt = 1; unanswered < most_unanswered; ++attempt) {
      try {
        write();
        unanswered = 0;
        return;
      } catch (const ObjectError& error) {
        unanswered = error.answered() ? 0 : unanswered + 1;
        if (!error.answered() && attempt < most_attempts && unanswered < most_unanswered) continue;
        if (!problem) problem = std::current_exception();
        return;
      }
    }
  };
  for (; !station.values_before.empty(); station.values_before.pop_back()) {
    const CanDrive::Value& value = station.values_before.back();
    restore(
        [&] { station.objects.download(value.object, std::as_bytes(std::span(&value.value, 1)).first(value.bytes)); });
  }
  for (; !station.pdos_before.empty(); station.pdos_before.pop_back()) {
    if (options_.between) options_.between();
    restore([&] { write_pdo(station.objects, station.pdos_before.back()); });
  }
  if (problem) std::rethrow_exception(problem);
}

// RPDOs and a SYNC stop all drives at the same time. By SDO alone, a silent node would delay the stop of the next ones
// by its timeout.
void CanCyclicBus::send_quick_stops() {
  if (!last_sync_) return;  // no cycle has run
  bool is_any_enabled = false;
  for (const auto& station : stations_) is_any_enabled = request_quick_stop(*station) || is_any_enabled;
  if (!is_any_enabled) return;
  send_outputs();
  master_.send_sync();
}

// Stops by SDO the drives that did not receive the RPDO. Sends the command to all drives before it waits for the first.
void CanCyclicBus::stop_drives(std::exception_ptr& problem) {
  carry_out([&] { send_quick_stops(); }, problem);
  std::vector<Station*> commanded;
  for (const auto& station : stations_) {
    const auto command = [&] {
      if (state_of(station->objects.read<std::uint16_t>(0x6041)) != PowerState::operation_enabled) return;
      commanded.push_back(station.get());
      station->objects.write<std::uint16_t>(0x6040, 0, command_word::quick_stop);
    };
    carry_out(command, problem);
  }
  for (Station* station : commanded) carry_out([&] { wait_until_stopped(*station); }, problem);
}

void CanCyclicBus::wait_until_stopped(Station& station) {
  const Time end = bus_.now() + stopping;
  const auto state = [&] { return state_of(station.objects.read<std::uint16_t>(0x6041)); };
  while (state() == PowerState::operation_enabled && bus_.now() < end) bus_.run_for(polling);
}

void CanCyclicBus::close() {
  if (!open_) return;
  open_ = false;
  ticking_.reset();
  listening_.reset();
  action_ = {};
  std::exception_ptr problem;
  if (options_.stops_drives) stop_drives(problem);
  for (const auto& station : stations_) carry_out([&] { put_back(*station); }, problem);
  if (problem) std::rethrow_exception(problem);
}

// ---- Cycles ----

void CanCyclicBus::tick() {
  if (half_) {
    half_ = false;
    if (!options_.waits_whole_period) run_cycle();
    return;
  }
  half_ = true;
  if (options_.waits_whole_period) run_cycle();
  if (options_.ends_when_lost && losses_ > options_.tolerated_losses) return;
  if (last_sync_) {
    const Time late = bus_.now() - *last_sync_ - options_.period;
    counters_.worst_lateness = std::max(counters_.worst_lateness, late);
    if (late >= options_.period) counters_.skipped += static_cast<std::uint64_t>(late / options_.period);
  }
  last_sync_ = bus_.now();
  for (const auto& station : stations_) {
    for (Station::Channel& channel : station->tpdos) channel.arrived = false;
  }
  cycle_ran_ = false;
  master_.send_sync();
}

void CanCyclicBus::receive(const Frame& frame) {
  if (frame.extended || frame.remote) return;
  bool complete = true;
  bool ours = false;
  for (const auto& station : stations_) {
    for (Station::Channel& channel : station->tpdos) {
      if (channel.pdo.can_id() != frame.id || frame.length < channel.pdo.bytes()) continue;
      channel.bytes = frame.data;
      channel.arrived = ours = true;
    }
    complete = complete && station->complete();
  }
  if (ours && complete) run_cycle();
}

void CanCyclicBus::run_cycle() {
  if (cycle_ran_ || !last_sync_) return;
  cycle_ran_ = true;
  bool all = true;
  for (const auto& station : stations_) {
    station->losses = station->complete() ? 0 : station->losses + 1;
    all = all && station->losses == 0;
  }
  ++counters_.cycles;
  losses_ = all ? 0 : losses_ + 1;
  counters_.longest_miss = std::max(counters_.longest_miss, losses_);
  if (!all) ++counters_.missed;
  if (action_) action_();
  send_outputs();
}

void CanCyclicBus::send_outputs() {
  for (const auto& station : stations_) {
    for (const Station::Channel& channel : station->rpdos) {
      master_.send_pdo(channel.pdo.can_id(), std::span(channel.bytes).first(channel.pdo.bytes()));
    }
  }
}

void CanCyclicBus::check() const {
  for (const auto& station : stations_) {
    if (station->losses <= options_.tolerated_losses) continue;
    throw MasterError(fmt::format("its PDOs were missing after {} SYNCs in a row", station->losses), station->where(),
                      "check that it is powered and operational (`servodrome scan`), and the bus's load");
  }
}

}  // namespace servodrome::master
