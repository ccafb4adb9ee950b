#include "tools/script/run.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

#include "axis/fault_report.hpp"
#include "catalogue/product.hpp"
#include "dictionary/dictionary.hpp"
#include "links/time.hpp"

namespace servodrome::master::script {
namespace {

template <typename T>
T in_units(double number, double scale, std::string_view what) {
  const double units = std::round(number * scale);
  if (!(units >= static_cast<double>(std::numeric_limits<T>::min()) &&
        units <= static_cast<double>(std::numeric_limits<T>::max()))) {
    throw MasterError(fmt::format("{:g} is {:g} units, which are not within {} .. {}", number, units,
                                  std::numeric_limits<T>::min(), std::numeric_limits<T>::max()),
                      std::string(what), "give another number");
  }
  return static_cast<T>(units);
}

bool compare(double value, Comparison comparison, double wanted, double tolerance) {
  const double difference = value - wanted;
  switch (comparison) {
    case Comparison::equal: return std::abs(difference) <= tolerance;
    case Comparison::not_equal: return std::abs(difference) > tolerance;
    case Comparison::less: return difference < tolerance;
    case Comparison::at_most: return difference <= tolerance;
    case Comparison::greater: return difference > -tolerance;
    case Comparison::at_least: return difference >= -tolerance;
    case Comparison::has_bits:
    case Comparison::lacks_bits: break;
  }
  return false;
}

// The shortest text of a number.
std::string text_of_number(double value) { return fmt::format("{:.10g}", value); }

// Runs `call`; returns "" or its error.
template <typename Call>
std::string problem_of(const Call& call) {
  try {
    call();
    return {};
  } catch (const std::exception& error) {
    return error.what();
  }
}

struct Member {
  Axis402* axis;
  bool enabled = false;  // by the script; or by another program, and the script has moved it
};

class Runner {
 public:
  Runner(const Script& script, std::span<Axis402* const> axes, const RunOptions& options)
      : script_(script), options_(options) {
    for (Axis402* axis : axes) members_.push_back({axis});
    if (options_.cancellation != nullptr) options_.cancellation->on_first([this] { begin_stop(); });
  }
  ~Runner() {
    if (options_.cancellation != nullptr) options_.cancellation->on_first({});
  }
  Runner(const Runner&) = delete;
  Runner& operator=(const Runner&) = delete;

  void run() {
    prepare(script_.steps);
    try {
      carry_out(script_.steps);
    } catch (...) {
      come_to_rest();
      throw;
    }
    if (const std::string problem = come_to_rest(); !problem.empty()) {
      throw ScriptFailure(script_.file, script_.steps.back().place, "at the end of the script: " + problem);
    }
  }

 private:
  // Runs `action`; an error is reported with the place of the step.
  template <typename Action>
  auto at(const Step& step, const Action& action) {
    try {
      return action();
    } catch (const ScriptFailure&) {
      throw;
    } catch (const std::exception& error) {
      throw ScriptFailure(script_.file, step.place, fmt::format("`{}`: {}", step.source, error.what()));
    }
  }

  // ---- Before any motion, and after a change of the drive's objects ----

  static bool needs_units(const Step& step) {
    for (const auto& [keyword, number] : step.numbers) {
      const Quantity quantity = quantity_of(step.verb, keyword);
      if (quantity == Quantity::position || quantity == Quantity::velocity || quantity == Quantity::acceleration) {
        return true;
      }
    }
    return step.verb == Verb::wait_probe || step.subject.kind == Subject::Kind::position ||
           step.subject.kind == Subject::Kind::velocity;
  }

  void prepare(const std::vector<Step>& steps) {
    for (const Step& step : steps) {
      at(step, [&] {
        Member& member = members_.at(step.axis);
        check_numbers(step, member);
        const bool has_value = step.verb == Verb::set || step.verb == Verb::expect;
        if (has_value && step.subject.kind == Subject::Kind::object) parse_value(step.text, type_of(step, member));
      });
      prepare(step.body);
    }
  }

