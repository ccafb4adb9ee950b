#pragma once

#include <functional>
#include <list>
#include <map>
#include <memory>
#include <stdexcept>

#include "line/line.hpp"
#include "scenario/act_log.hpp"
#include "scenario/can_stage.hpp"
#include "scenario/expectation_watch.hpp"
#include "scenario/held_states.hpp"
#include "scenario/master_watch.hpp"
#include "scenario/object_view.hpp"
#include "scenario/packets.hpp"
#include "scenario/segment_stage.hpp"
#include "scenario/serial_stage.hpp"
#include "scenario/slave_stage.hpp"
#include "scenario/tcp_stage.hpp"

namespace servodrome::scenario {

// The error of a scenario that does not fit its line: the problem, the rule or expectation, and the remedy.
class ScenarioError : public std::runtime_error {
 public:
  ScenarioError(const std::string& what, std::string where, std::string hint)
      : std::runtime_error(what), where_(std::move(where)), hint_(std::move(hint)) {}
  const std::string& where() const { return where_; }
  const std::string& hint() const { return hint_; }

 private:
  std::string where_;
  std::string hint_;
};

// Executes a scenario on a line: it intercepts the messages between drives and buses, begins and ends rules in every
// tick, and checks the expectations. All of this happens in line time, so two runs are identical to the last bit.
class Director final : public line::Follower {
 public:
  // `line` must outlive this object. Throws ScenarioError if a rule or an expectation does not fit the line. The
  // constructor changes nothing on the line; begin() does.
  Director(line::Line& line, Scenario scenario);
  ~Director();
  Director(const Director&) = delete;
  Director& operator=(const Director&) = delete;

  // The scenario begins at the line's present time. Must be called once, while no other scenario runs on the line.
  void begin();
  // Ends the former scenario of the line, in whose place this one will begin, and sends the frames and characters that
  // wait in it.
  void take_over(Director& former);
  // Throws ScenarioError if one of the rules cannot be added.
  void check(const std::vector<Rule>& rules) const;
  // Adds rules to a scenario that has begun and not finished. If one of them does not fit the line, or has the name of
  // a present rule, throws ScenarioError and adds none of them.
  void add(const std::vector<Rule>& rules);
  // Ends the rule, undoes its effect and removes it from rules(). Returns false if no rule has this name.
  bool remove(const std::string& name);
  // True if add() has added the rule.
  bool was_added(const std::string& name) const;
  // Call this when the master has ended. The line may continue.
  void master_ended(bool success);
  // Ends all rules, undoes their effects, and judges the expectations that are still watched. Messages that the rules
  // delay pass now; a frame of a segment that waits for later ones comes back with the next one.
  void finish();
  std::vector<RuleReport> rules() const;
  std::vector<Verdict> verdicts() const;
  std::vector<ActRecord> acts() const { return acts_.records(); }
  // The time at which the master ended; nullopt: it has not ended.
  std::optional<Time> master_end() const { return facts_.master_ended; }
  // Sends the requests of all rules to the bench API at once, and returns their errors.
  std::vector<std::string> try_requests();
  const Scenario& scenario() const { return scenario_; }
  bool finished() const { return finished_; }

  // line::Follower
  Time next_deadline() const override;
  void reached(Time now) override;

  // ---- For the interposers between drives and buses

  std::uint64_t seed() const { return scenario_.seed; }
  Time now() const { return line_.now(); }
  // Lets the rules that act on this message change `packets`. Returns false if no rule acts; the caller must then call
  // passed() once when the message has passed. `axis` is nullptr for a message of a bus. If `acting` is not nullptr, it
  // gets the rules that act.
  bool carry_out(line::Axis* axis, const Message& message, Packets& packets, std::vector<RuleRun*>* acting = nullptr);
  // The same for the datagrams of a frame of a segment: a rule acts if one of them matches. A rule counts the frame
  // once.
  void carry_out(std::span<const Message> datagrams, std::vector<RuleRun*>& acting);
  void passed(line::Axis* axis, const Message& message);
  // Calls `what` at the line's time `when`, or at the end of the scenario if that comes first.
  void at(Time when, std::function<void()> what) { queue_.emplace(std::max(when, now()), std::move(what)); }
  // The same for a message of a drive: it is lost if the drive loses its power or is reset first.
  void at(Time when, const line::Axis& axis, std::function<void()> what) {
    at(when, [&axis, start = axis.starts(), what = std::move(what)] {
      if (axis.starts() == start) what();
    });
  }
  // Returns the rule of this kind that acts now on the axis, and records its act; nullptr: no rule acts.
  template <typename Kind, typename Fits>
  RuleRun* firing(const line::Axis& axis, Fits fits) {
    for (const auto& rule : rules_) {
      const Kind* kind = std::get_if<Kind>(&rule->rule->action);
      if (kind == nullptr || rule->axis != &axis || rule->phase != RuleRun::Phase::active || !fits(*kind)) continue;
      if (!rule->fires(seed())) {
        rule->passed(false);
        continue;
      }
      act(*rule);
      return rule.get();
    }
    return nullptr;
  }
  bool refuses_connections(const line::NamedSerialBus& bus) const;
  // The axis that answers for a Modbus unit of the line; nullptr: there is none.
  line::Axis* axis_of_unit(const line::NamedSerialBus& bus, std::uint8_t unit) const;
  // Records that a rule has acted. If the rule acts on messages, `message` is the message and `packets` the result.
  void act(RuleRun& rule, const Message* message = nullptr, const Packets* packets = nullptr);
  void end(RuleRun& rule);
  // Delays a write of the rule's object.
  void hold(RuleRun& rule, const dictionary::Entry& entry, std::span<const std::byte> value, Time due);
  // The time at which the last delayed write of the rule takes effect; nullopt: no write waits.
  static std::optional<Time> held_until(const RuleRun& rule);

