// `state`: shows or changes the EtherCAT states of slaves.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/number_options.hpp"
#include "links/time.hpp"

namespace servodrome::app {
namespace state_command {

using master::AlState;

struct Options {
  BusOptions bus{.link = std::string(links::scheme::udp.example)};
  std::string state;
  double seconds = 0.0;  // 0: until Ctrl-C
};

constexpr master::Time look_interval = std::chrono::milliseconds(20);

void print(const Options& options, std::vector<master::EthercatSlave*>& slaves,
           const master::CyclicStatistics* statistics) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (master::EthercatSlave* slave : slaves) {
    const master::AlStatus status = slave->status();
    if (options.bus.json) {
      list.push_back({{"node", slave->found().position},
                      {"name", slave->found().sii.name},
                      {"state", master::short_name(status.state())},
                      {"error", status.error()},
                      {"al_status_code", static_cast<unsigned>(status.code)},
                      {"al_status_text", text(status.code)}});
    } else {
      fmt::print("slave {}: {}{}\n", slave->found().position, text_of(status),
                 status.error() ? fmt::format("; {}", master::remedy_of(status.code)) : "");
    }
  }
  if (options.bus.json) {
    nlohmann::ordered_json json{{"bus", options.bus.link}, {"nodes", std::move(list)}};
    if (statistics != nullptr) {
      json["cycles"] = statistics->cycles;
      json["lost"] = statistics->lost;
      json["late"] = statistics->late;
      json["wrong_counters"] = statistics->wrong_counters;
      json["skipped"] = statistics->skipped;
    }
    fmt::print("{}\n", json.dump(2));
  } else if (statistics != nullptr) {
    fmt::print("{} cycles, {} lost, {} late, {} with wrong working counters, {} skipped\n", statistics->cycles,
               statistics->lost, statistics->late, statistics->wrong_counters, statistics->skipped);
  }
  std::fflush(stdout);
}

// Holds OP, which lasts only as long as the master sends process data.
void operate(const Options& options, master::EthercatMaster& master, const std::vector<master::FoundSlave>& line,
             std::vector<master::EthercatSlave*>& slaves) {
  const InterruptGuard guard;
  master::EthercatOperation operation(master, line, slaves, operation_options(options.bus));
  const master::Time start = master.now();
  const auto lasts = links::from_seconds(options.seconds);
  if (!options.bus.json) print(options, slaves, nullptr);
  while (!InterruptGuard::interrupted() && (options.seconds <= 0 || master.now() - start < lasts)) {
    master.wait(look_interval);
    operation.exchange().check();
  }
  const master::CyclicStatistics statistics = operation.exchange().statistics();
  print(options, slaves, &statistics);
}

void to_safe_operational(master::EthercatMaster& master, const std::vector<master::EthercatSlave*>& slaves) {
  std::vector<master::CyclicExchange::Member> members;
  for (master::EthercatSlave* slave : slaves) {
    slave->to_pre_operational();
    set_synchronisation(*slave, false);
    members.push_back({slave, read_process_data(*slave)});
  }
  master::CyclicExchange(master, std::move(members)).to_safe_operational();
}

void run(const Options& options) {
  const auto wanted = master::parse_al_state(options.state);
  if (!options.state.empty() && !wanted) {
    throw Failure::wrong_use(
        fmt::format("state: \"{}\" is not a state; write init, preop, boot, safeop or op", options.state));
  }
  if (bus_kind(options.bus).kind != BusKind::ethercat) {
    throw Failure::wrong_use(
        fmt::format("--bus {}: only EtherCAT has these states; on CAN use `servodrome nmt`", options.bus.link));
  }
  const auto master = open_ethercat_master(options.bus);
  const std::vector<master::FoundSlave> line = scan_segment(*master);
  std::vector<std::unique_ptr<master::EthercatSlave>> opened;
  std::vector<master::EthercatSlave*> slaves;
  const auto open = [&](const master::FoundSlave& found) {
    opened.push_back(std::make_unique<master::EthercatSlave>(*master, found, options.bus.timeout()));
    slaves.push_back(opened.back().get());
  };
  if (options.bus.node_id != 0) {
    open(choose_slave(*master, line, options.bus));
  } else {
    for (const master::FoundSlave& found : line) open(found);
  }
  if (wanted == AlState::operational) {
    operate(options, *master, line, slaves);
    return;
  }
  if (wanted == AlState::safe_operational) to_safe_operational(*master, slaves);
  for (master::EthercatSlave* slave : slaves) {
    if (wanted == AlState::init) slave->to_init();
    if (wanted == AlState::pre_operational) slave->to_pre_operational();
    if (wanted == AlState::bootstrap) slave->to_bootstrap();
  }
  print(options, slaves, nullptr);
}

}  // namespace state_command

void add_state(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "state", "Show or change the state of EtherCAT slaves; process data are exchanged while OP is held",
      state_command::run);
  command->add_option("STATE", options->state, "init, preop, boot, safeop or op; the states are shown if not given");
  add_bus_options(*command, options->bus, "Seconds to wait for each answer of a slave");
  command->get_option("--bus")->description(links::client_forms(links::ethercat_schemes_easiest_first, " or "));
  add_node_option(*command, options->bus);
  command->get_option("--node")->description("Position behind the master, or station alias; all slaves if not given");
  add_cycle_options(*command, options->bus);
  add_seconds_option(*command, options->seconds, "Duration of OP in seconds; until Ctrl-C if not given")
      ->check(number_within(0.001, 1e9));
}

}  // namespace servodrome::app
