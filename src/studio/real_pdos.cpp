// How RealDrives samples the channels of a recording from TPDOs on CAN.
#include <algorithm>
#include <fmt/format.h>

#include "drive/hardware.hpp"
#include "line/axis.hpp"
#include "master/canopen/pdo_set_up.hpp"
#include "studio/real_drives.hpp"

namespace servodrome::studio {
namespace {

using master::sampling::UseOfPdos;

constexpr std::uint8_t shown_tpdos = 8;  // that are looked at
constexpr std::int64_t ticks_per_ms = drive::ticks_per_second / 1000;
constexpr master::Time look_period = std::chrono::milliseconds(5);

// A TPDO as the drive has it.
struct Tpdo {
  master::PdoParameters pdo;
  std::uint16_t timer_ms = 0;  // 0: none

  std::optional<master::MappedBits> find(master::ObjectAddress object) const {
    unsigned first = 0;
    for (const std::uint32_t word : pdo.mapping) {
      const unsigned bits = word & 0xFFU;
      if (word >> 16U == object.index && (word >> 8U & 0xFFU) == object.sub) return master::MappedBits{first, bits};
      first += bits;
    }
    return std::nullopt;
  }
};

std::vector<Tpdo> read_tpdos(master::ObjectClient& objects, const Work::IsToEnd& is_to_end) {
  std::vector<Tpdo> tpdos;
  for (std::uint8_t number = 0; number < shown_tpdos; ++number) {
    is_to_end();  // others may use the bus
    const auto pdo = master::read_pdo(objects, true, number);
    if (!pdo) break;
    const auto timer = objects.read_if_present<std::uint16_t>(pdo->communication_index(), 5);
    tpdos.push_back({*pdo, timer.value_or(0)});
  }
  return tpdos;
}

std::string text_of(const UseOfPdos& use) {
  switch (use.by) {
    case UseOfPdos::By::sync: return "another master sends SYNC on this bus";
    case UseOfPdos::By::pdo: return fmt::format("the PDOs of node {} are in use by another master", use.node_id);
    case UseOfPdos::By::operational:
      return fmt::format("node {} is operational, so another master may use its process data", use.node_id);
  }
  return "";
}

bool is_mappable(const dictionary::Entry& entry) {
  return (static_cast<unsigned>(entry.pdo) & static_cast<unsigned>(dictionary::Pdo::tpdo)) != 0;
}

// The period of SYNC is measured: a multiple of a quarter of a millisecond.
std::int64_t ticks_of(master::Time measured) {
  constexpr std::int64_t quarter = ticks_per_ms / 4;
  return std::max<std::int64_t>(1, (measured / line::tick_length + quarter / 2) / quarter) * quarter;
}

// When the drive sends a TPDO; nullopt: on request, or with a SYNC that does not come.
std::optional<Sampling> sampling_of(const Tpdo& tpdo, const HeardPdos::Use& use) {
  constexpr std::uint8_t last_synchronous = 240;
  constexpr std::uint8_t by_event = 254;
  const std::uint8_t type = tpdo.pdo.transmission_type;
  Sampling sampling{.by = Sampling::By::pdo, .can_id = tpdo.pdo.can_id()};
  if (type <= last_synchronous) {
    if (!use.sync_period) return std::nullopt;
    sampling.on_sync = true;
    sampling.period = ticks_of(*use.sync_period) * type;  // 0: at a SYNC after a change
    return sampling;
  }
  if (type < by_event) return std::nullopt;
  sampling.period = tpdo.timer_ms * ticks_per_ms;
  return sampling;
}

std::string text_of(const Tpdo& tpdo, const Sampling& sampling) {
  const std::string name = fmt::format("TPDO {}", tpdo.pdo.number + 1);
  const double ms = static_cast<double>(sampling.period) / static_cast<double>(ticks_per_ms);
  if (sampling.on_sync)
    return name + (sampling.period > 0 ? fmt::format(" with SYNC, every {} ms", ms) : " with SYNC, after a change");
  return name + (sampling.period > 0 ? fmt::format(", at least every {} ms", ms) : ", when a value changes");
}

// Setting up takes a node to pre-operational, which must not end the motion of another master. An operational node
// shows itself by its heartbeat; one without heartbeat is asked.
void require_not_operational(OpenBus& open, std::size_t drive) {
  master::ObjectClient& objects = *open.drives()[drive];
  if (objects.read_if_present<std::uint16_t>(0x1017).value_or(0) != 0) return;
  const auto is_operational = open.is_operational(drive);
  if (!is_operational) {
    return require_no_torque(objects,
                             "the axis has torque, and without a heartbeat (1017h) of the drive it is not "
                             "known whether another master operates it by process data");
  }
  if (!*is_operational) return;
  throw master::MasterError("the node is operational, so another master may use its process data", objects.where(),
                            "end that master, and bring the node back: servodrome nmt pre-operational --node ID");
}

}  // namespace

// Waits until it has heard what a master of process data would send.
HeardPdos::Use RealDrives::use_of_pdos(std::size_t bus, const std::vector<Chosen*>& channels) {
  const Wait wait = wait_;
  master::Time heartbeat{};
  for (const Chosen* its : channels) {
    const auto period_ms = open(*its->sampled->axis)->read_if_present<std::uint16_t>(0x1017);
    heartbeat = std::max<master::Time>(heartbeat, std::chrono::milliseconds(period_ms.value_or(0)));
  }
  while (true) {
    const HeardPdos::Use use = buses_[bus]->pdos().use(links::steady_now());
    if (use.by_others || use.listened >= master::sampling::time_to_listen(heartbeat)) return use;
    wait(now() + look_period);
  }
}

std::shared_ptr<void> RealDrives::choose_pdos(std::int64_t wanted, std::vector<Chosen>& channels) {
  const auto held = std::make_shared<std::vector<std::shared_ptr<void>>>();
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) {
    if (buses_[bus]->plan().type != "can") continue;
    std::vector<Chosen*> on_bus;
    for (Chosen& channel : channels) {
      const Axis& axis = *channel.sampled->axis;
      if (axis.bus == bus && !state_of(axis).problem) on_bus.push_back(&channel);
    }
    if (on_bus.empty()) continue;
    if (auto its = choose_pdos_of(bus, wanted, on_bus)) held->push_back(std::move(its));
  }
  return held->empty() ? nullptr : held;
}

