// The EtherCAT state machine at register level, the working counter, the watchdog and the distributed clock.
#include <algorithm>

#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::al_state_group {
namespace {

using namespace std::chrono_literals;
namespace reg = ethercat::reg;

EthercatSlave& slave_of(Trial& trial) { return trial.subject().ethercat().slave; }
EthercatMaster& master_of(Trial& trial) { return trial.subject().ethercat().master; }

// Writes AL control and polls until the slave has reached the state or reports an error.
AlStatus request(Trial& trial, unsigned control) {
  EthercatMaster& master = master_of(trial);
  const std::uint16_t station = slave_of(trial).station();
  master.write<std::uint16_t>(station, reg::al_control, static_cast<std::uint16_t>(control));
  const Time deadline = master.now() + trial.settings().patience;
  AlStatus status;
  do {
    master.wait(1ms);
    status = read_al_status(master, station);
  } while (!status.error() && (status.status & 0x0F) != (control & 0x0F) && master.now() < deadline);
  return status;
}

AlState go_to(Trial& trial, AlState state) {
  EthercatSlave& slave = slave_of(trial);
  if (state == AlState::operational || state == AlState::safe_operational) {
    trial.subject().leave_operation();
    trial.objects();
    if (state == AlState::safe_operational) request(trial, static_cast<unsigned>(state));
  } else {
    trial.subject().leave_operation();
    if (state == AlState::init) slave.to_init();
    if (state == AlState::pre_operational) slave.to_pre_operational();
  }
  const AlStatus status = slave.status();
  trial.require(status.state() == state && !status.error(), fmt::format("take it to {}", short_name(state)),
                short_name(state), text_of(status));
  return state;
}

void leave(Trial& trial) {
  acknowledge_error(master_of(trial), slave_of(trial).station(), 1s);
  trial.subject().leave_operation();
  slave_of(trial).to_pre_operational();
}

void up(Trial& trial, int) {
  go_to(trial, AlState::init);
  go_to(trial, AlState::pre_operational);
  go_to(trial, AlState::safe_operational);
  go_to(trial, AlState::operational);
  leave(trial);
}

struct Way {
  AlState from;
  AlState to;
};
constexpr std::array ways_down{Way{AlState::operational, AlState::safe_operational},
                               Way{AlState::operational, AlState::pre_operational},
                               Way{AlState::operational, AlState::init},
                               Way{AlState::safe_operational, AlState::pre_operational},
                               Way{AlState::safe_operational, AlState::init},
                               Way{AlState::pre_operational, AlState::init}};

void down(Trial& trial, int) {
  for (const Way& way : ways_down) {
    go_to(trial, way.from);
    const AlStatus seen = request(trial, static_cast<unsigned>(way.to));
    trial.expect(seen.state() == way.to && !seen.error(),
                 fmt::format("0120h = {} in {}", short_name(way.to), short_name(way.from)), short_name(way.to),
                 text_of(seen));
    leave(trial);
  }
}

constexpr std::array no_ways{
    Way{AlState::init, AlState::safe_operational},       Way{AlState::init, AlState::operational},
    Way{AlState::pre_operational, AlState::operational}, Way{AlState::pre_operational, AlState::bootstrap},
    Way{AlState::safe_operational, AlState::bootstrap},  Way{AlState::operational, AlState::bootstrap}};

void illegal(Trial& trial, int row) {
  const Way& way = no_ways[static_cast<std::size_t>(row)];
  go_to(trial, way.from);
  const AlStatus seen = request(trial, static_cast<unsigned>(way.to));
  const std::string sent = fmt::format("0120h = {} in {}", short_name(way.to), short_name(way.from));
  trial.expect(seen.error() && seen.code == AlStatusCode::invalid_requested_state_change, sent,
               "error indication and AL status code 0011h", text_of(seen));
  trial.expect(seen.state() == way.from, sent, fmt::format("{}, as before", short_name(way.from)), text_of(seen));
  const AlStatus after = request(trial, static_cast<unsigned>(way.from) | 0x10U);
  AlStatus cleared = after;
  for (const Time end = master_of(trial).now() + 500ms; cleared.error() && master_of(trial).now() < end;) {
    master_of(trial).wait(1ms);
    cleared = slave_of(trial).status();
  }
  trial.expect(!cleared.error() && cleared.code == AlStatusCode::none && cleared.state() == way.from,
               fmt::format("acknowledged: 0120h = {:04X}h", static_cast<unsigned>(way.from) | 0x10U),
               fmt::format("{} without error", short_name(way.from)), text_of(cleared));
  leave(trial);
}

void unknown(Trial& trial, int) {
  go_to(trial, AlState::pre_operational);
  const AlStatus seen = request(trial, 0x05);
  trial.expect(
      seen.error() && seen.code == AlStatusCode::unknown_requested_state && seen.state() == AlState::pre_operational,
      "0120h = 0005h, no state, in PREOP", "PREOP with error indication and AL status code 0012h", text_of(seen));
  leave(trial);
}

void set_length(Trial& trial, unsigned channel, std::uint16_t length) {
  EthercatMaster& master = master_of(trial);
  const std::uint16_t station = slave_of(trial).station();
  const std::uint16_t activate = reg::sync_manager_at(channel, reg::sync_manager_activate);
  master.write<std::uint8_t>(station, activate, 0);
  master.write<std::uint16_t>(station, reg::sync_manager_at(channel, reg::sync_manager_length), length);
  master.write<std::uint8_t>(station, activate, 1);
}

void mailbox_configuration(Trial& trial, int) {
  if (!slave_of(trial).has_mailbox()) Trial::skip("it has no mailbox");
  go_to(trial, AlState::init);  // switches the sync managers off
  const AlStatus seen = request(trial, static_cast<unsigned>(AlState::pre_operational));
  trial.expect(
      seen.error() && seen.code == AlStatusCode::invalid_mailbox_configuration && seen.state() == AlState::init,
      "0120h = PREOP without mailbox sync managers", "INIT with error indication and AL status code 0016h",
      text_of(seen));
  acknowledge_error(master_of(trial), slave_of(trial).station(), 1s);
  slave_of(trial).to_pre_operational();
}

void process_data_configuration(Trial& trial, int row) {
  const unsigned channel = row == 0 ? 2 : 3;
  go_to(trial, AlState::pre_operational);
  const ProcessData data = read_process_data(slave_of(trial));
  const unsigned bytes = bytes_of(row == 0 ? data.outputs : data.inputs);
  if (bytes == 0) Trial::skip("it has no process data of this direction");
  {
    const CyclicExchange exchange(master_of(trial), {{&slave_of(trial), data}},
                                  trial.subject().ethercat().options.cyclic);
    set_length(trial, channel, static_cast<std::uint16_t>(bytes + 1));
    const AlStatus seen = request(trial, static_cast<unsigned>(AlState::safe_operational));
    const AlStatusCode wanted =
        row == 0 ? AlStatusCode::invalid_output_configuration : AlStatusCode::invalid_input_configuration;
    trial.expect(
        seen.error() && seen.code == wanted && seen.state() == AlState::pre_operational,
        fmt::format("0120h = SAFEOP with sync manager {} of {} bytes, where {} are mapped", channel, bytes + 1, bytes),
        fmt::format("PREOP with error indication and AL status code {:04X}h", static_cast<unsigned>(wanted)),
        text_of(seen));
  }
  leave(trial);
}

void watchdog(Trial& trial, int) {
  go_to(trial, AlState::operational);
  trial.subject().operation().exchange().stop();
  master_of(trial).wait(1s);
  const AlStatus seen = slave_of(trial).status();
  trial.expect(
      seen.state() == AlState::safe_operational && seen.error() && seen.code == AlStatusCode::sync_manager_watchdog,
      "no process data for 1 s in OP", "SAFEOP with error indication and AL status code 001Bh", text_of(seen));
  leave(trial);
}

void working_counter(Trial& trial, int) {
  EthercatMaster& master = master_of(trial);
  const std::uint16_t station = slave_of(trial).station();
  std::array<std::uint8_t, 2> bytes{};
  const auto counter_of = [&](ethercat::Command command, std::uint16_t to, std::uint16_t offset) {
    EthercatDatagram datagram{.command = command, .address = ethercat::address_of(to, offset), .data = bytes};
    master.exchange(datagram);
    return datagram.counter;
  };
  const auto look = [&](const char* what, ethercat::Command command, std::uint16_t to, std::uint16_t offset,
                        unsigned wanted) {
    const unsigned seen = counter_of(command, to, offset);
    trial.expect(seen == wanted, what, fmt::format("working counter {}", wanted), fmt::format("{}", seen));
  };
  look("FPRD of 0130h", ethercat::Command::fprd, station, reg::al_status, 1);
  look("FPRD of 0130h of a station address that no slave has", ethercat::Command::fprd, 0x7FFE, reg::al_status, 0);
  look("FPWR of 0130h, which is read-only", ethercat::Command::fpwr, station, reg::al_status, 0);
  look("BRD of 0130h", ethercat::Command::brd, 0, reg::al_status,
       static_cast<unsigned>(trial.subject().ethercat().line.size()));
}

void process_data_counter(Trial& trial, int) {
  go_to(trial, AlState::operational);
  CyclicExchange& exchange = trial.subject().operation().exchange();
  exchange.forget_statistics();
  master_of(trial).wait(200ms);
  const CyclicStatistics& seen = exchange.statistics();
  trial.expect(seen.wrong_counters == 0 && seen.cycles > 10, "200 ms of process data in OP",
               "each cycle with the working counter of all sync managers",
               fmt::format("{} of {} cycles with another", seen.wrong_counters, seen.cycles));
  leave(trial);
}

void distributed_clock(Trial& trial, int) {
  const FoundSlave& found = slave_of(trial).found();
  const bool has_mode = std::any_of(found.sii.dc_modes.begin(), found.sii.dc_modes.end(),
                                    [](const SiiDcMode& mode) { return (mode.assign_activate & 0x0300) == 0x0300; });
  if (!found.has_clock() || !has_mode) Trial::skip("it has no distributed clock, or its SII no mode with SYNC0");
  trial.subject().leave_operation();
  OperationOptions options = trial.subject().ethercat().options;
  options.distributed_clocks = true;
  options.clock.drift_frames = 3000;
  EthercatSlave* const slaves[] = {&slave_of(trial)};
  try {
    const EthercatOperation operation(master_of(trial), trial.subject().ethercat().line, slaves, options);
    master_of(trial).wait(300ms);
    const AlStatus seen = slave_of(trial).status();
    trial.expect(seen.state() == AlState::operational && !seen.error(), "SYNC0 by its DC mode, OP, 300 ms", "OP",
                 text_of(seen));
  } catch (const EthercatError& error) {
    trial.expect(false, "SYNC0 by its DC mode, OP", "OP", error.what());
  }
  leave(trial);
}

constexpr auto machine = "ETG.1000.6 6.4.1, ETG.1020 11";
constexpr auto codes = "ETG.1020 table 11, AL status codes";
constexpr unsigned ec = buses::ethercat;

constexpr std::array rows{
    Check{"al.up", machine, "INIT, PREOP, SAFEOP, OP", Demand::nothing, ec, up},
    Check{"al.down", machine, "Any lower state is reached in one step", Demand::nothing, ec, down},
    Check{"al.illegal-init-safeop", codes, "INIT to SAFEOP is refused with 0011h", Demand::nothing, ec, illegal, 0},
    Check{"al.illegal-init-op", codes, "INIT to OP is refused with 0011h", Demand::nothing, ec, illegal, 1},
    Check{"al.illegal-preop-op", codes, "PREOP to OP is refused with 0011h", Demand::nothing, ec, illegal, 2},
    Check{"al.illegal-preop-boot", codes, "PREOP to BOOT is refused with 0011h", Demand::nothing, ec, illegal, 3},
    Check{"al.illegal-safeop-boot", codes, "SAFEOP to BOOT is refused with 0011h", Demand::nothing, ec, illegal, 4},
    Check{"al.illegal-op-boot", codes, "OP to BOOT is refused with 0011h", Demand::nothing, ec, illegal, 5},
    Check{"al.unknown-state", codes, "An unknown state is refused with 0012h", Demand::nothing, ec, unknown},
    Check{"al.mailbox-configuration", codes, "PREOP without a mailbox is refused with 0016h", Demand::nothing, ec,
          mailbox_configuration},
    Check{"al.output-configuration", codes, "SAFEOP with wrong outputs is refused with 001Dh", Demand::nothing, ec,
          process_data_configuration, 0},
    Check{"al.input-configuration", codes, "SAFEOP with wrong inputs is refused with 001Eh", Demand::nothing, ec,
          process_data_configuration, 1},
    Check{"al.watchdog", "ETG.1000.4 6.3, ETG.1020 table 11", "OP without process data ends with 001Bh",
          Demand::nothing, ec, watchdog},
    Check{"al.working-counter", "ETG.1000.4 5.4", "Working counters match the executed commands", Demand::nothing, ec,
          working_counter},
    Check{"al.process-data-counter", "ETG.1000.4 5.4, 6.5", "Working counters of process data are correct",
          Demand::nothing, ec, process_data_counter},
    Check{"al.distributed-clock", "ETG.1020 23", "OP with SYNC0 is reached and held", Demand::nothing, ec,
          distributed_clock},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::al_state_group
