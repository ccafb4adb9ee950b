#include "master/ethercat/cyclic_exchange.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "ethercat/esc/watchdog.hpp"

namespace servodrome::master {

namespace reg = ethercat::reg;
using ethercat::Command;
using ethercat::load_u16;
using ethercat::store_u16;
using ethercat::store_u32;

namespace {

constexpr std::uint32_t first_logical = 0x00010000;
constexpr std::uint32_t logical_per_group = 0x0800;  // address space of a group; larger than any datagram
static_assert(ethercat::max_datagram_data <= logical_per_group);

// Control bytes of sync managers 2 and 3: three-buffer mode, direction, interrupt to the application; writing outputs
// triggers the watchdog (ETG.1000.4 table 58).
constexpr std::uint8_t watchdog_trigger = 0x40;
constexpr std::uint8_t output_control = 0x24 | watchdog_trigger;
constexpr std::uint8_t input_control = 0x20;
constexpr std::uint8_t fmmu_reads = 1;
constexpr std::uint8_t fmmu_writes = 2;

// Gain of the clock control: each cycle corrects 1/8 of the phase error.
constexpr int phase_gain = 8;

// Maximum age, in cycles, of a frame that is still accepted as late: the frame index repeats after 256 frames, and a
// cycle may use several.
constexpr std::uint64_t longest_delay = 50;
constexpr std::size_t most_overdue = 256;

// Increment of the working counter of an LRW for a slave that writes; one that reads adds 1 (ETG.1000.4 table 11).
constexpr unsigned lrw_write_step = 2;

// Number of further requests for OP to a slave that refuses OP within the time `at_once` for a transient reason. A
// slave that refuses later has already waited by itself, so the master does not request OP again.
constexpr unsigned further_requests = 2;
constexpr Time at_once = std::chrono::seconds(1);

}  // namespace

CyclicExchange::CyclicExchange(EthercatMaster& master, std::vector<Member> members, const CyclicOptions& options)
    : master_(master),
      members_(std::move(members)),
      options_(options),
      status_(members_.size()),
      silence_(members_.size()),
      processed_(members_.size()) {
  lrw_ = options.use_lrw && std::all_of(members_.begin(), members_.end(),
                                        [](const Member& member) { return member.slave->found().knows_lrw(); });
  lay_out();
  overdue_.reserve(most_overdue);
  // Slaves outside this exchange may still have FMMUs of an earlier exchange, and would answer to the same logical
  // addresses.
  const std::array<std::uint8_t, reg::fmmu_bytes * reg::fmmus> no_fmmus{};
  master_.write_all(reg::fmmu, no_fmmus);
  for (std::size_t i = 0; i < members_.size(); ++i) configure(i);
}

// ---- Logical memory ----

CyclicExchange::Place CyclicExchange::place(std::size_t bytes, bool outputs) {
  if (bytes > ethercat::max_datagram_data) {
    throw EthercatError(EthercatError::Kind::unsupported,
                        fmt::format("{} bytes of process data do not fit into a frame", bytes), master_.name(),
                        "map fewer objects");
  }
  const auto used = [](const Group& group) { return group.output_bytes + group.input_bytes; };
  if (groups_.empty() || used(groups_.back()) + bytes > ethercat::max_datagram_data) {
    Group group;
    group.logical = first_logical + logical_per_group * static_cast<std::uint32_t>(groups_.size());
    groups_.push_back(std::move(group));
  }
  Group& group = groups_.back();
  std::size_t& end = outputs ? group.output_bytes : group.input_bytes;
  const Place place{.group = groups_.size() - 1, .offset = end, .bytes = bytes};
  end += bytes;
  if (bytes != 0) ++(outputs ? group.writers : group.readers);
  return place;
}

void CyclicExchange::lay_out() {
  for (const Member& member : members_) {
    output_places_.push_back(place(bytes_of(member.data.outputs), true));
    input_places_.push_back(place(bytes_of(member.data.inputs), false));
  }
  for (Group& group : groups_) group.bytes.resize(group.output_bytes + group.input_bytes);
}

// Sets up sync manager 2 (outputs) or 3 (inputs). `start` returns the address of its buffer.
void CyclicExchange::write_channel(EthercatSlave& slave, bool outputs, std::size_t bytes, std::uint16_t& start) {
  constexpr std::size_t type_outputs = 3;
  const std::size_t type = type_outputs + (outputs ? 0U : 1U);
  const auto& channels = slave.found().sii.sync_managers;
  const auto listed =
      std::find_if(channels.begin(), channels.end(), [&](const SiiSyncManager& one) { return one.type == type; });
  const auto number =
      static_cast<unsigned>(listed != channels.end() ? static_cast<std::size_t>(listed - channels.begin()) : type - 1);
  const std::uint16_t address = reg::sync_manager_at(number);
  std::array<std::uint8_t, reg::sync_manager_bytes> registers{};
  slave.master().write<std::uint8_t>(slave.station(), reg::sync_manager_at(number, reg::sync_manager_activate), 0);
  if (listed != channels.end()) {
    start = listed->start;
    registers[4] = listed->control;
  } else {
    start = slave.master().read<std::uint16_t>(slave.station(), address);
    registers[4] = outputs ? output_control : input_control;
  }
  if (outputs) registers[4] |= watchdog_trigger;
  store_u16(registers.data(), start);
  store_u16(&registers[2], static_cast<unsigned>(bytes));
  registers[6] = bytes != 0 ? 1 : 0;
  slave.master().write(slave.station(), address, registers);
}

// Enables the process data watchdog if it is off: 100 ms, the reset values of 0400h and 0420h.
Time CyclicExchange::arm_watchdog(EthercatSlave& slave) {
  constexpr std::uint16_t usual_divider = 2498;
  constexpr std::uint16_t usual_time = 1000;
  auto divider = master_.read<std::uint16_t>(slave.station(), reg::watchdog_divider);
  auto time = master_.read<std::uint16_t>(slave.station(), reg::watchdog_process_data);
  if (time == 0) {
    divider = usual_divider;
    time = usual_time;
    master_.write<std::uint16_t>(slave.station(), reg::watchdog_divider, divider);
    master_.write<std::uint16_t>(slave.station(), reg::watchdog_process_data, time);
  }
  return ethercat::Watchdog::period_of(divider, time);
}

void CyclicExchange::configure(std::size_t member) {
  EthercatSlave& slave = *members_[member].slave;
  watchdogs_.push_back(arm_watchdog(slave));
  std::uint8_t fmmu = 0;
  const auto map = [&](const Place& at, std::uint32_t logical, std::uint16_t physical, std::uint8_t type) {
    std::array<std::uint8_t, reg::fmmu_bytes> registers{};
    if (at.bytes != 0) {
      store_u32(registers.data(), logical);
      store_u16(&registers[4], static_cast<unsigned>(at.bytes));
      registers[7] = 7;  // last bit 7; byte 6, the first bit, stays 0
      store_u16(&registers[8], physical);
      registers[11] = type;
      registers[12] = 1;
    }
    master_.write(slave.station(), static_cast<std::uint16_t>(reg::fmmu + reg::fmmu_bytes * fmmu), registers);
    ++fmmu;
  };
  std::uint16_t start = 0;
  const Place& out = output_places_[member];
  write_channel(slave, true, out.bytes, start);
  map(out, groups_[out.group].logical + static_cast<std::uint32_t>(out.offset), start, fmmu_writes);
  const Place& in = input_places_[member];
  write_channel(slave, false, in.bytes, start);
  map(in, groups_[in.group].logical + static_cast<std::uint32_t>(input_offset(in)), start, fmmu_reads);
}

std::span<std::uint8_t> CyclicExchange::outputs(std::size_t member) {
  const Place& place = output_places_[member];
  return std::span(groups_[place.group].bytes).subspan(place.offset, place.bytes);
}

std::span<const std::uint8_t> CyclicExchange::inputs(std::size_t member) {
  const Place& place = input_places_[member];
  return std::span(groups_[place.group].bytes).subspan(input_offset(place), place.bytes);
}

std::optional<ProcessObject> CyclicExchange::output(std::size_t member, ObjectAddress object) {
  const auto bits = find_mapped(members_[member].data.outputs, object);
  if (!bits) return std::nullopt;
  return ProcessObject(outputs(member).data(), *bits);
}

std::optional<ProcessObject> CyclicExchange::input(std::size_t member, ObjectAddress object) {
  const auto bits = find_mapped(members_[member].data.inputs, object);
  if (!bits) return std::nullopt;
  const Place& place = input_places_[member];
  return ProcessObject(groups_[place.group].bytes.data() + input_offset(place), *bits);
}

SlaveImage CyclicExchange::image(std::size_t member) { return {*this, member}; }
std::optional<ProcessObject> SlaveImage::output(ObjectAddress object) { return exchange_.output(member_, object); }
std::optional<ProcessObject> SlaveImage::input(ObjectAddress object) { return exchange_.input(member_, object); }
std::string SlaveImage::where() const { return exchange_.members()[member_].slave->where(); }

// ---- Cycles ----

void CyclicExchange::start() {
  if (runs_) return;
  runs_ = true;
  due_ = master_.now();
  master_.set_cyclic_task(this);
}

void CyclicExchange::stop() {
  if (!runs_) return;
  runs_ = false;
  due_ = Time::max();
  master_.set_cyclic_task(nullptr);
}

void CyclicExchange::follow_clock(std::uint16_t reference, std::uint64_t sync0, Time before_sync0) {
  reference_ = reference;
  const auto period = static_cast<std::uint64_t>(options_.period.count());
  const auto before = static_cast<std::uint64_t>(before_sync0.count()) % period;
  frame_phase_ = (sync0 % period + period - before) % period;
  clock_error_ = options_.period;
}

void CyclicExchange::run() {
  statistics_.worst_lateness = std::max(statistics_.worst_lateness, master_.now() - due_);
  datagrams_.clear();
  expected_.clear();
  if (reference_) {
    datagrams_.push_back({.command = Command::frmw,
                          .address = ethercat::address_of(*reference_, reg::system_time),
                          .data = time_bytes_});
  }
  // Each cycle also reads the AL status of the next member, because a slave that has left OP may still increment the
  // working counter.
  next_status_ = (next_status_ + 1) % std::max<std::size_t>(members_.size(), 1);
  const bool asks = !members_.empty();
  if (asks) {
    datagrams_.push_back({.command = Command::fprd,
                          .address = ethercat::address_of(members_[next_status_].slave->station(), reg::al_status),
                          .data = status_bytes_});
  }
  for (Group& group : groups_) {
    const std::span<std::uint8_t> bytes(group.bytes);
    const auto add = [&](Command command, std::size_t first, std::size_t count, unsigned counter) {
      if (count == 0) return;
      const auto logical = static_cast<std::uint32_t>(group.logical + first);
      datagrams_.push_back({.command = command, .address = logical, .data = bytes.subspan(first, count)});
      expected_.push_back(counter);
    };
    if (lrw_) {
      add(Command::lrw, 0, bytes.size(), lrw_write_step * group.writers + group.readers);
    } else {
      add(Command::lwr, 0, group.output_bytes, group.writers);
      add(Command::lrd, group.output_bytes, group.input_bytes, group.readers);
    }
  }
  sent_ = master_.now();
  const bool back = master_.try_exchange(datagrams_, options_.period);
  judge(back);
  schedule();
  if (on_inputs_) on_inputs_();
  if (on_cycle_) on_cycle_();
}

void CyclicExchange::judge(bool back) {
  ++statistics_.cycles;
  auto datagram = datagrams_.begin();
  if (reference_) {
    if (datagram->answered && datagram->counter != 0) {
      // Converts the phase error to the range from minus half a period to plus half a period.
      const auto period = static_cast<std::uint64_t>(options_.period.count());
      const std::uint64_t time = ethercat::load<std::uint64_t>(time_bytes_.data());
      const std::uint64_t late = (time % period + period - frame_phase_) % period;
      clock_error_ = Time{static_cast<std::int64_t>(late)};
      if (late > period / 2) clock_error_ -= options_.period;
    }
    ++datagram;
  }
  if (!members_.empty()) {
    for (unsigned& cycles : silence_) ++cycles;
    if (datagram->answered && datagram->counter != 0) {
      silence_[next_status_] = 0;
      processed_[next_status_] = sent_;
      status_[next_status_] = {.status = load_u16(status_bytes_.data()),
                               .code = static_cast<AlStatusCode>(load_u16(&status_bytes_[4]))};
    }
    ++datagram;
  }
  bool complete = true;
  for (const unsigned counter : expected_) complete = (datagram++)->counter == counter && complete;
  if (back && complete) {
    std::fill(processed_.begin(), processed_.end(), sent_);
    statistics_.losses_in_a_row = 0;
    return;
  }
  ++(back ? statistics_.wrong_counters : statistics_.lost);
  if (!back) expect_later();
  ++statistics_.losses_in_a_row;
  statistics_.longest_loss = std::max(statistics_.longest_loss, statistics_.losses_in_a_row);
}

// Stores the datagrams of an incomplete cycle. The cycle counts as lost; if all its datagrams arrive later, overdue()
// changes that to late.
void CyclicExchange::expect_later() {
  const std::size_t first_data = datagrams_.size() - expected_.size();
  for (std::size_t i = 0; i < datagrams_.size(); ++i) {
    const EthercatDatagram& datagram = datagrams_[i];
    if (datagram.answered || overdue_.size() == most_overdue) continue;
    const auto counter = i < first_data ? std::nullopt : std::optional(expected_[i - first_data]);
    overdue_.push_back({statistics_.cycles, datagram.index, datagram.address, counter});
  }
}

void CyclicExchange::overdue(std::span<const ethercat::Datagram> datagrams) {
  if (overdue_.empty()) return;
  std::erase_if(overdue_, [&](const Overdue& one) { return one.cycle + longest_delay < statistics_.cycles; });
  for (const ethercat::Datagram& datagram : datagrams) {
    const auto found = std::find_if(overdue_.begin(), overdue_.end(), [&](const Overdue& one) {
      return one.index == datagram.header[1] && one.address == datagram.logical();
    });
    if (found == overdue_.end()) continue;
    const std::uint64_t cycle = found->cycle;
    const auto is_of_it = [&](const Overdue& one) { return one.cycle == cycle; };
    if (found->counter && *found->counter != datagram.working_counter()) {
      std::erase_if(overdue_, is_of_it);
      --statistics_.lost;
      ++statistics_.wrong_counters;
      continue;
    }
    overdue_.erase(found);
    if (std::any_of(overdue_.begin(), overdue_.end(), is_of_it)) continue;
    --statistics_.lost;
    ++statistics_.late;
  }
}

void CyclicExchange::schedule() {
  if (!runs_) return;
  due_ += options_.period;
  if (reference_ && datagrams_.front().answered) due_ -= clock_error_ / phase_gain;
  const Time late = master_.now() - due_;
  if (late < options_.period) return;
  const auto skipped = late / options_.period;
  due_ += skipped * options_.period;
  statistics_.skipped += static_cast<std::uint64_t>(skipped);
}

// ---- States ----

void CyclicExchange::request_all(AlState state) {
  for (const Member& member : members_) {
    acknowledge_error(master_, member.slave->station(), state_timeout(state));
    master_.write<std::uint16_t>(member.slave->station(), reg::al_control, static_cast<std::uint16_t>(state));
  }
  // All slaves change state at the same time. Then the master polls each slave, and throws if a slave refuses.
  const Time deadline = master_.now() + state_timeout(state);
  for (std::size_t i = 0; i < members_.size(); ++i) {
    EthercatSlave& slave = *members_[i].slave;
    unsigned requests_left = state == AlState::operational ? further_requests : 0;
    Time requested = master_.now();
    while (true) {
      const AlStatus status = slave.status();
      status_[i] = status;
      if (status.state() == state && !status.error()) break;
      const bool is_early = master_.now() - requested < at_once;
      if (status.error() && is_transient(status.code) && is_early && requests_left != 0) {
        --requests_left;
        requested = master_.now();
        acknowledge_error(master_, slave.station(), state_timeout(state));
        master_.write<std::uint16_t>(slave.station(), reg::al_control, static_cast<std::uint16_t>(state));
        continue;
      }
      if (status.error() || master_.now() >= deadline) {
        throw EthercatError(EthercatError::Kind::refused,
                            fmt::format("it does not go to {}: it is in {}", short_name(state), text_of(status)),
                            slave.where(), remedy_of(status.code));
      }
      master_.wait(std::min<Time>(options_.period, std::chrono::milliseconds(1)));
    }
  }
  wanted_ = state;
}

void CyclicExchange::to_pre_operational() { request_all(AlState::pre_operational); }
void CyclicExchange::to_safe_operational() { request_all(AlState::safe_operational); }

void CyclicExchange::to_operational() {
  start();
  // Before it requests OP, the master must have sent the outputs, and the frames must be in phase with the reference
  // clock.
  master_.wait(2 * options_.period);
  const Time deadline = master_.now() + state_timeout(AlState::operational);
  const Time near = options_.period / 16;
  while (reference_ && (clock_error_ > near || clock_error_ < -near)) {
    if (master_.now() >= deadline) {
      throw EthercatError(EthercatError::Kind::refused, "the cycle does not synchronise with the reference clock",
                          master_.name(), "give a longer cycle; this computer may be too slow or too busy for it");
    }
    master_.wait(options_.period);
  }
  request_all(AlState::operational);
}

void CyclicExchange::check_state(std::size_t member) const {
  const AlStatus& status = status_[member];
  if (status.state() == wanted_ && !status.error()) return;
  throw EthercatError(EthercatError::Kind::refused,
                      fmt::format("it left {}: it is in {}", short_name(wanted_), text_of(status)),
                      members_[member].slave->where(), remedy_of(status.code));
}

// Each cycle reads the AL status of one member only, so silence_ of a member also counts the cycles that read another
// one.
bool CyclicExchange::is_lost(std::size_t member) const {
  const AlStatus& status = status_[member];
  return status.state() != wanted_ || status.error() ||
         silence_[member] > std::max<std::size_t>(options_.tolerated_losses, members_.size());
}

// A wrong working counter of a frame that several members share does not name the member. If none of them is lost, it
// counts for each.
void CyclicExchange::check(std::size_t member) const {
  check_state(member);
  if (is_lost(member)) {
    throw EthercatError(EthercatError::Kind::working_counter,
                        fmt::format("process data were not exchanged {} times in a row", silence_[member]),
                        members_[member].slave->where(), "check cables and power; `servodrome scan` lists the slaves");
  }
  for (std::size_t i = 0; i < members_.size(); ++i) {
    if (is_lost(i)) return;
  }
  check();
}

void CyclicExchange::check() const {
  for (std::size_t i = 0; i < members_.size(); ++i) check_state(i);
  // A member that has left its state can cause wrong working counters. Each cycle reads the AL status of one member, so
  // the master tolerates as many such cycles as there are members: by then the check above has found that member.
  const bool back = std::all_of(datagrams_.begin(), datagrams_.end(), [](const auto& one) { return one.answered; });
  const std::size_t tolerated = std::max<std::size_t>(options_.tolerated_losses, back ? members_.size() : 0);
  if (statistics_.losses_in_a_row <= tolerated) return;
  throw EthercatError(EthercatError::Kind::working_counter,
                      fmt::format("process data were not exchanged {} times in a row", statistics_.losses_in_a_row),
                      master_.name(), "check cables and power; `servodrome scan` lists the slaves");
}

}  // namespace servodrome::master
