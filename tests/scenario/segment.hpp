#pragma once

#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/slave/slave.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/ethercat/operation.hpp"
#include "scenario/support.hpp"

namespace servodrome::scenario::test {

using ethercat::Command;
using master::AlState;
using master::AlStatusCode;

inline constexpr std::string_view one_slave = R"(
clock = "virtual"
[[bus]]
name = "ecat"
type = "ethercat"
[[axis]]
name = "x"
product = "generic402-ec"
alias = 7
)";

inline const std::string three_slaves = std::string(one_slave) + R"(
[[axis]]
name = "y"
product = "generic402-ec"
[[axis]]
name = "z"
product = "generic402-ec"
)";

// A datagram as it came back.
struct Back {
  std::uint8_t index = 0;
  std::uint64_t data = 0;
  unsigned counter = 0;
  std::size_t frame_length = 0;
};

// A segment under a scenario, a master that sends single frames, and Servodrome's own master.
class SegmentUnderRules {
 public:
  explicit SegmentUnderRules(const std::string& rules, std::string_view line_text = one_slave)
      : line(line::test::settings_of(line_text)),
        director(line, scenario_of(rules)),
        frames(bus(), line),
        master(std::make_unique<links::MemoryEthercatClient>(bus(), line), {.timeout = 5ms}) {
    director.begin();
    run(1ms);  // rules without `when` have begun
  }

  links::EthercatBus& bus() { return line.ethercat_buses().front()->bus; }
  line::Axis& x() { return *line.axes().front(); }
  ethercat::Slave& slave() { return *x().device().ethercat_slave(); }
  void run(Time time) { line.run_until(line.now() + time); }
  std::uint64_t acts(std::size_t rule = 0) const { return director.rules().at(rule).acts; }

  // ---- Single frames

  struct Datagram {
    Command command = Command::brd;
    std::uint32_t address = 0;
    std::size_t length = 2;
    std::uint64_t data = 0;
  };
  void send(std::initializer_list<Datagram> datagrams, std::uint8_t index = 1) { send(frames, datagrams, index); }
  static void send(links::EthercatClient& client, std::initializer_list<Datagram> datagrams, std::uint8_t index) {
    std::array<std::uint8_t, 200> memory{};
    auto writer = ethercat::FrameWriter::payload(memory);
    for (const Datagram& one : datagrams) {
      std::memcpy(writer.add(one.command, index, one.address, one.length).data(), &one.data, one.length);
    }
    client.send(writer.bytes());
  }
  // The datagrams of the next frame that comes back within the time.
  std::vector<Back> receive(Time within = 500us) { return receive(frames, within); }
  static std::vector<Back> receive(links::EthercatClient& client, Time within = 500us) {
    std::array<std::uint8_t, 200> memory{};
    const std::size_t size = client.receive(memory, within);
    std::vector<Back> all;
    ethercat::Frame frame;
    const auto kind = ethercat::parse_payload(std::span(memory).first(size), frame);
    if (size != 0 && kind != ethercat::FrameKind::ethercat) all.push_back({.frame_length = size});
    if (kind != ethercat::FrameKind::ethercat) return all;
    for (const ethercat::Datagram& datagram : frame.datagrams()) {
      Back back{datagram.index(), 0, datagram.working_counter(), size};
      std::memcpy(&back.data, datagram.data(), std::min<std::size_t>(datagram.length, 8));
      all.push_back(back);
    }
    return all;
  }
  std::vector<Back> ask(std::initializer_list<Datagram> datagrams) {
    send(datagrams);
    return receive();
  }
  static constexpr std::uint32_t first(std::uint16_t ado) { return ethercat::address_of(0, ado); }
  // A register of the slave at this position, 0 for the first.
  std::uint64_t read(std::uint16_t ado, std::size_t length = 2, std::uint16_t position = 0) {
    const auto adp = static_cast<std::uint16_t>(-position);
    return ask({{Command::aprd, ethercat::address_of(adp, ado), length}}).at(0).data;
  }
  void write(std::uint16_t ado, std::uint64_t data, std::size_t length = 2) {
    ask({{Command::apwr, first(ado), length, data}});
  }
  // Maps 2 bytes of memory at 2800h to logical address 10000h of each slave, to be read by LRD.
  void map_memory(std::uint16_t position = 0) {
    constexpr std::uint32_t logical = 0x10000;
    const auto adp = static_cast<std::uint16_t>(-position);
    const std::uint64_t low = logical | 2ULL << 32 | 7ULL << 56;
    const std::uint64_t high = 0x2800 | 1ULL << 24 | 1ULL << 32;
    ask({{Command::apwr, ethercat::address_of(adp, 0x0600), 8, low},
         {Command::apwr, ethercat::address_of(adp, 0x0608), 8, high}});
  }
  std::vector<Back> read_mapped() { return ask({{Command::lrd, 0x10000, 2}}); }

  // ---- States and services

  master::EthercatSlave& scan() {
    found = master::scan_slaves(master);
    slaves.clear();
    for (const master::FoundSlave& one : found) slaves.push_back(std::make_unique<master::EthercatSlave>(master, one));
    return *slaves.front();
  }
  // All slaves to Operational, with process data each millisecond.
  master::CyclicExchange& operate(bool clocks = false) {
    if (slaves.empty()) scan();
    std::vector<master::EthercatSlave*> all;
    for (const auto& one : slaves) all.push_back(one.get());
    operation.emplace(master, found, all,
                      master::OperationOptions{.cyclic = {.period = 1ms, .tolerated_losses = 1'000'000},
                                               .distributed_clocks = clocks,
                                               .clock = {.drift_frames = 200}});
    return operation->exchange();
  }
  // Operational, until the rules that begin with it act.
  master::CyclicExchange& operate_until_rules(bool clocks = false) {
    master::CyclicExchange& exchange = operate(clocks);
    master.wait(2ms);
    return exchange;
  }

  line::Line line;
  Director director;
  links::MemoryEthercatClient frames;
  master::EthercatMaster master;
  std::vector<master::FoundSlave> found;
  std::vector<std::unique_ptr<master::EthercatSlave>> slaves;
  std::optional<master::EthercatOperation> operation;
};

}  // namespace servodrome::scenario::test