  bool lacks_scale(const Step& step) const {
    return needs_units(step) && !scales_.contains(std::pair{step.axis, step.units});
  }

  void check_numbers(const Step& step, const Member& member) {
    if (lacks_scale(step)) {
      scales_.emplace(std::pair{step.axis, step.units},
                      UnitScale::of(*member.axis, step.units,
                                    "give them after `units` (`units revolutions NUMBER`, `units mm FEED NUMBER`)"));
    }
    for (const auto& [keyword, number] : step.numbers) check_number(step, keyword, number);
  }

  // The object that the script has written may be a factor of the units.
  void forget_scales(std::size_t axis) {
    std::erase_if(scales_, [axis](const auto& known) { return known.first.first == axis; });
    members_[axis].axis->forget_units();
  }

  double scale(const Step& step, Quantity quantity) const {
    const auto found = scales_.find({step.axis, step.units});
    if (found == scales_.end()) return 1.0;  // no number of the step has a unit
    switch (quantity) {
      case Quantity::position: return found->second.drive.position;
      case Quantity::velocity: return found->second.drive.velocity;
      case Quantity::acceleration: return found->second.drive.acceleration;
      default: return 1.0;
    }
  }

  void check_number(const Step& step, std::string_view keyword, double number) const {
    const Quantity quantity = quantity_of(step.verb, keyword);
    const bool is_signed = quantity == Quantity::position || keyword.empty();
    if (quantity == Quantity::percent) {
      in_units<std::int16_t>(number, 10.0, keyword.empty() ? "torque" : keyword);
    } else if (quantity == Quantity::plain || quantity == Quantity::seconds) {
      return;
    } else if (is_signed) {
      in_units<std::int32_t>(number, scale(step, quantity), keyword.empty() ? "velocity" : keyword);
    } else {
      in_units<std::uint32_t>(number, scale(step, quantity), keyword);
    }
  }

  // An object that is not in the catalogue gets an integer type of its present size.
  dictionary::Type type_of(const Step& step, Member& member) {
    if (step.subject.type) return *step.subject.type;
    const auto known = types_.find({step.axis, step.subject.object});
    if (known != types_.end()) return known->second;
    using dictionary::Type;
    const bool negative = step.text.starts_with('-');
    Type type{};
    switch (member.axis->objects().upload(step.subject.object).size()) {
      case 1: type = negative ? Type::integer8 : Type::unsigned8; break;
      case 2: type = negative ? Type::integer16 : Type::unsigned16; break;
      case 4: type = negative ? Type::integer32 : Type::unsigned32; break;
      case 8: type = negative ? Type::integer64 : Type::unsigned64; break;
      default:
        throw MasterError("the type of the object is not known", master::text_of(step.subject.object),
                          "give an EDS or DCF file with --eds");
    }
    return types_[{step.axis, step.subject.object}] = type;
  }

  // ---- Execution ----

  void carry_out(const std::vector<Step>& steps) {
    for (const Step& step : steps) {
      if (step.verb == Verb::repeat) {
        for (unsigned turn = 0; turn < step.count; ++turn) carry_out(step.body);
        continue;
      }
      if (options_.began) options_.began(step);
      const Time start = now();
      present_ = step.axis;
      const std::string said = at(step, [&] {
        leave_if_cancelled();
        return do_step(step, members_[step.axis]);
      });
      if (options_.done) options_.done(step, now() - start, said);
    }
  }

