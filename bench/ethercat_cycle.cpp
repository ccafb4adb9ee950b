// Operates a line for some time: brings all slaves to Operational and exchanges their process data with a fixed period,
// as a controller does. Prints how many cycles were complete, late or lost.
//
// If the interface at the line's end and the line's process are given, it also prints the cause of each lost cycle. Two
// witnesses record the kernel's time at which each frame arrives at the line and its answer arrives here. The
// scheduler's statistics (/proc/PID/schedstat, see sched-stats in the kernel's documentation) contain the time for
// which the line was ready to run and had no processor. A lost frame is the line's fault if the line did not answer it,
// or if the answer took longer than the period although the line had a processor.
//
// With FRAMES and BYTES no slaves are necessary: the program sends FRAMES frames of BYTES bytes of process data in each
// period, for example to a program that only echoes them. Lost or late cycles are then caused by the machine.
// Usage: ethercat_cycle LINK SECONDS PERIOD_US [LINE_INTERFACE LINE_PID [FRAMES BYTES]]
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include "frame_witness.hpp"
#include "links/ethercat/client.hpp"
#include "links/ethercat/link_name.hpp"
#include "master/ethercat/operation.hpp"

namespace {

using namespace servodrome;
using std::chrono::microseconds;
using Time = std::chrono::nanoseconds;

double in_microseconds(Time time) { return std::chrono::duration<double, std::micro>(time).count(); }
unsigned long long number(std::uint64_t value) { return value; }

// Records what the line did with each frame.
class Turnarounds {
 public:
  Turnarounds(const std::string& line_interface, const std::string& own_interface, const std::string& process)
      : at_line_(line_interface), back_(own_interface), schedstat_("/proc/" + process + "/schedstat") {}

  // To be called once after each cycle; `lost`: not all of its frames came back in time.
  void look(Time period, bool lost) {
    const Time waited = waited_for_processor();
    const Time waited_now = waited - std::exchange(waited_, waited);
    const Time slowest = slowest_answer();
    Time own = slowest - waited_now;
    // The hypervisor's share has a resolution of 10 ms, so it is read only for a late answer, and at intervals.
    if (own > period) own -= stolen() - stolen_;
    if (own > period || ++looks_ % looks_between_steal == 0) stolen_ = stolen();
    worst_ = std::max(worst_, slowest);
    worst_own_ = std::max(worst_own_, own);
    if (own > period) ++late_by_line_;
    if (slowest > period && own <= period) ++line_not_let_;
    // A late answer of a lost cycle may arrive in one of the next cycles. It is counted when it arrives.
    if (lost && slowest <= period && outstanding_ == 0) ++others_;
  }

  void forget() {
    frames_ = unanswered_ = late_by_line_ = line_not_let_ = others_ = 0;
    worst_ = worst_own_ = Time{0};
    stolen_ = stolen();
  }
  // To be called after the last cycle: frames without an answer count as unanswered.
  void finish() { unanswered_ += outstanding_; }

  std::uint64_t ours() const { return unanswered_ + late_by_line_; }
  void print() const {
    std::printf("  its own fault: %llu (%llu frames never answered, %llu times later than the period by itself)\n",
                number(ours()), number(unanswered_), number(late_by_line_));
    std::printf(
        "  of %llu frames the slowest answer took %.1f us, by itself (less its waits for a processor) %.1f us; late "
        "because it was not let: %llu times, because this master was not: %llu cycles\n",
        number(frames_), in_microseconds(worst_), in_microseconds(worst_own_), number(line_not_let_), number(others_));
  }

 private:
  static constexpr Time longest_answer = std::chrono::milliseconds(500);  // a later answer belongs to another frame
  static constexpr unsigned looks_between_steal = 100;

  Time slowest_answer() {
    bench::FrameWitness::Arrival arrival{};
    Time slowest{0};
    while (at_line_.next(arrival)) {
      at_[arrival.index].push_back(arrival.at);
      ++outstanding_;
      ++frames_;
    }
    while (back_.next(arrival)) {
      std::deque<Time>& asked = at_[arrival.index];
      for (; !asked.empty() && arrival.at - asked.front() > longest_answer; --outstanding_, ++unanswered_) {
        asked.pop_front();
      }
      if (asked.empty()) continue;
      slowest = std::max(slowest, arrival.at - asked.front());
      asked.pop_front();
      --outstanding_;
    }
    return slowest;
  }

  Time waited_for_processor() {
    std::ifstream file(schedstat_);
    std::int64_t ran = 0;
    std::int64_t waited = 0;
    file >> ran >> waited;
    return Time{waited};
  }
  // Stolen time of all processors of this virtual machine together (proc(5)).
  static Time stolen() {
    std::ifstream file("/proc/stat");
    std::string word;
    for (int field = 0; field <= 8; ++field) file >> word;
    return std::chrono::seconds(1) * std::atoll(word.c_str()) / sysconf(_SC_CLK_TCK);
  }