std::shared_ptr<void> RealDrives::choose_pdos_of(std::size_t bus, std::int64_t wanted,
                                                 const std::vector<Chosen*>& channels) {
  const auto limit_all = [&](const JobError& limit) {
    for (Chosen* channel : channels) channel->limit = limit;
  };
  const std::string& link = buses_[bus]->plan().link;
  if (auto held = set_ups_[bus].lock()) {
    limit_all({"another recording has set up the TPDOs of this bus for other values", link, "wait for its end"});
    choose_set_up_pdos(bus, channels);
    return held;
  }
  for (std::size_t drive = 0; drive < buses_[bus]->plan().drives.size(); ++drive) {
    if (!buses_[bus]->is_worked_with(drive)) continue;
    limit_all({"a job works with a drive of this bus", link, "record when the job is over"});
    return nullptr;
  }
  try {
    const HeardPdos::Use use = use_of_pdos(bus, channels);
    if (!use.by_others) return set_up_pdos(bus, wanted, channels);
    choose_sent_pdos(bus, channels, use);
  } catch (const master::MasterError& error) {
    limit_all({error.happened(), error.where(), error.remedy()});
  }
  return nullptr;
}

std::shared_ptr<void> RealDrives::set_up_pdos(std::size_t bus, std::int64_t wanted,
                                              const std::vector<Chosen*>& channels) {
  std::map<const Axis*, std::vector<master::sampling::Channel>> of_axes;
  for (Chosen* its : channels) {
    const Axis& axis = *its->sampled->axis;
    const master::ObjectAddress object = its->sampled->object;
    const dictionary::Entry* entry = axis.device->bus_dictionary().find(object.index, object.sub);
    if (entry == nullptr || !is_mappable(*entry)) {
      its->limit = JobError{"the drive does not map this object into a TPDO",
                            fmt::format("{}, {}", axis.name, master::text_of(object)), "it is read"};
      continue;
    }
    auto& list = of_axes[&axis];
    const auto is_same = [object](const master::sampling::Channel& one) { return one.object == object; };
    if (std::any_of(list.begin(), list.end(), is_same)) continue;
    list.push_back({.object = object, .bits = static_cast<unsigned>(8 * dictionary::size_of(entry->type))});
  }
  if (of_axes.empty()) return nullptr;
  const auto held = std::make_shared<int>();
  TpdoRecorder::Wish wish{.wanted = held};
  std::size_t tpdos = 0;
  for (const auto& [axis, list] : of_axes) {
    const master::CanDrive exchanged{.node_id = static_cast<std::uint8_t>(axis->address),
                                     .tpdos = master::sampling::pack_into_pdos(list),
                                     .sets_interpolation_time = false};
    tpdos += exchanged.tpdos.size();
    wish.drives.push_back({axis->drive, exchanged});
  }
  // At 1 Mbit/s a TPDO takes at most 135 us, and SYNC 60 us; a third of the time is left to other frames.
  const auto fastest = static_cast<std::int64_t>((tpdos * 135 + 60) * 3 / 2 * ticks_per_ms / 1000 + 1);
  const std::int64_t period = std::clamp(std::max(wanted, fastest), finest_sent, finest_reading);
  wish.period = period * line::tick_length;
  const auto task = std::make_shared<studio::Work>();
  task->carry_out = [wish, &on = *buses_[bus]](OpenBus& open, const studio::Work::IsToEnd&) {
    for (const TpdoRecorder::Drive& its : wish.drives) require_not_operational(open, its.drive);
    on.record(open, wish);
  };
  const Wait wait = wait_;
  carry_out(*channels.front()->sampled->axis, task, [&] { wait(now() + look_period); });
  set_ups_[bus] = held;
  if (period > wanted) {
    for (Chosen* its : channels) {
      if (its->limit) continue;
      its->limit = JobError{fmt::format("the {} TPDOs of this bus can come every {} ms", tpdos,
                                        static_cast<double>(period) / static_cast<double>(ticks_per_ms)),
                            buses_[bus]->plan().link, "record fewer values of this bus for a higher rate"};
    }
  }
  choose_set_up_pdos(bus, channels);
  return held;
}

