#include "world.hpp"

#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <utility>

namespace servodrome::chaos {
namespace {

constexpr std::size_t most_findings = 100;

// A quarter of the axes are EtherCAT slaves; the others are divided between the CAN buses.
bool is_ethercat(const Options& options, std::size_t number) { return options.only_segment || number % 4 == 3; }

}  // namespace

line::LineSettings World::settings(const Options& options, const std::vector<Variant>& variants,
                                   std::vector<std::size_t>& chosen) {
  std::vector<std::size_t> on_can;
  std::vector<std::size_t> on_ethercat;
  for (std::size_t i = 0; i < variants.size(); ++i) {
    (variants[i].on_ethercat() ? on_ethercat : on_can).push_back(i);
  }
  Random random(options.seed);
  motion::Sequence sequence;
  for (std::size_t i = 0; i < options.axes; ++i) {
    chosen.push_back(random.of(is_ethercat(options, i) ? on_ethercat : on_can));
    motion::AxisSetup setup;
    setup.product = variants[chosen.back()].product->name;
    setup.model = variants[chosen.back()].model;
    sequence.axes.push_back(setup);
  }
  line::LineSettings settings = motion::line_settings(sequence);
  while (settings.buses.size() < can_buses) {
    settings.buses.push_back({.name = fmt::format("can{}", settings.buses.size()), .links = {}});
  }
  std::size_t next = 0;
  for (line::AxisSettings& axis : settings.axes) {
    if (axis.bus) axis.bus = next++ % can_buses;
  }
  return settings;
}

World::World(const Options& options)
    : options_(options), line_(std::make_unique<line::Line>(settings(options, variants_, chosen_))) {
  std::size_t place = 0;
  for (std::size_t i = 0; i < options.axes; ++i) {
    Subject& subject = subjects_.emplace_back();
    subject.axis = line_->axes()[i].get();
    subject.variant = &variants_[chosen_[i]];
    subject.bus = is_ethercat(options, i) ? segment : *subject.axis->settings().bus;
    if (is_ethercat(options, i)) subject.place = place++;
    subject.around.quiet_bus = false;  // frames are lost, so no deadline applies to answers on the bus
    subject.record.waits_since = Time{0};
  }
  for (std::size_t i = 0; i < options.axes; ++i) {
    if (options.watches) subjects_[i].watch = std::make_unique<motion::Watch>(*subjects_[i].axis, i);
  }
}

// True if for a while nothing about the axis has changed, and neither shaft nor demand moves.
bool World::rests(Subject& subject) const {
  constexpr std::int64_t settling = ticks_per_s / 20;
  constexpr double still_rpm = 3.0;
  const drive::Drive& drive = subject.axis->device().drive();
  const drive::Objects& objects = drive.axis().objects;
  const Signs signs{.controlword = objects.controlword,
                    .statusword = objects.statusword,
                    .mode = objects.modes_of_operation,
                    .target_position = objects.target_position,
                    .target_velocity = objects.target_velocity,
                    .target_torque = objects.target_torque,
                    .state = drive.state(),
                    .energised = subject.axis->actuation().pwm_enabled,
                    .demand = static_cast<double>(drive.axis().demand.position),
                    .commanded = subject.around.commanded,
                    .disturbed = subject.around.disturbed};
  const bool moves = drive.axis().demand.velocity != 0.0F || std::abs(subject.axis->plant().velocity_rpm()) > still_rpm;
  if (std::exchange(subject.signs, signs) != signs || moves) subject.changed = tick_;
  return tick_ - subject.changed > settling;
}

void World::pass_tick() {
  ++tick_;
  line_->run_until(tick_ * line::tick_length);
  for (std::size_t i = 0; i < subjects_.size(); ++i) {
    Subject& subject = subjects_[i];
    if (!subject.watch) continue;
    if (options_.rest_stride > 1 && rests(subject) && tick_ % options_.rest_stride != 0) continue;
    if (subject.watch->tick(tick_, subject.around)) continue;
    const motion::Finding& found = *subject.watch->finding();
    finding(fmt::format("invariant {} of {} {}: {}", found.invariant, subject.variant->product->name,
                        subject.axis->settings().name, found.text));
    subject.watch = std::make_unique<motion::Watch>(*subject.axis, i);
  }
}

void World::finding(const std::string& text) {
  ++finding_count_;
  const std::string whole = fmt::format("{:.4f} s: {}", static_cast<double>(tick_) / ticks_per_s, text);
  if (findings_.size() >= most_findings) return;
  findings_.push_back(whole);
  std::fprintf(stderr, "chaos: FINDING: %s\n", whole.c_str());
}

void World::works(Subject& subject) {
  Record& record = subject.record;
  if (!record.waits_since) return;
  record.longest_recovery = std::max(record.longest_recovery, line_->now() - *record.waits_since);
  ++record.recoveries;
  record.waits_since.reset();
}

void World::look_for_overdue() {
  const auto limit = std::chrono::duration_cast<Time>(std::chrono::duration<double>(options_.recovery_limit_s));
  for (Subject& subject : subjects_) {
    Record& record = subject.record;
    if (!record.waits_since || record.overdue || line_->now() - *record.waits_since < limit) continue;
    record.overdue = true;
    const drive::Drive& drive = subject.axis->device().drive();
    finding(
        fmt::format("{} {} ({}) is not in operation {:.0f} s after a disturbance; statusword {:04X}h, 603Fh {:04X}h",
                    subject.variant->product->name, subject.variant->model, subject.axis->settings().name,
                    options_.recovery_limit_s, drive.statusword(), drive.axis().objects.error_code));
  }
}

}  // namespace servodrome::chaos
