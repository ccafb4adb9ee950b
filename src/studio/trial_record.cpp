#include "studio/trial_record.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "scope/files.hpp"
#include "studio/line_traffic.hpp"
#include "studio/state_strips.hpp"

namespace servodrome::studio {
namespace {

using scenario::TrafficLine;
using scenario::TrialResult;

// A report of a scenario with many rules shows the beginning of the first ones.
constexpr std::size_t most_first_acts = 8;

// A long text, such as a whole data sheet in one transfer, makes the table unreadable.
constexpr std::size_t most_characters = 240;

std::string shortened(std::string text) {
  if (text.size() <= most_characters) return text;
  std::size_t end = most_characters;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;  // a whole UTF-8 character
  return fmt::format("{} ... ({} characters)", text.substr(0, end), text.size());
}

std::vector<scenario::Moment> moments_of(const TrialResult& result) {
  std::vector<scenario::Moment> moments;
  for (const scenario::Verdict& verdict : result.verdicts) {
    if (verdict.outcome != scenario::Outcome::failed) continue;
    moments.push_back({verdict.at, fmt::format("failed: {}: {}", verdict.name, verdict.found)});
  }
  if (result.outcome == TrialResult::Outcome::failed && !result.reason.empty()) {
    moments.push_back({result.master_end, "failed: " + result.reason});
  }
  std::size_t rules = 0;
  for (const scenario::RuleReport& rule : result.rules) {
    if (!rule.first_act || ++rules > most_first_acts) continue;
    moments.push_back({*rule.first_act, fmt::format("first act of the rule \"{}\"", rule.name)});
  }
  std::stable_sort(moments.begin(), moments.end(), [](const auto& a, const auto& b) { return a.at < b.at; });
  return moments;
}

// The axis or the bus of an act is on this bus.
bool concerns(const line::Line& line, const scenario::ActRecord& act, const std::string& bus) {
  if (!act.bus.empty()) return act.bus == bus;
  for (const auto& axis : line.axes()) {
    const line::AxisSettings& its = axis->settings();
    if (its.name != act.axis) continue;
    return (its.bus && line.buses()[*its.bus]->settings.name == bus) ||
           (its.serial && line.serial_buses()[its.serial->bus]->settings.name == bus) ||
           (its.ethercat && line.ethercat_buses()[its.ethercat->bus]->settings.name == bus);
  }
  return true;
}

TrafficLine line_of(const scenario::ActRecord& act, const TrafficView& view) {
  TrafficLine line;
  line.kind = TrafficLine::Kind::act;
  line.at = act.at;
  line.from = act.axis;
  line.raw = act.raw;
  line.text = fmt::format("rule \"{}\": {}", act.rule, act.what);
  if (act.frame && view.source().medium() == Medium::can) {
    const master::Decoded decoded = view.decoded_aside(*act.frame, act.at);
    line.raw = decoded.raw;
    line.text += fmt::format(" ({})", decoded.text);
  }
  line.text = shortened(line.text);
  line.raw = shortened(line.raw);
  if (!act.result.empty()) line.text += "; " + shortened(act.result);
  return line;
}

TrafficLine line_of(const TrafficRow& row) {
  const auto kind = row.decoded.error ? TrafficLine::Kind::error : TrafficLine::Kind::frame;
  return {row.decoded.time, row.from, shortened(row.decoded.raw), shortened(row.decoded.text), kind};
}

std::vector<TrafficLine> lines_of(TrafficView& view, const std::vector<scenario::ActRecord>& acts,
                                  const std::vector<scenario::Moment>& moments) {
  scenario::Excerpt excerpt(moments);
  auto act = acts.begin();
  std::uint64_t taken = 0;
  view.flush();
  while (const auto time = view.next_time()) {
    for (; act != acts.end() && act->at < *time; ++act) excerpt.add(line_of(*act, view));
    view.decode_some(1);
    for (; taken < view.forgotten_rows() + view.rows().size(); ++taken) {
      const TrafficRow& row = view.rows()[taken - view.forgotten_rows()];
      // An EtherCAT frame is shown as it came back.
      if (view.source().medium() != Medium::ethercat || row.from != "master") excerpt.add(line_of(row));
    }
  }
  for (; act != acts.end(); ++act) excerpt.add(line_of(*act, view));
  return excerpt.finish();
}

}  // namespace

TrialRecord::TrialRecord(line::Line& line, line::Time most) : line_(line), shafts_(line, most) {
  const auto add = [this](const auto& buses) {
    for (const auto& bus : buses) {
      auto source = std::make_unique<LineTraffic>(line_, line::bench::AnyBus(bus.get()));
      buses_.push_back(std::make_unique<TrafficView>(std::move(source), ring_bytes));
      buses_.back()->record(true);
    }
  };
  add(line.buses());
  add(line.ethercat_buses());
  add(line.serial_buses());
}

// Panels for rpm and revolutions with a line for each axis, and below them the states of each axis.
std::string TrialRecord::picture() const {
  if (shafts_.times().size() < 2) return {};
  scope::Recording recording;
  for (const auto& axis : line_.axes()) {
    for (const auto& [name, unit] : {std::pair{"speed", "rpm"}, std::pair{"position", "revolutions"}}) {
      recording.channels.push_back({fmt::format("{} {}", axis->settings().name, name), unit});
    }
  }
  recording.source = "true shafts";
  recording.way = "line time";
  recording.groups.assign(recording.channels.size(), 0);
  // A picture is some thousand pixels wide.
  const std::size_t stride = std::max<std::size_t>(1, shafts_.times().size() / 4000);
  for (std::size_t row = 0; row < shafts_.times().size(); row += stride) {
    recording.times.push_back(shafts_.times()[row]);
    for (std::size_t axis = 0; axis < line_.axes().size(); ++axis) {
      const auto& sample = shafts_.sample(row, axis);
      recording.values.insert(recording.values.end(), {sample.velocity_rpm, sample.revolutions});
    }
  }
  return scope::svg_of(recording) + state_strips_of(line_, shafts_);
}

// A master that gets no connection cannot send anything.
bool TrialRecord::was_silent(const TrialResult& result) {
  for (const auto& view : buses_) {
    view->flush();
    if (view->has_heard_master()) return false;
  }
  const auto& rules = result.scenario.rules;
  return std::none_of(rules.begin(), rules.end(),
                      [](const auto& rule) { return std::holds_alternative<scenario::Accept>(rule.action); });
}

void TrialRecord::complete(TrialResult& result, const scenario::Director& director) {
  result.verdicts = director.verdicts();
  result.rules = director.rules();
  result.duration = line_.now();
  result.master_end = director.master_end().value_or(line_.now());
  result.picture = picture();
  result.was_silent = result.uses_buses && was_silent(result);
  scenario::judge(result);
  const std::vector<scenario::Moment> moments = moments_of(result);
  const std::vector<scenario::ActRecord> acts = director.acts();
  for (const auto& view : buses_) {
    std::vector<scenario::ActRecord> of_bus;
    std::copy_if(acts.begin(), acts.end(), std::back_inserter(of_bus),
                 [&](const auto& act) { return concerns(line_, act, view->source().name()); });
    result.traffic.push_back({view->source().name(), lines_of(*view, of_bus, moments)});
  }
}

}  // namespace servodrome::studio
