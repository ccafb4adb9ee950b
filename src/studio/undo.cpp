#include "studio/undo.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <map>
#include <set>

#include "axis/axis402.hpp"
#include "axis/cia402_words.hpp"
#include "catalogue/terminal_words.hpp"

namespace servodrome::studio {
namespace {

using api::Change;
using api::KeptValue;

// One write of an undo.
struct UndoStep {
  const Change* newest;
  KeptValue to;
};

master::ObjectAddress address_of(const Change& change) { return {change.entry->index, change.entry->sub}; }

bool is_process_data_setting(std::uint16_t index) {
  return (index >= 0x1400 && index < 0x1C00) || index == 0x1C12 || index == 0x1C13;
}

// Selects the writes of an undo, the newest change first.
class UndoPlan {
 public:
  UndoPlan(const api::ChangeLog& log, const catalogue::Product& product, UndoReport& report)
      : log_(log), product_(product), report_(report) {}

  void add(const Change& change, bool is_selected) {
    Chain& chain = chains_[change.key()];
    if (!is_selected) {
      if (chain.later == 0) chain.later = change.number;
      return;
    }
    if (const std::string reason = reason_against_undo(change, product_); !reason.empty()) {
      keep(change, reason, "write the object itself if its value shall change");
    } else if (chain.step && steps_[*chain.step].to == change.before) {
      return;  // later changes took the value back to this one
    } else if (chain.later != 0) {
      keep(change,
           fmt::format("{} has changed the value since (change {})", log_.at(chain.later).author(), chain.later),
           "undo that change first");
    } else if (chain.step && !is_process_data_setting(change.entry->index)) {
      steps_[*chain.step].to = change.before;
    } else {
      chain.step = steps_.size();
      steps_.push_back({&change, change.before});
      if (is_process_data_setting(change.entry->index)) note_process_data(change);
    }
  }

  // If the settings of the process data are as at the beginning, there is nothing to write back step by step.
  std::vector<UndoStep> steps() const {
    const bool same = std::all_of(process_data_.begin(), process_data_.end(),
                                  [](const auto& one) { return one.second.now == one.second.first; });
    std::vector<UndoStep> needed;
    for (const UndoStep& step : steps_) {
      if (kept_.contains(step.newest->key())) continue;
      if (!same || !is_process_data_setting(step.newest->entry->index)) needed.push_back(step);
    }
    return needed;
  }

  void keep(const Change& change, const std::string& what, const std::string& hint) {
    if (!kept_.insert(change.key()).second) return;
    report_.kept.push_back({change.number, address_of(change), change.name(), what, hint});
  }

 private:
  struct Chain {
    std::uint64_t later = 0;  // the newest change of the object that is not selected; 0: none
    std::optional<std::size_t> step{};
  };
  struct Ends {
    KeptValue now;
    KeptValue first;
  };

  void note_process_data(const Change& change) {
    process_data_.try_emplace(change.key(), Ends{change.after, change.before}).first->second.first = change.before;
  }

  const api::ChangeLog& log_;
  const catalogue::Product& product_;
  UndoReport& report_;
  std::map<std::uint32_t, Chain> chains_;
  std::map<std::uint32_t, Ends> process_data_;
  std::vector<UndoStep> steps_;
  std::set<std::uint32_t> kept_;
};

}  // namespace

namespace {

// A limit, a gain or a mapping can move an axis that has torque.
bool has_torque(master::ObjectClient& objects) {
  return master::may_have_torque(master::state_of(objects.read<std::uint16_t>(0x6041)));
}

}  // namespace

std::string reason_against_undo(const Change& change, const catalogue::Product& product) {
  if (change.entry->access != dictionary::Access::rw || product.rules.is_command(address_of(change))) {
    return "the object is a command or a target and no parameter";
  }
  if (catalogue::find_terminal(product.name, change.entry->index, change.entry->sub) != nullptr) {
    return "the object decides about inputs and outputs, and an input can move the axis";
  }
  if (!change.before.known()) return "the value before is not known";
  return {};
}

UndoReport undo(const api::ChangeLog& log, std::uint32_t axis, Subject& subject, const UndoOrder& order) {
  UndoReport report;
  const catalogue::Product& product = catalogue::product_of(subject.product);
  UndoPlan plan(log, product, report);
  for (std::uint64_t number = log.newest(); number >= log.oldest(); --number) {
    const Change& change = log.at(number);
    if (change.axis == axis) plan.add(change, order.is_selected(change));
  }
  // A write adds a change to the ring, which may overwrite an old one: copies.
  std::vector<std::pair<Change, KeptValue>> writes;
  for (const UndoStep& step : plan.steps()) writes.emplace_back(*step.newest, step.to);
  std::map<std::uint32_t, KeptValue> foreseen;  // what a preview would have written
  const auto value_now = [&](const Change& change) {
    const auto found = foreseen.find(change.key());
    return found != foreseen.end() ? found->second : KeptValue(subject.objects.upload(address_of(change)));
  };
  std::optional<std::pair<std::string, std::string>> silent;  // what happened and the remedy: the drive does not answer
  for (const auto& [change, to] : writes) {
    if (order.only && !order.only->contains(change.number)) {
      plan.keep(change, "the value is not in the list of the undo", "ask for the list again");
      continue;
    }
    if (silent) {
      plan.keep(change, silent->first, silent->second);
      continue;
    }
    try {
      if (has_torque(subject.objects)) {
        plan.keep(change, "the axis has torque, and the value could move it", "disable the axis first");
        continue;
      }
      const KeptValue now = value_now(change);
      if (now == to) continue;
      if (!(now == change.after)) {
        plan.keep(change, "the drive no longer has the value that was written",
                  "compare with the factory or a file, and write the value that shall hold");
        continue;
      }
      if (order.is_preview) {
        foreseen[change.key()] = to;
      } else {
        subject.objects.download(address_of(change), to.bytes());
      }
      report.undone.push_back({change.number, address_of(change), change.name(), change.entry, now, to});
    } catch (const master::ObjectError& error) {
      if (!error.answered()) silent.emplace(error.happened(), error.remedy());
      plan.keep(change, error.happened(), error.remedy());
    } catch (const master::MasterError& error) {
      plan.keep(change, error.happened(), error.remedy());
    }
  }
  return report;
}

UndoReport undo_nothing(const api::ChangeLog& log, std::uint32_t axis, const UndoOrder& order, const std::string& what,
                        const std::string& hint) {
  UndoReport report;
  std::set<std::uint32_t> kept;
  for (std::uint64_t number = log.newest(); number >= log.oldest(); --number) {
    const Change& change = log.at(number);
    if (change.axis != axis || !order.is_selected(change) || !kept.insert(change.key()).second) continue;
    report.kept.push_back({number, address_of(change), change.name(), what, hint});
  }
  return report;
}

}  // namespace servodrome::studio