  std::string do_step(const Step& step, Member& member) {
    Axis402& axis = *member.axis;
    const Time timeout = links::from_seconds(step.timeout_s);
    if (lacks_scale(step)) check_numbers(step, member);
    if (can_move(step.verb) && !member.enabled) member.enabled = axis.state() == PowerState::operation_enabled;
    switch (step.verb) {
      case Verb::reset: axis.reset_fault(); break;
      case Verb::enable:
        axis.enable();
        member.enabled = true;
        break;
      case Verb::disable:
        axis.stop();
        member.enabled = false;
        axis.disable();
        break;
      case Verb::quick_stop:
        axis.quick_stop();
        member.enabled = axis.state() == PowerState::operation_enabled;
        break;
      case Verb::stop: axis.stop(); break;
      case Verb::halt: axis.halt(); break;
      case Verb::resume: axis.resume(); break;
      case Verb::home: axis.home(homing_of(step), timeout, options_.progress); break;
      case Verb::move: move(step, axis, timeout); break;
      case Verb::arrive: arrive(axis, timeout); break;
      case Verb::velocity: axis.run_at(velocity_of(step), profile_of(step), timeout, options_.progress); break;
      case Verb::jog: jog(step, axis); break;
      case Verb::torque: torque(step, axis, timeout); break;
      case Verb::arm_probe: axis.arm_probe(probe_of(step)); break;
      case Verb::wait_probe: return wait_probe(step, member, timeout);
      case Verb::set: {
        const auto type = type_of(step, member);
        axis.objects().download(step.subject.object, parse_value(step.text, type));
        forget_scales(step.axis);
        break;
      }
      case Verb::get: return fmt::format("{} = {}", step.subject.word, shown(step, member));
      case Verb::expect: return expect(step, member);
      case Verb::wait: wait(links::from_seconds(step.number("").value_or(0))); break;
      case Verb::print: return step.text;
      case Verb::repeat: break;
    }
    return {};
  }

  std::int32_t velocity_of(const Step& step) const {
    return in_units<std::int32_t>(step.number("").value_or(0), scale(step, Quantity::velocity), "velocity");
  }
  std::optional<std::uint32_t> unsigned_of(const Step& step, const char* keyword) const {
    const auto number = step.number(keyword);
    if (!number) return std::nullopt;
    return in_units<std::uint32_t>(*number, scale(step, quantity_of(step.verb, keyword)), keyword);
  }
  std::int32_t position_of(const Step& step, const char* keyword) const {
    return in_units<std::int32_t>(step.number(keyword).value_or(0), scale(step, Quantity::position), keyword);
  }

  MotionProfile profile_of(const Step& step) const {
    const auto acceleration = unsigned_of(step, "acceleration");
    const auto deceleration = unsigned_of(step, "deceleration");
    return {.velocity = unsigned_of(step, "velocity"),
            .acceleration = acceleration,
            .deceleration = deceleration ? deceleration : acceleration};
  }

  void jog(const Step& step, Axis402& axis) {
    axis.jog_for(links::from_seconds(step.number("for").value_or(0)), velocity_of(step), profile_of(step),
                 options_.progress);
  }

  HomingRequest homing_of(const Step& step) const {
    HomingRequest request{.switch_speed = unsigned_of(step, "speed"),
                          .zero_speed = unsigned_of(step, "zero-speed"),
                          .acceleration = unsigned_of(step, "acceleration")};
    if (const auto method = step.number("method")) request.method = static_cast<std::int8_t>(*method);
    if (step.number("offset")) request.offset = position_of(step, "offset");
    return request;
  }

  void move(const Step& step, Axis402& axis, Time timeout) {
    if (step.number("to")) {
      axis.start_move_to(position_of(step, "to"), profile_of(step));
    } else {
      axis.start_move_by(position_of(step, "by"), profile_of(step));
    }
    if (!step.has("nowait")) axis.wait_for_target(timeout, options_.progress);
  }

  // The time of a halt does not count towards the timeout, so on a halted axis the wait would not end.
  void arrive(Axis402& axis, Time timeout) {
    if (axis.halted()) throw std::runtime_error("the move is halted; `resume` it first");
    axis.wait_for_target(timeout, options_.progress);
  }