 private:
  struct AxisParts {
    std::unique_ptr<CanStage> can;
    std::unique_ptr<SlaveStage> slave;
    std::unique_ptr<SerialStage> serial;
    std::unique_ptr<ObjectView> view;
  };

  line::Axis* axis_named(const std::string& name, const std::string& where) const;
  // The axis of a rule or an expectation, or nullptr if its conditions need none.
  line::Axis* axis_for(const std::string& name, const std::string& where, bool needed) const;
  static void check_object(const Condition& condition, line::Axis* axis, const std::string& where);
  std::unique_ptr<RuleRun> run_of(const Rule& rule, std::size_t number) const;
  void set_up(const Rule& rule);
  // Adds a rule about objects to the ObjectView of its drive, through which the bus accesses the objects.
  void attach(RuleRun& rule);
  void set_up(const Expectation& expectation);
  void place_stages();
  AxisParts& parts(line::Axis& axis) { return parts_[&axis]; }
  // The rule with this number; nullptr: it was removed.
  RuleRun* run(std::size_t number) const;
  // Repeats an act of the rule at `when`, unless the rule has begun again until then.
  void repeat(const RuleRun& rule, Time when, void (Director::*deed)(RuleRun&));

  // Executes the delayed writes whose time is at most `due`. The end of a rule does not discard such writes, because
  // the drive has acknowledged them.
  void release(RuleRun& rule, Time due);
  void measure_travel();
  void look(RuleRun& rule, Time now);
  void begin(RuleRun& rule, Time now);
  // Reports a message, or the datagrams of a frame, to the conditions that may count it. A condition counts a frame
  // once.
  void notice(line::Axis* axis, std::span<const Message> parts);
  void notice(line::Axis* axis, const Message& message) { notice(axis, std::span(&message, 1)); }
  // Returns true if the message belongs to the axis `wanted`, or, if `wanted` is nullptr, to the bus `bus`; always if
  // neither is given. `axis` is the axis of the message; nullptr: the message belongs to a bus as a whole. Such a
  // message belongs to each axis of the segment.
  bool is_of(const line::Axis* wanted, std::string_view bus, const line::Axis* axis, const Message& message) const;
  bool concerns(const RuleRun& rule, line::Axis* axis, const Message& message) const;
  bool is_on(const line::Axis& axis, std::string_view bus) const;

  // deeds.cpp: the effect of an action when its rule begins, and how it is undone.
  static void check_serial(const Rule& rule);
  void check(const RuleRun& rule) const;
  void do_deed(RuleRun& rule);
  void undo_deed(RuleRun& rule);
  void send(RuleRun& rule);
  links::CanBus* can_bus(const RuleRun& rule) const;
  line::NamedSerialBus* serial_bus(const RuleRun& rule) const;
  bool speak(RuleRun& rule, const Send& send);
  void end_connections(const RuleRun& rule);
  void write_own(line::Axis& axis, const SetObject& set);
  void drop_state(line::Axis& axis, const DropState& drop);
  void patch(line::Axis& axis, const PatchSii& patch);
  void raise(RuleRun& rule);

  // machine_states.cpp: the states that the rule holds while it acts.
  std::vector<MachineState> held_by(const RuleRun& rule);
  MachineState cable_of(line::Axis& axis);
  // Throws ScenarioError if the axis has no such input, fault or quantity of the plant.
  void check_names(const RuleRun& rule) const;

  line::Line& line_;
  Scenario scenario_;
  std::list<Rule> added_;  // added by add() while the scenario runs
  std::vector<std::unique_ptr<RuleRun>> rules_;
  std::size_t next_number_ = 0;  // of the next rule
  HeldStates held_states_;
  std::vector<ExpectationWatch> expectations_;
  std::map<links::CanBus*, std::unique_ptr<RulePort>> ports_;
  std::map<line::Axis*, AxisParts> parts_;
  std::vector<std::unique_ptr<SegmentStage>> segments_;
  std::vector<std::unique_ptr<TcpStage>> tcp_stages_;
  std::map<line::NamedSerialBus*, std::unique_ptr<RuleStation>> stations_;
  MasterWatch master_;
  Facts facts_;
  ActLog acts_;
  std::map<line::Axis*, double> revolutions_;  // at the last tick
  std::multimap<Time, std::function<void()>> queue_;
  Time looks_at_{};  // the next tick in which rules and expectations are checked
  bool begun_ = false;
  bool finished_ = false;
};

// Applies a scenario to a separate line, without links and stores, and returns its errors: those of the constructor,
// and those of the requests to the bench that the rules will make.
std::vector<std::string> rehearse(line::LineSettings settings, const Scenario& scenario);

}  // namespace servodrome::scenario
