// Network management and error control on CAN. Checks that reset the node come last.
#include <algorithm>
#include <cmath>

#include "tools/conform/check_tables.hpp"
#include "tools/conform/frames.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::nmt_group {
namespace {

using namespace std::chrono_literals;

constexpr std::array states{NmtState::pre_operational, NmtState::operational, NmtState::stopped};

std::uint8_t node(Trial& trial) { return trial.subject().can().sdo.node_id(); }

NmtCommand command_to(NmtState state) {
  switch (state) {
    case NmtState::operational: return NmtCommand::start;
    case NmtState::stopped: return NmtCommand::stop;
    default: return NmtCommand::enter_pre_operational;
  }
}

// Sets a heartbeat of 20 ms, which shows the node's states.
void need_heartbeat(Trial& trial) {
  if (!trial.objects().read_if_present<std::uint16_t>(0x1017))
    Trial::skip("it has no 1017h, so its state cannot be seen");
  trial.objects().keep({0x1017, 0});
  trial.objects().write<std::uint16_t>(0x1017, 0, 20);
}

bool go_to(Trial& trial, NmtState state) {
  trial.subject().can().bus.drain();
  trial.subject().master().command(command_to(state), node(trial));
  trial.subject().can().bus.run_for(50ms);
  return trial.subject().master().wait_for_state(node(trial), state, 200ms);
}

const char* seen_state(Trial& trial) {
  const auto& state = trial.subject().master().health(node(trial)).state;
  return state ? master::name(*state) : "no heartbeat";
}

void transitions(Trial& trial, int) {
  need_heartbeat(trial);
  for (const NmtState from : states) {
    for (const NmtState to : states) {
      if (from == to) continue;
      if (!go_to(trial, from)) {
        trial.expect(false, fmt::format("NMT to {}", master::name(from)), master::name(from), seen_state(trial));
        continue;
      }
      const bool arrived = go_to(trial, to);
      trial.expect(arrived,
                   fmt::format("NMT command {:02X}h in {}", static_cast<unsigned>(command_to(to)), master::name(from)),
                   fmt::format("heartbeat with state {}", master::name(to)), seen_state(trial));
    }
  }
  go_to(trial, NmtState::pre_operational);
}

void other_node(Trial& trial, int) {
  need_heartbeat(trial);
  go_to(trial, NmtState::pre_operational);
  // Above 127, so that no device of the bus has this node-ID.
  const auto other = static_cast<std::uint8_t>(node(trial) == 127 ? 254 : 255);
  trial.subject().master().command(NmtCommand::start, other);
  trial.subject().can().bus.run_for(100ms);
  const bool stayed = trial.subject().master().health(node(trial)).state == NmtState::pre_operational;
  trial.expect(stayed, fmt::format("NMT start for node {}", other), "pre-operational, as before", seen_state(trial));
}

void unknown_command(Trial& trial, int) {
  need_heartbeat(trial);
  go_to(trial, NmtState::pre_operational);
  trial.subject().can().bus.send(0x000, {0x55, node(trial)});
  trial.subject().can().bus.run_for(100ms);
  const bool stayed = trial.subject().master().health(node(trial)).state == NmtState::pre_operational;
  trial.expect(stayed, "NMT command 55h, which there is not", "pre-operational, as before", seen_state(trial));
}

void silent_when_stopped(Trial& trial, int) {
  need_heartbeat(trial);
  if (!go_to(trial, NmtState::stopped)) Trial::skip("it does not go to stopped, see nmt.transitions");
  const SdoFrame read{0x40, 0x00, 0x10, 0x00};
  const auto answer = ask_sdo(trial, read, 200ms);
  trial.subject().master().command(NmtCommand::enter_pre_operational, node(trial));
  trial.subject().can().bus.run_for(50ms);
  trial.expect(!answer, text_of_sdo(read) + " in stopped", "no answer", answer ? text_of_sdo(*answer) : "no answer");
  const auto later = ask_sdo(trial, read);
  trial.expect(later.has_value(), text_of_sdo(read) + " in pre-operational", "an answer",
               later ? text_of_sdo(*later) : "no answer");
}

void heartbeat_period(Trial& trial, int) {
  if (!trial.objects().read_if_present<std::uint16_t>(0x1017)) Trial::skip("it has no 1017h");
  Bus& bus = trial.subject().can().bus;
  for (const std::uint16_t period : {std::uint16_t{20}, std::uint16_t{100}}) {
    trial.objects().write<std::uint16_t>(0x1017, 0, period);
    const Watch heartbeats(bus, 0x700U + node(trial));
    bus.run_for(8 * std::chrono::milliseconds(period));
    std::vector<double> gaps;
    const auto& arrivals = heartbeats.arrivals();
    for (std::size_t i = 1; i < arrivals.size(); ++i) {
      gaps.push_back(std::chrono::duration<double, std::milli>(arrivals[i].at - arrivals[i - 1].at).count());
    }
    std::sort(gaps.begin(), gaps.end());
    const double median = gaps.empty() ? 0.0 : gaps[gaps.size() / 2];
    trial.expect(!gaps.empty() && std::abs(median - period) <= 0.1 * period + 2.0, fmt::format("1017h = {} ms", period),
                 fmt::format("a heartbeat every {} ms", period),
                 gaps.empty() ? fmt::format("{} heartbeats in {} ms", arrivals.size(), 8 * period)
                              : fmt::format("every {:.1f} ms", median));
  }
  trial.objects().write<std::uint16_t>(0x1017, 0, 0);
  bus.run_for(20ms);
  const Watch heartbeats(bus, 0x700U + node(trial));
  bus.run_for(300ms);
  trial.expect(heartbeats.arrivals().empty(), "1017h = 0", "no heartbeat",
               fmt::format("{} in 300 ms", heartbeats.arrivals().size()));
}

// The node must report the loss of a heartbeat by emergency 8130h; other reactions are not checked.
void heartbeat_consumer(Trial& trial, int) {
  if (!trial.objects().read_if_present<std::uint32_t>(0x1016, 1)) Trial::skip("it has no 1016h");
  Bus& bus = trial.subject().can().bus;
  trial.bring_to(PowerState::switch_on_disabled);
  trial.objects().write<std::uint32_t>(0x1016, 1, heartbeat_producer << 16 | 100);
  const Watch emergencies(bus, 0x80U + node(trial));
  bus.run_for(300ms);
  trial.expect(emergencies.arrivals().empty(), "1016h sub 1 = 0077 0064h, no heartbeat yet",
               "no emergency: supervision begins with the first heartbeat",
               fmt::format("{} emergencies", emergencies.arrivals().size()));
  for (int i = 0; i < 4; ++i) {
    bus.send(0x700 + heartbeat_producer, {0x05});
    bus.run_for(50ms);
  }
  trial.expect(emergencies.arrivals().empty(), "a heartbeat every 50 ms", "no emergency",
               fmt::format("{} emergencies", emergencies.arrivals().size()));
  bus.run_for(300ms);
  const auto& came = emergencies.arrivals();
  const auto first = came.empty() ? std::nullopt : parse_emergency(came.front().frame);
  trial.expect(first && first->code == 0x8130, "no heartbeat for more than 100 ms", "an emergency 8130h",
               first ? text_of(*first) : "none");
  trial.objects().write<std::uint32_t>(0x1016, 1, 0);
  trial.subject().master().command(NmtCommand::enter_pre_operational, node(trial));
}

void guarding(Trial& trial, int) {
  trial.objects().keep({0x1017, 0});
  trial.write_if_present<std::uint16_t>(0x1017, 0, 0);
  Master& master = trial.subject().master();
  const auto first = master.guard(node(trial), 200ms);
  if (!first)
    Trial::skip("no answer to a remote frame: the node has no guarding, or the link carries no remote frames");
  const auto second = master.guard(node(trial), 200ms);
  trial.expect(second && second->toggle != first->toggle, "two remote frames to 700h + node-ID",
               "answers whose toggle bits alternate",
               second ? fmt::format("{} and {}", first->toggle, second->toggle) : "no second answer");
  trial.expect(first->state != NmtState::initialising, "remote frame to 700h + node-ID", "the NMT state",
               fmt::format("{:02X}h", static_cast<unsigned>(first->state)));
}

void resets(Trial& trial, int row) {
  const NmtCommand command = row == 0 ? NmtCommand::reset_communication : NmtCommand::reset_node;
  Bus& bus = trial.subject().can().bus;
  trial.bring_to(PowerState::switch_on_disabled);
  bus.drain();
  const Watch boot_ups(bus, 0x700U + node(trial));
  trial.subject().master().command(command, node(trial));
  const std::string sent = fmt::format("NMT command {:02X}h", static_cast<unsigned>(command));
  bus.run_until(bus.now() + 5s, [&] { return !boot_ups.arrivals().empty(); });
  trial.require(!boot_ups.arrivals().empty(), sent, "a boot-up message", "none in 5 s");
  const Frame& first = boot_ups.arrivals().front().frame;
  trial.expect(first.length == 1 && first.data[0] == 0, sent, "a boot-up message: one byte, 00h",
               fmt::format("{} bytes, {:02X}h", first.length, first.data[0]));
  bus.run_for(100ms);
  const SdoFrame read{0x40, 0x00, 0x10, 0x00};
  const auto answer = ask_sdo(trial, read);
  trial.expect(answer.has_value(), text_of_sdo(read) + " after the boot-up", "an answer",
               answer ? text_of_sdo(*answer) : "no answer");
  trial.write_if_present<std::uint16_t>(0x1017, 0, 20);
  const bool pre_operational = trial.subject().master().wait_for_state(node(trial), NmtState::pre_operational, 300ms);
  trial.expect(pre_operational, "after the boot-up", "pre-operational", seen_state(trial));
}

constexpr auto machine = "CiA 301 7.3.2, NMT state machine";

constexpr std::array rows{
    Check{"nmt.transitions", machine, "Each command leads from each state to its state", Demand::nothing, buses::can,
          transitions},
    Check{"nmt.other-node", "CiA 301 7.2.8.3.1", "A command for another node has no effect", Demand::nothing,
          buses::can, other_node},
    Check{"nmt.unknown-command", "CiA 301 7.2.8.3.1", "An unknown command has no effect", Demand::nothing, buses::can,
          unknown_command},
    Check{"nmt.stopped", "CiA 301 7.3.2.4, table 37", "SDOs are answered in pre-operational, not in stopped",
          Demand::nothing, buses::can, silent_when_stopped},
    Check{"nmt.heartbeat", "CiA 301 7.2.8.3.2, object 1017h", "Heartbeats are sent with the configured period",
          Demand::nothing, buses::can, heartbeat_period},
    Check{"nmt.heartbeat-consumer", "CiA 301 7.2.8.2.2.3, object 1016h",
          "The loss of a heartbeat is reported by emergency 8130h", Demand::nothing, buses::can, heartbeat_consumer},
    Check{"nmt.guarding", "CiA 301 7.2.8.3.2.1", "Guarding answers alternate their toggle bit", Demand::nothing,
          buses::can, guarding},
    Check{"nmt.reset-communication", "CiA 301 7.3.2.2.1", "Reset communication ends in a boot-up and pre-operational",
          Demand::nothing, buses::can, resets, 0},
    Check{"nmt.reset-node", "CiA 301 7.3.2.2.1", "Reset node ends in a boot-up and pre-operational", Demand::nothing,
          buses::can, resets, 1},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::nmt_group
