#include "tools/conform/subject.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "axis/cia402_words.hpp"
#include "axis/object_catalogue.hpp"

namespace servodrome::master::conform {

using namespace std::chrono_literals;

namespace {

constexpr std::uint16_t controlword_index = 0x6040;
constexpr std::uint16_t statusword = 0x6041;

// True for objects that a reset of the node returns to their stored values: configuration, as opposed to values that
// the drive itself changes.
bool is_configuration(std::uint16_t index) {
  const bool communication = index >= 0x1005 && index <= 0x1029 && index != 0x1010 && index != 0x1011;
  const bool profile = index >= 0x6000 && index != controlword_index;
  return communication || profile;
}

}  // namespace

// ---- KeptObjects ----

void KeptObjects::keep(ObjectAddress object) {
  if (object.index == controlword_index || kept_.contains(object)) return;
  try {
    before_.emplace_back(object, target().upload(object));
    kept_.insert(object);
  } catch (const ObjectError& error) {
    // Absent or write-only: there is nothing to restore.
    if (!error.answered()) throw;
  }
}

void KeptObjects::download(ObjectAddress object, std::span<const std::byte> data) {
  keep(object);
  target().download(object, data);
}

void KeptObjects::wait(Time span) {
  if (!ignores_cancellation_ && cancelled_ && cancelled_()) throw Cancelled{};
  target().wait(span);
}

std::vector<ObjectAddress> KeptObjects::put_back(const std::function<bool()>& answers) {
  std::vector<ObjectAddress> refused;
  for (; !before_.empty(); before_.pop_back()) {
    const auto is_restored = [this] {
      const auto& [object, value] = before_.back();
      try {
        if (target().upload(object) != value) target().download(object, value);
      } catch (const MasterError&) {
        return false;
      }
      return true;
    };
    if (is_restored()) continue;
    if (!answers()) return refused;
    if (!is_restored()) refused.push_back(before_.back().first);
  }
  kept_.clear();
  return refused;
}

// ---- Subject ----

Subject::Subject(const CanAccess& access, const SubjectSettings& settings)
    : kind_(buses::can), settings_(settings), can_(access), kept_(settings.cancelled) {
  master_.emplace(access.bus);
  kept_.set_target(access.sdo);
  remember();
}

Subject::Subject(const EthercatAccess& access, const SubjectSettings& settings)
    : kind_(buses::ethercat), settings_(settings), ethercat_(access), kept_(settings.cancelled) {
  al_state_ = access.slave.status().state();
  by_service_ = std::make_unique<CoeObjects>(access.slave);
  kept_.set_target(*by_service_);
}

Subject::Subject(const ModbusAccess& access, const SubjectSettings& settings)
    : kind_(buses::modbus), settings_(settings), modbus_(access), kept_(settings.cancelled) {
  by_service_ = std::make_unique<ModbusObjects>(access.client, access.unit, access.list);
  kept_.set_target(*by_service_);
}

std::string Subject::where() const { return kept_.where(); }

ObjectClient& Subject::services() { return can_ ? can_->sdo : *by_service_; }

KeptObjects& Subject::objects() {
  if (lost_operation()) {
    has_lost_operation_ = true;
    leave_operation();
  }
  if (ethercat_ && !operation_) {
    EthercatSlave* const slaves[] = {&ethercat_->slave};
    operation_.emplace(ethercat_->master, ethercat_->line, slaves, ethercat_->options);
    by_process_data_ = std::make_unique<CoeObjects>(ethercat_->slave, operation_->exchange(), 0);
    kept_.set_target(*by_process_data_);
  }
  return kept_;
}

bool Subject::lost_operation() const {
  if (!operation_) return false;
  const AlStatus status = operation_->exchange().status(0);
  return !operation_->exchange().runs() || status.error() || status.state() != AlState::operational;
}

void Subject::leave_operation() {
  if (!ethercat_ || !operation_) return;
  kept_.set_target(*by_service_);
  by_process_data_.reset();
  operation_.reset();
}

std::optional<AxisUnits> Subject::units() {
  if (!units_) units_ = Axis402(objects(), {.product = settings_.product}).units(settings_.units_per_revolution);
  return units_;
}

// Reads the configuration objects of the standards that a reset would lose. One SDO each; takes one to two seconds.
void Subject::remember() {
  SdoClient& sdo = can_->sdo;
  for (const NamedObject& object : ObjectCatalogue::standard().objects()) {
    if (!is_configuration(object.address.index)) continue;
    try {
      snapshot_[object.address] = sdo.upload(object.address);
    } catch (const SdoError& error) {
      if (!error.from_node()) throw;
    }
  }
  for (const unsigned first : {0x1400U, 0x1800U}) {
    for (unsigned number = 0; number < 512; ++number) {
      const auto pdo = read_pdo(sdo, static_cast<std::uint16_t>(first + number));
      if (!pdo) break;
      pdos_.push_back(*pdo);
    }
  }
  // Only a heartbeat shows the NMT state; a drive without heartbeat is assumed to be pre-operational.
  const auto period = sdo.read_if_present<std::uint16_t>(0x1017);
  if (!period) return;
  if (*period == 0) sdo.write<std::uint16_t>(0x1017, 0, 50);
  can_->bus.run_until(can_->bus.now() + std::max<Time>(2 * std::chrono::milliseconds(*period), 200ms),
                      [&] { return master_->health(sdo.node_id()).state.has_value(); });
  nmt_state_ = master_->health(sdo.node_id()).state;
  if (*period == 0) sdo.write<std::uint16_t>(0x1017, 0, 0);
}

std::optional<PowerState> Subject::power_state() {
  const auto word = services().read_if_present<std::uint16_t>(statusword);
  if (!word) return std::nullopt;
  return state_of(*word);
}

void Subject::refuse_if_enabled() {
  const auto state = power_state();
  if (!state || !operates(*state)) return;
  throw MasterError("the axis is enabled, by another master or from before", where(),
                    "stop and disable it first; the checks begin with an axis at rest");
}

// The first call listens to the heartbeats of other programs; renew() does not need to.
void Subject::be_watched() {
  if (ethercat_) {
    if (reaction_) return reaction_->begin();
    reaction_.emplace(ethercat_->slave);
    return;
  }
  if (!can_) return;
  if (watch_) return watch_->renew(can_->sdo);
  ObjectClient* const drives[] = {&can_->sdo};
  watch_.emplace(can_->bus, drives, [this](const std::string& sentence) { note(sentence); });
}

void Subject::end_watch() {
  if (watch_) watch_->end();
  if (reaction_) reaction_->end();  // restore() tries again, and reports a failure
}

Time Subject::brake_delay() { return Axis402(kept_, {.product = settings_.product}).brake_delay(); }

PositionRange Subject::position_range() {
  if (!settings_.product->dialect.has_position_range) return {};
  const auto lowest = kept_.read_if_present<std::int32_t>(0x607B, 1);
  const auto highest = kept_.read_if_present<std::int32_t>(0x607B, 2);
  return lowest && highest && *lowest < *highest ? PositionRange{*lowest, *highest} : PositionRange{};
}

std::optional<std::int32_t> Subject::position() {
  const auto shown = kept_.read_if_present<std::int32_t>(0x6064);
  return shown ? shown : kept_.read_if_present<std::int32_t>(0x6063);
}

// True if the shaft stands for 60 ms before `span` has elapsed, or the drive shows no position. The position decides,
// because a statusword may be wrong, and 606Ch is noisy.
bool Subject::stands_within(Time span) {
  constexpr Time standing = 60ms;
  constexpr double revolutions = 0.001;  // tolerance: the noise of the encoder and the control loop move the shaft
  const double turn = units_ ? std::abs(units_->position) : kept_.read_if_present<std::uint32_t>(0x608F, 1).value_or(0);
  const double tolerance = std::max(units_ ? 2.0 : 8.0, turn * revolutions);
  auto place = position();
  if (!place) return true;
  const PositionRange range = position_range();
  const Time deadline = kept_.now() + span;
  for (Time since = kept_.now(); kept_.now() - since < standing;) {
    kept_.wait(settings_.poll_interval);
    const std::int32_t present = position().value_or(*place);
    if (std::abs(range.way(*place, present)) <= tolerance) continue;
    if (kept_.now() >= deadline) return false;
    place = present;
    since = kept_.now();
  }
  return true;
}

// Throws MasterError if the axis is not off and at rest then.
void Subject::to_rest() {
  if (lost_operation()) leave_operation();
  if (ethercat_ && !operation_) {
    // The mailbox must work, because with 6007h = 0 an axis keeps running without process data.
    const AlState state = ethercat_->slave.status().state();
    if (state == AlState::init || state == AlState::bootstrap) ethercat_->slave.to_pre_operational();
  }
  const auto present = power_state();
  if (!present) return;
  // Without operation most checks use the bus only.
  if (!ethercat_ || operation_ || may_have_torque(*present) || *present == PowerState::fault) switch_off();
  if (!stands_within(settings_.patience)) {
    throw MasterError("the shaft turns although the motor is off", where(), "check the brake and the load");
  }
}

// In this order: halt or quick stop, fault reset, power off.
void Subject::switch_off() {
  ObjectClient& objects = kept_;
  const auto state = [&] { return state_of(objects.read<std::uint16_t>(statusword)); };
  if (operates(state())) {
    Axis402 axis(objects, {.product = settings_.product});
    if (!axis.try_to_stop().empty() || !stands_within(settings_.patience)) {
      objects.write<std::uint16_t>(controlword_index, 0, command_word::quick_stop);
      stands_within(settings_.patience);
    }
  }
  const Time patience = patience_of_power();
  const auto wait_until = [&](const auto& done) {
    const Time deadline = objects.now() + patience;
    while (!done() && objects.now() < deadline) objects.wait(settings_.poll_interval);
  };
  wait_until([&] { return state() != PowerState::fault_reaction_active; });
  if (state() == PowerState::fault) {
    // The cause of the fault may persist until the axis stands still, so the reset is repeated.
    wait_until([&] {
      objects.write<std::uint16_t>(controlword_index, 0, 0x0000);
      objects.wait(20ms);
      objects.write<std::uint16_t>(controlword_index, 0, command_word::fault_reset);
      objects.wait(50ms);
      return state() != PowerState::fault;
    });
  }
  objects.write<std::uint16_t>(controlword_index, 0, 0x0000);
  PowerState last{};
  wait_until([&] {
    last = state();
    return last == PowerState::switch_on_disabled || last == PowerState::fault;
  });
  if (may_have_torque(last)) {
    throw MasterError(fmt::format("the axis cannot be switched off, it is in {}", drive::name(last)), where(),
                      "switch the drive's power off");
  }
}

// Any answer counts, also a refusal. Brings a node that does not answer to pre-operational and asks once more, because
// a check may have left it in the NMT state stopped.
bool Subject::answers() {
  const auto answers_once = [this] {
    try {
      if (ethercat_) {
        ethercat_->slave.status();
      } else {
        services().upload({statusword, 0});
      }
    } catch (const ObjectError& error) {
      return error.answered();
    } catch (const MasterError&) {
      return false;
    }
    return true;
  };
  if (answers_once()) return true;
  if (!can_) return false;
  try {
    master_->command(NmtCommand::enter_pre_operational, can_->sdo.node_id());
  } catch (const MasterError&) {
    return false;
  }
  return answers_once();
}

// Notes a position value that homing has changed, because the user of the drive would have to home the axis again.
void Subject::compare_position() {
  if (!expected_position_) return;
  const auto shown = position();
  const double change = shown ? position_range().way(expected_position_->value, *shown) : 0.0;
  if (std::abs(change) > expected_position_->tolerance) {
    note(fmt::format(
        "{}: homing changed the position value by {:.0f}, and it could not be restored; home the axis again", where(),
        change));
  }
  expected_position_.reset();
}

std::vector<std::string> Subject::settle() {
  constexpr int most_attempts = 3;  // a lost frame must not end the attempt to stop the axis
  is_lost_ = is_off_ = has_lost_operation_ = false;
  std::string failure;
  for (int attempt = 0; attempt < most_attempts && !is_off_ && !is_lost_; ++attempt) {
    try {
      to_rest();
      compare_position();
      is_off_ = true;
    } catch (const MasterError& error) {
      failure = error.what();
      leave_operation();  // by its mailbox the drive can be switched off without process data
      is_lost_ = !answers();
    }
  }
  if (is_off_) {
    for (const ObjectAddress object : kept_.put_back([this] { return answers(); })) {
      note(fmt::format("{}, {}: it does not take back the value from before", where(), text_of(object)));
    }
    is_lost_ = kept_.remembered() != 0;
  } else {
    note(failure);
  }
  if (is_lost_) {
    note(fmt::format("{}: no answer; {} objects are not restored", where(), kept_.remembered()));
  } else if (!is_off_) {
    note(fmt::format("{}: the axis may move; {} objects are not restored, because their values could move it", where(),
                     kept_.remembered()));
  }
  end_watch();
  return std::exchange(problems_, {});
}

std::vector<std::string> Subject::restore() {
  kept_.ignore_cancellation();
  // The link may be back: then the axis is brought to rest now.
  if (!is_lost_ || answers()) problems_ = settle();
  if (expected_position_) {
    note(fmt::format("{}: homing may have changed the position value, which was {}; home the axis again", where(),
                     expected_position_->value));
  }
  if (ethercat_) {
    leave_operation();
    if (reaction_ && !reaction_->end()) {
      note(fmt::format(
          "{}: 6007h = 1 stays until the drive's next reset, because its motor is on or it does not answer", where()));
    }
    try {
      if (al_state_ == AlState::init && is_off_) ethercat_->slave.to_init();
    } catch (const MasterError& error) {
      note(error.what());
    }
  }
  if (can_ && is_off_ && !is_lost_) restore_node();
  return std::exchange(problems_, {});
}

// Restores what a reset of the node has lost. Ends at the first missing answer.
void Subject::restore_node() {
  std::size_t left = pdos_.size() + snapshot_.size();
  const auto answered = [&](const auto& access, bool is_configuration_object) {
    try {
      access();
    } catch (const MasterError& error) {
      if (is_configuration_object) note(error.what());
      const auto* refusal = dynamic_cast<const ObjectError*>(&error);
      if (refusal == nullptr || !refusal->answered()) return false;
    }
    --left;
    return true;
  };
  const bool all_answered = std::all_of(pdos_.begin(), pdos_.end(),
                                        [&](const PdoConfiguration& pdo) {
                                          return answered(
                                              [&] {
                                                if (read_pdo(can_->sdo, pdo.index) != pdo) write_pdo(can_->sdo, pdo);
                                              },
                                              true);
                                        }) &&
                            std::all_of(snapshot_.begin(), snapshot_.end(), [&](const auto& row) {
                              const auto& object = row.first;
                              const auto& value = row.second;
                              // An object that refuses is read-only, or the drive computes it: it is not a
                              // configuration object.
                              return answered(
                                  [&] {
                                    if (can_->sdo.upload(object) != value) can_->sdo.download(object, value);
                                  },
                                  false);
                            });
  if (!all_answered)
    note(fmt::format("{}: no answer; {} objects are not compared with their values from before", where(), left));
  if (nmt_state_ == NmtState::operational) master_->command(NmtCommand::start, can_->sdo.node_id());
  if (nmt_state_ == NmtState::stopped) master_->command(NmtCommand::stop, can_->sdo.node_id());
}

}  // namespace servodrome::master::conform
