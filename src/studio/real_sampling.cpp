// How RealDrives samples the channels of streams and recordings.
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "api/scope/channel_list.hpp"
#include "drive/hardware.hpp"
#include "studio/real_drives.hpp"

namespace servodrome::studio {
namespace {

using api::Json;
using api::NamedChannel;

constexpr auto ticks_per_second = static_cast<double>(drive::ticks_per_second);

Json json_of(const JobError& error) { return {{"what", error.what}, {"where", error.where}, {"hint", error.hint}}; }

}  // namespace

NamedChannel RealDrives::channel(Sampled sampled, Json view, std::function<double()> value) {
  sampled.key = view.value("axis", "") + "/" + view.value("signal", view.value("object", ""));
  const auto open = [this, sampled](std::int64_t stride) {
    return open_samples({Chosen{&sampled, usual_sampling(sampled, stride), ""}}, stride).front();
  };
  objects_.insert_or_assign(sampled.key, sampled);
  return {sampled.axis->name, std::move(view), open, std::move(value)};
}

const RealDrives::Sampled& RealDrives::sampled_by(const NamedChannel& channel) const {
  return objects_.at(channel.axis + "/" + channel.view.value("signal", channel.view.value("object", "")));
}

// Without an access to the drive, so TPDOs are not considered: their mapping is not known.
Sampling RealDrives::usual_sampling(const Sampled& sampled, std::int64_t stride) const {
  const DriveBus& bus = *buses_[sampled.axis->bus];
  const auto cycle = bus.plan().type == "ethercat" ? bus.cycle().period_of(sampled.axis->drive, sampled.object)
                                                   : std::optional<std::int64_t>();
  if (cycle) return {.by = Sampling::By::cycle, .period = *cycle};
  return {.period = std::max(finest_reading, stride)};
}

std::vector<std::shared_ptr<api::Samples>> RealDrives::open_samples(const std::vector<Chosen>& channels,
                                                                    std::int64_t stride) {
  const std::int64_t first = (std::max<std::int64_t>(now() / line::tick_length, advanced_) / stride + 1) * stride;
  std::vector<std::shared_ptr<api::Samples>> opened;
  std::vector<std::vector<std::shared_ptr<BusSamples>>> of_buses(buses_.size());
  for (const Chosen& channel : channels) {
    const auto& [axis, object, decode, name] = *channel.sampled;
    const Sampling& sampling = channel.sampling;
    const std::string key =
        fmt::format("{}/{}/{}/{}/{}", name, stride, static_cast<int>(sampling.by), sampling.period, sampling.can_id);
    std::weak_ptr<BusSamples>& known = sampled_[axis->bus][key];
    auto samples = known.lock();
    if (!samples) {
      samples = std::make_shared<BusSamples>(axis->drive, object, decode, sampling, stride, first);
      samples->begin_with(channel.initial);
      of_buses[axis->bus].push_back(samples);
      known = samples;
    }
    opened.push_back(std::move(samples));
  }
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) buses_[bus]->sample(of_buses[bus]);
  return opened;
}

// Reading objects uses at most half of the time of the busiest bus.
std::int64_t RealDrives::reading_period(const std::vector<Chosen>& channels) const {
  std::vector<double> busy_s(buses_.size());
  for (const Chosen& channel : channels) {
    if (channel.sampling.by != Sampling::By::reading) continue;
    const std::size_t bus = channel.sampled->axis->bus;
    busy_s[bus] += buses_[bus]->state().access_s;
  }
  const double longest_s = *std::max_element(busy_s.begin(), busy_s.end());
  const double most_hz = longest_s > 0 ? std::clamp(0.5 / longest_s, 1.0, ticks_per_second) : ticks_per_second;
  return std::max(finest_reading, api::stride_of_rate(most_hz));
}

// Sets the periods of the channels that are read, and returns the stride of all: a multiple of the shortest period of
// process data, if there are some.
std::int64_t RealDrives::choose_stride(std::int64_t wanted, std::vector<Chosen>& channels) const {
  const std::int64_t reading = std::max(wanted, reading_period(channels));
  std::optional<std::int64_t> fastest;
  for (const Chosen& channel : channels) {
    if (channel.sampling.by == Sampling::By::reading) continue;
    const std::int64_t period = channel.sampling.period > 0 ? channel.sampling.period : std::max(wanted, finest_sent);
    fastest = std::min(period, fastest.value_or(period));
  }
  std::int64_t stride = reading;
  if (fastest) stride = *fastest * std::max<std::int64_t>(1, (wanted + *fastest / 2) / *fastest);
  for (Chosen& channel : channels) {
    if (channel.sampling.by == Sampling::By::reading) channel.sampling.period = std::max(reading, stride);
  }
  return stride;
}