  bench::FrameWitness at_line_;
  bench::FrameWitness back_;
  std::string schedstat_;
  std::array<std::deque<Time>, 256> at_;  // by index: arrival times of frames that are not answered yet
  std::uint64_t outstanding_ = 0;
  Time waited_{0};
  Time stolen_{0};
  unsigned looks_ = 0;
  std::uint64_t frames_ = 0;
  std::uint64_t unanswered_ = 0;
  std::uint64_t late_by_line_ = 0;
  std::uint64_t line_not_let_ = 0;
  std::uint64_t others_ = 0;
  Time worst_{0};
  Time worst_own_{0};
};

// Frames of process data that do not depend on the slaves of the line.
void beat(const char* link, std::chrono::seconds span, Time period, std::size_t frames, std::size_t bytes,
          Turnarounds& turnarounds) {
  using Clock = std::chrono::steady_clock;
  const auto client = links::open_ethercat_client(link);
  std::array<std::uint8_t, ethercat::max_payload> memory;
  std::array<std::uint8_t, ethercat::max_payload> received;
  ethercat::FrameWriter writer = ethercat::FrameWriter::payload(memory);
  if (writer.add(ethercat::Command::lrw, 0, 0, bytes).size() != bytes) throw std::runtime_error("too long for a frame");
  constexpr std::size_t index_at = 3;
  const auto end = Clock::now() + span;
  for (auto next = Clock::now(); next < end; next = std::max(next + period, Clock::now())) {
    std::this_thread::sleep_until(next);
    for (std::size_t i = 0; i < frames; ++i) {
      ++memory[index_at];
      client->send(writer.bytes());
    }
    std::size_t back = 0;
    while (back < frames && client->receive(received, period) != 0) ++back;
    turnarounds.look(period, back < frames);
  }
  std::this_thread::sleep_for(std::chrono::seconds(1));  // waits for frames that are still on their way
  turnarounds.look(period, false);
  turnarounds.finish();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4 && argc != 6 && argc != 8) {
    std::fprintf(stderr, "usage: ethercat_cycle LINK SECONDS PERIOD_US [LINE_INTERFACE LINE_PID [FRAMES BYTES]]\n");
    return 2;
  }
  try {
    if (argc == 8) {
      const auto link = std::get<links::RawName>(links::parse_ethercat_link(argv[1]));
      const auto number_of = [argv](int i) { return static_cast<std::size_t>(std::atoi(argv[i])); };
      const microseconds period(std::atoi(argv[3]));
      Turnarounds turnarounds(argv[4], link.interface, argv[5]);
      turnarounds.look(period, false);
      turnarounds.forget();
      beat(argv[1], std::chrono::seconds(std::atoi(argv[2])), period, number_of(6), number_of(7), turnarounds);
      turnarounds.print();
      return 0;
    }
    const auto master = master::EthercatMaster::open(argv[1]);
    const std::vector<master::FoundSlave> found = master::scan_slaves(*master);
    std::vector<std::unique_ptr<master::EthercatSlave>> slaves;
    std::vector<master::EthercatSlave*> members;
    for (const master::FoundSlave& slave : found) {
      slaves.push_back(std::make_unique<master::EthercatSlave>(*master, slave));
      slaves.back()->to_pre_operational();
      members.push_back(slaves.back().get());
    }
    master::OperationOptions options;
    options.cyclic.period = microseconds(std::atoi(argv[3]));
    options.cyclic.tolerated_losses = 1'000'000;
    master::EthercatOperation operation(*master, found, members, options);
    master::CyclicExchange& exchange = operation.exchange();
    std::optional<Turnarounds> turnarounds;
    std::uint64_t lost_before = 0;
    if (argc == 6) {
      const auto link = std::get<links::RawName>(links::parse_ethercat_link(argv[1]));
      turnarounds.emplace(argv[4], link.interface, argv[5]);
      turnarounds->look(options.cyclic.period, false);
      turnarounds->forget();
      exchange.on_cycle([&] {
        const std::uint64_t lost = exchange.statistics().lost;
        turnarounds->look(options.cyclic.period, lost != std::exchange(lost_before, lost));
      });
    }
    exchange.forget_statistics();
    master->wait(std::chrono::seconds(std::atoi(argv[2])));
    const master::CyclicStatistics statistics = exchange.statistics();
    exchange.stop();
    std::printf(
        "%zu slaves, %zu frames a cycle: %llu cycles, %llu lost, %llu with wrong counters, %llu skipped, worst "
        "lateness %.1f us\n",
        found.size(), exchange.frames_with_data(), number(statistics.cycles), number(statistics.lost),
        number(statistics.wrong_counters), number(statistics.skipped), in_microseconds(statistics.worst_lateness));
    if (turnarounds) {
      master->wait(std::chrono::seconds(1));  // waits for frames that are still on their way
      turnarounds->look(options.cyclic.period, false);
      turnarounds->finish();
      turnarounds->print();
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
      const master::AlStatus status = exchange.status(i);
      if (status.state() == ethercat::AlState::operational && !status.error()) continue;
      std::printf("  slave %zu left Operational: %s\n", i + 1, master::text_of(status).c_str());
      return 1;
    }
    const std::uint64_t lost = turnarounds ? turnarounds->ours() : statistics.lost;
    return lost == 0 && statistics.wrong_counters == 0 ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ethercat_cycle: %s\n", error.what());
    return 1;
  }
}