  void torque(const Step& step, Axis402& axis, Time timeout) {
    TorqueProfile profile;
    if (const auto slope = step.number("slope")) profile.slope = in_units<std::uint32_t>(*slope, 10.0, "slope");
    axis.run_torque(in_units<std::int16_t>(step.number("").value_or(0), 10.0, "torque"), profile, timeout,
                    options_.progress);
  }

  // The default is the positive edge.
  static ProbeRequest probe_of(const Step& step) {
    return {.probe = static_cast<std::uint8_t>(step.number("").value_or(1)),
            .source = step.has("index") ? ProbeRequest::Source::index : ProbeRequest::Source::input,
            .positive_edge = step.has("positive") || !step.has("negative"),
            .negative_edge = step.has("negative"),
            .continuous = step.has("continuous")};
  }

  std::string wait_probe(const Step& step, Member& member, Time timeout) {
    const ProbePositions seen = member.axis->wait_for_probe(probe_of(step), timeout, options_.progress);
    std::string text;
    const auto add = [&](const char* edge, const std::optional<std::int32_t>& position) {
      if (!position) return;
      text += fmt::format("{}{} edge at {}", text.empty() ? "" : ", ", edge,
                          text_of_number(*position / scale(step, Quantity::position)));
    };
    add("positive", seen.positive);
    add("negative", seen.negative);
    return text;
  }

  // The present value of the subject as a number; 0 for a state.
  double value_of(const Step& step, Member& member) {
    switch (step.subject.kind) {
      case Subject::Kind::position: return member.axis->position() / scale(step, Quantity::position);
      case Subject::Kind::velocity: return member.axis->velocity() / scale(step, Quantity::velocity);
      case Subject::Kind::torque: return member.axis->status().torque / 10.0;
      case Subject::Kind::state: return 0;
      case Subject::Kind::object: break;
    }
    const auto type = type_of(step, member);
    const auto bytes = member.axis->objects().upload(step.subject.object);
    if (type == dictionary::Type::real32 && bytes.size() == sizeof(float)) {
      float number = 0;
      std::memcpy(&number, bytes.data(), sizeof number);
      return number;
    }
    return static_cast<double>(dictionary::decode_number(type, bytes));
  }

  std::string shown(const Step& step, Member& member) {
    if (step.subject.kind == Subject::Kind::state) return drive::name(member.axis->state());
    if (step.subject.kind != Subject::Kind::object) return text_of_number(value_of(step, member));
    return text_of_value(member.axis->objects().upload(step.subject.object), step.subject.type);
  }

  bool holds(const Step& step, Member& member) {
    if (step.subject.kind == Subject::Kind::state) {
      return (drive::name(member.axis->state()) == step.text) == (step.comparison == Comparison::equal);
    }
    const double tolerance = step.number("tolerance").value_or(0);
    if (step.subject.kind != Subject::Kind::object) {
      return compare(value_of(step, member), step.comparison, step.number("value").value_or(0), tolerance);
    }
    const auto type = type_of(step, member);
    const auto wanted = parse_value(step.text, type);
    if (dictionary::size_of(type) == 0) {  // text or bytes
      const auto bytes = member.axis->objects().upload(step.subject.object);
      return (bytes == wanted) == (step.comparison == Comparison::equal);
    }
    if (type == dictionary::Type::real32) {
      float number = 0;
      std::memcpy(&number, wanted.data(), sizeof number);
      return compare(value_of(step, member), step.comparison, number, tolerance);
    }
    if (step.comparison == Comparison::has_bits || step.comparison == Comparison::lacks_bits) {
      const auto bits = static_cast<std::uint64_t>(
          dictionary::decode_number(type, member.axis->objects().upload(step.subject.object)));
      const auto mask = static_cast<std::uint64_t>(dictionary::decode_number(type, wanted));
      return step.comparison == Comparison::has_bits ? (bits & mask) == mask : (bits & mask) == 0;
    }
    return compare(value_of(step, member), step.comparison,
                   static_cast<double>(dictionary::decode_number(type, wanted)), tolerance);
  }