std::vector<RealDrives::Chosen> RealDrives::usual_choice(const std::vector<NamedChannel>& channels) const {
  std::vector<Chosen> chosen;
  for (const NamedChannel& channel : channels) {
    const Sampled& sampled = sampled_by(channel);
    const Sampling sampling = usual_sampling(sampled, 1);
    const bool is_cycle = sampling.by == Sampling::By::cycle;
    chosen.push_back({&sampled, sampling, is_cycle ? "the inputs of each EtherCAT cycle" : "read as an object"});
  }
  return chosen;
}

double RealDrives::most_sampling_hz(std::size_t bus) const {
  const auto cycle = buses_[bus]->cycle().period_of(0, {0x6041, 0});
  std::int64_t period = cycle.value_or(finest_reading);
  if (buses_[bus]->plan().type == "can") period = finest_sent;
  return ticks_per_second / static_cast<double>(period);
}

std::int64_t RealDrives::stride_of(double rate_hz, const std::vector<NamedChannel>& channels) const {
  std::vector<Chosen> chosen = usual_choice(channels);
  return choose_stride(api::stride_of_rate(rate_hz), chosen);
}

api::Source::Prepared RealDrives::prepare(double rate_hz, std::vector<NamedChannel>& channels) {
  const std::int64_t wanted = api::stride_of_rate(rate_hz);
  std::vector<Chosen> chosen = usual_choice(channels);
  Prepared prepared;
  if (wanted < finest_reading) prepared.held = choose_pdos(wanted, chosen);
  prepared.stride = choose_stride(wanted, chosen);
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const Chosen& its = chosen[i];
    const std::int64_t period = std::max(its.sampling.period, prepared.stride);
    Json& view = channels[i].view["sampled"] = {{"by", its.by}};
    if (its.sampling.period > 0) view["due_hz"] = ticks_per_second / static_cast<double>(period);
    if (period > wanted) view["limit"] = json_of(its.limit ? *its.limit : limit_of(*its.sampled, its.sampling));
  }
  // The channel that is opened first opens all, so that they begin with the same cycle.
  struct Together {
    std::vector<Chosen> channels;
    std::vector<std::shared_ptr<api::Samples>> opened{};
  };
  const auto together = std::make_shared<Together>(Together{std::move(chosen)});
  for (std::size_t i = 0; i < channels.size(); ++i) {
    channels[i].open = [this, together, i](std::int64_t stride) {
      if (together->opened.empty()) together->opened = open_samples(together->channels, stride);
      if (auto samples = std::move(together->opened[i])) return samples;
      return open_samples({together->channels[i]}, stride).front();
    };
  }
  return prepared;
}

// Why a channel is not sampled at the rate that the client asked for, if Chosen::limit has no other reason.
JobError RealDrives::limit_of(const Sampled& sampled, const Sampling& sampling) const {
  const BusPlan& bus = buses_[sampled.axis->bus]->plan();
  if (sampling.by == Sampling::By::cycle) {
    return {fmt::format("the bus exchanges process data every {} ms",
                        1000.0 * static_cast<double>(sampling.period) / ticks_per_second),
            bus.link, "start the studio with a shorter --cycle"};
  }
  const std::string where = fmt::format("{}, {}", sampled.axis->name, master::text_of(sampled.object));
  if (bus.type == "ethercat") {
    return {
        "the object is not among the inputs that the drive maps", where,
        fmt::format("map it into a transmit PDO: PUT /api/v1/axes/{}/pdos, or the page's PDOs", sampled.axis->name)};
  }
  if (bus.type == "can" && sampling.by == Sampling::By::pdo) {
    return {"TPDOs come at most 1000 times a second", where, "ask for 1000 Hz"};
  }
  return {"objects of drives on this bus are read one after another, at most 100 times a second", where,
          "the drive's CAN or EtherCAT port is faster"};
}

// Limited, so that no row is overwritten before its readers have taken it.
std::int64_t RealDrives::take_samples(std::int64_t end) {
  std::int64_t finest = end;
  for (auto& of_bus : sampled_) {
    std::erase_if(of_bus, [](const auto& entry) { return entry.second.expired(); });
    for (const auto& [key, its] : of_bus) {
      if (const auto samples = its.lock()) finest = std::min(finest, samples->stride());
    }
  }
  constexpr auto most_rows = static_cast<std::int64_t>(api::SampleRows::kept / 2);
  advanced_ = std::min(end, advanced_ + finest * most_rows);
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) {
    if (sampled_[bus].empty()) continue;
    const DriveBus::State state = buses_[bus]->state();
    std::vector<std::shared_ptr<BusSamples>> present;
    for (const auto& [key, its] : sampled_[bus]) {
      if (auto samples = its.lock()) present.push_back(std::move(samples));
    }
    {
      const auto held = buses_[bus]->cycle().between_cycles();
      for (const auto& samples : present) samples->fetch(advanced_);
    }
    for (const auto& samples : present) samples->fill(advanced_, !state.drives[samples->drive()].problem);
  }
  return advanced_;
}

}  // namespace servodrome::studio