// The TPDOs that are set up for recordings.
void RealDrives::choose_set_up_pdos(std::size_t bus, const std::vector<Chosen*>& channels) {
  for (Chosen* its : channels) {
    const auto period = buses_[bus]->cycle().period_of(its->sampled->axis->drive, its->sampled->object);
    if (!period) continue;
    its->sampling = {.by = Sampling::By::cycle, .period = *period};
    its->by = "TPDOs with SYNC, which the studio has set up for the recording";
  }
}

// TPDOs as the drives send them now, because another master operates the bus.
void RealDrives::choose_sent_pdos(std::size_t bus, const std::vector<Chosen*>& channels, const HeardPdos::Use& use) {
  struct Read {
    std::map<std::size_t, std::vector<Tpdo>> tpdos{};  // of each drive
    std::map<const Chosen*, std::vector<std::byte>> values{};
  };
  const auto read = std::make_shared<Read>();
  const auto task = std::make_shared<studio::Work>();
  std::vector<std::tuple<const Chosen*, std::size_t, master::ObjectAddress>> asked;
  for (const Chosen* its : channels) asked.emplace_back(its, its->sampled->axis->drive, its->sampled->object);
  task->carry_out = [read, asked](OpenBus& open, const studio::Work::IsToEnd& is_to_end) {
    for (const auto& [channel, drive, object] : asked) {
      master::ObjectClient& objects = *open.drives()[drive];
      if (!read->tpdos.contains(drive)) read->tpdos.emplace(drive, read_tpdos(objects, is_to_end));
      is_to_end();
      read->values[channel] = objects.upload(object);
    }
  };
  const Wait wait = wait_;
  carry_out(*channels.front()->sampled->axis, task, [&] { wait(now() + look_period); });
  for (Chosen* channel : channels) {
    const Axis& axis = *channel->sampled->axis;
    channel->limit = JobError{text_of(*use.by_others), fmt::format("{}, {}", axis.name, buses_[bus]->plan().link),
                              "let that master map the object into a TPDO that comes often enough, or end it: then "
                              "the studio sets up TPDOs for the recording"};
    for (const Tpdo& tpdo : read->tpdos[axis.drive]) {
      const auto bits = tpdo.find(channel->sampled->object);
      if (!bits || !tpdo.pdo.in_use()) continue;
      auto sampling = sampling_of(tpdo, use);
      const HeardPdos& heard = buses_[bus]->pdos();
      const bool is_sent =
          sampling && (heard.is_sent(sampling->can_id, links::steady_now()) ||
                       (sampling->period == 0 &&
                        heard.is_operational(static_cast<std::uint8_t>(axis.address), links::steady_now())));
      if (!is_sent || sampling->period > finest_reading) continue;
      sampling->bits = *bits;
      channel->sampling = *sampling;
      channel->initial = read->values[channel];
      channel->by = text_of(tpdo, *sampling);
      break;
    }
  }
}

}  // namespace servodrome::studio