  std::string expect(const Step& step, Member& member) {
    const Time deadline = now() + links::from_seconds(step.timeout_s);
    while (!holds(step, member)) {
      if (now() >= deadline) {
        const std::string waited = step.timeout_s > 0 ? fmt::format(" after {:g} s", step.timeout_s) : "";
        throw std::runtime_error(fmt::format("{} is {}{}", step.subject.word, shown(step, member), waited));
      }
      pause();
    }
    return fmt::format("{} = {}", step.subject.word, shown(step, member));
  }

  void wait(Time span) {
    const Time deadline = now() + span;
    while (now() < deadline) pause();
  }

  void pause() {
    leave_if_cancelled();
    const std::size_t axis_of_step = present_;
    for (present_ = 0; present_ < members_.size(); ++present_) {
      const Member& member = members_[present_];
      if (!member.enabled || member.axis->state() == PowerState::operation_enabled) continue;
      throw std::runtime_error(left_text(*member.axis));
    }
    present_ = axis_of_step;
    members_.front().axis->objects().wait(options_.poll_interval);
  }

  static std::string left_text(Axis402& axis) {
    const FaultReport report = read_faults(axis.objects(), axis.product());
    std::string text = fmt::format("{}: the drive left operation enabled, and is in {}", axis.objects().where(),
                                   drive::name(state_of(report.statusword)));
    for (const ReportedFault& fault : report.active) {
      text += ": " + master::text_of(fault, axis.product().name);
      for (const catalogue::FaultText* meaning : fault.meanings)
        text += fmt::format(". {} {}", meaning->cause, meaning->remedy);
    }
    return text;
  }

  void leave_if_cancelled() const {
    if (options_.cancellation != nullptr && (*options_.cancellation)()) throw std::runtime_error("interrupted");
  }

  Time now() { return members_.front().axis->objects().now(); }

  // Returns the enabled axes; the axis of the present step comes last.
  std::vector<Axis402*> axes_to_stop() const {
    std::vector<Axis402*> axes;
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if (members_[i].enabled && i != present_) axes.push_back(members_[i].axis);
    }
    if (members_[present_].enabled) axes.push_back(members_[present_].axis);
    return axes;
  }

  // Commands the stop of all enabled axes, without waiting for standstill. A cancellation calls it between two accesses
  // to the present axis. So this axis comes first: it has just answered, and another axis may not answer.
  void begin_stop() {
    std::vector<Axis402*> axes = axes_to_stop();
    std::reverse(axes.begin(), axes.end());
    Axis402::begin_stop_of(axes);
  }

  // Stops all enabled axes, even if some fail. All begin to stop before the wait for the first standstill. The axis
  // that failed comes last: it may not answer, and the others must not wait for it. Returns the problems.
  std::string come_to_rest() {
    const std::vector<Axis402*> axes = axes_to_stop();
    Axis402::begin_stop_of(axes);
    std::string problems;
    for (Axis402* axis : axes) {
      const std::string problem = problem_of([axis] { axis->stop(); });
      if (!problem.empty()) problems += fmt::format("{}{}", problems.empty() ? "" : "; ", problem);
    }
    return problems;
  }

  const Script& script_;
  const RunOptions& options_;
  std::vector<Member> members_;
  std::size_t present_ = 0;  // axis of the present step, or the one that pause() polls
  std::map<std::pair<std::size_t, ObjectAddress>, dictionary::Type> types_;
  std::map<std::pair<std::size_t, UnitChoice>, UnitScale> scales_;
};

}  // namespace

ScriptFailure::ScriptFailure(const std::string& file, Place place, const std::string& message)
    : std::runtime_error(fmt::format("{}:{}:{}: {}", file, place.line, place.column, message)),
      place_(place),
      message_(message) {}

void run(const Script& script, std::span<Axis402* const> axes, const RunOptions& options) {
  Runner(script, axes, options).run();
}

}  // namespace servodrome::master::script
