#pragma once

#include "master/ethercat/process_data.hpp"
#include "master/process_image.hpp"

namespace servodrome::master {

struct CyclicOptions {
  Time period = std::chrono::milliseconds(2);
  // True: one LRW for outputs and inputs, if all slaves support it; otherwise LWR and LRD.
  bool use_lrw = true;
  // check() throws if more consecutive cycles than this lack data or a correct working counter.
  unsigned tolerated_losses = 10;
};

struct CyclicStatistics {
  std::uint64_t cycles = 0;
  std::uint64_t lost = 0;            // cycles with a frame that did not return
  std::uint64_t late = 0;            // cycles with a frame that returned late, with correct working counters
  std::uint64_t wrong_counters = 0;  // cycles in which at least one slave did not take part
  std::uint64_t skipped = 0;         // cycles not run because the program was late
  unsigned losses_in_a_row = 0;      // cycles without all data in time, up to now
  unsigned longest_loss = 0;         // most such cycles in a row
  Time worst_lateness{0};            // longest delay of a frame
};

class CyclicExchange;

// The process data of one slave.
class SlaveImage final : public ProcessImage {
 public:
  SlaveImage(CyclicExchange& exchange, std::size_t member) : exchange_(exchange), member_(member) {}
  std::optional<ProcessObject> output(ObjectAddress object) override;
  std::optional<ProcessObject> input(ObjectAddress object) override;
  std::string where() const override;

 private:
  CyclicExchange& exchange_;
  std::size_t member_;
};

// Exchanges the process data of several slaves with a fixed period, while the master waits or does other work. Places
// the slaves' data in logical memory one after the other: in each frame first outputs, then inputs, together at most
// ethercat::max_datagram_data (1486) bytes.
class CyclicExchange final : public CyclicTask {
 public:
  struct Member {
    EthercatSlave* slave;
    ProcessData data;
  };

  // Sets up sync managers 2 and 3 and the FMMUs of the slaves, which must be in PREOP and outlive this. Switches the
  // FMMUs of all other slaves of the segment off.
  CyclicExchange(EthercatMaster& master, std::vector<Member> members, const CyclicOptions& options = {});
  ~CyclicExchange() { stop(); }
  CyclicExchange(const CyclicExchange&) = delete;
  CyclicExchange& operator=(const CyclicExchange&) = delete;

  // Starts the cycles: one every period, whenever the master waits.
  void start();
  void stop();
  bool runs() const { return runs_; }

  // Synchronises the cycle to the distributed clock. Every cycle distributes the time of the reference and sends its
  // frames `before_sync0` before a SYNC0. The times of SYNC0 are `sync0` plus multiples of the period.
  void follow_clock(std::uint16_t reference, std::uint64_t sync0, Time before_sync0);
  // Phase error of the last frame by the reference clock; positive: late.
  Time clock_error() const { return clock_error_; }

  // Brings all members to the state at the same time and waits until they have reached it; to_operational() starts the
  // exchange first. A member that refuses OP because it has not seen process data or SYNC0 in time (`is_transient`) is
  // requested again twice: with the cycle running, such a refusal passes by itself.
  void to_pre_operational();
  void to_safe_operational();
  void to_operational();

  // Throws EthercatError if a member has left the requested state, or if too many cycles were lost.
  void check() const;
  // The same for one member. Does not throw if only another member does not answer or has left its state.
  void check(std::size_t member) const;
  AlStatus status(std::size_t member) const { return status_[member]; }
  // Time at which the master sent the frames of the last cycle that the member has certainly processed: a cycle whose
  // data all returned, or in which the member at least answered the read of its AL status.
  Time processed(std::size_t member) const { return processed_[member]; }
  // True if the inputs of the newest cycle are complete.
  bool inputs_are_fresh() const { return statistics_.losses_in_a_row == 0; }

  // nullopt: not mapped. Results are valid as long as this exists.
  std::optional<ProcessObject> output(std::size_t member, ObjectAddress object);
  std::optional<ProcessObject> input(std::size_t member, ObjectAddress object);
  std::span<std::uint8_t> outputs(std::size_t member);
  std::span<const std::uint8_t> inputs(std::size_t member);

  // The member's objects in both directions.
  SlaveImage image(std::size_t member);

  // `action` is called after each cycle and computes the outputs of the next one. It must not block.
  void on_cycle(std::function<void()> action) { on_cycle_ = std::move(action); }

  // `action` is called after each cycle, before that of on_cycle(), for a caller that only watches the inputs.
  void on_inputs(std::function<void()> action) { on_inputs_ = std::move(action); }

  // Time at which the last cycle's frames were sent.
  Time sent() const { return sent_; }
  const CyclicStatistics& statistics() const { return statistics_; }
  void forget_statistics() { statistics_ = {}; }
  const std::vector<Member>& members() const { return members_; }
  Time period() const { return options_.period; }
  // Timeout of the member's process data watchdog. If no cycle arrives for this time, the slave leaves OP and its axis
  // stops. The constructor enables a watchdog that is off.
  Time watchdog(std::size_t member) const { return watchdogs_[member]; }
  bool uses_lrw() const { return lrw_; }
  std::size_t frames_with_data() const { return groups_.size(); }

  Time due() const override { return due_; }
  void run() override;
  void overdue(std::span<const ethercat::Datagram> datagrams) override;

 private:
  // A datagram that did not return within its cycle.
  struct Overdue {
    std::uint64_t cycle;
    std::uint8_t index;
    std::uint32_t address;
    std::optional<unsigned> counter;  // expected working counter
  };

  struct Place {
    std::size_t group = 0;
    std::size_t offset = 0;  // within the outputs or inputs of the group
    std::size_t bytes = 0;
  };
  struct Group {
    std::uint32_t logical = 0;
    std::size_t output_bytes = 0;
    std::size_t input_bytes = 0;
    unsigned writers = 0;  // slaves with outputs
    unsigned readers = 0;
    std::vector<std::uint8_t> bytes;
  };

  void lay_out();
  Place place(std::size_t bytes, bool outputs);
  void configure(std::size_t member);
  Time arm_watchdog(EthercatSlave& slave);
  void write_channel(EthercatSlave& slave, bool outputs, std::size_t bytes, std::uint16_t& start);
  std::size_t input_offset(const Place& place) const { return groups_[place.group].output_bytes + place.offset; }
  void request_all(AlState state);
  void judge(bool back);
  void check_state(std::size_t member) const;
  bool is_lost(std::size_t member) const;
  void expect_later();
  void schedule();

  EthercatMaster& master_;
  std::vector<Member> members_;
  std::vector<Time> watchdogs_;
  CyclicOptions options_;
  bool lrw_ = true;
  std::vector<Group> groups_;
  std::vector<Place> output_places_;
  std::vector<Place> input_places_;
  std::vector<AlStatus> status_;
  std::vector<unsigned> silence_;  // cycles since the AL status of each member was read
  std::vector<Time> processed_;
  AlState wanted_ = AlState::pre_operational;
  std::function<void()> on_cycle_;
  std::function<void()> on_inputs_;

  bool runs_ = false;
  Time due_ = Time::max();
  Time sent_{};
  std::vector<EthercatDatagram> datagrams_;  // datagrams of a cycle: time, AL status, process data
  std::vector<unsigned> expected_;           // expected working counters of the process data
  std::size_t next_status_ = 0;              // member whose AL status the next cycle reads
  std::array<std::uint8_t, 6> status_bytes_{};
  CyclicStatistics statistics_;
  std::vector<Overdue> overdue_;

  std::optional<std::uint16_t> reference_;
  std::uint64_t frame_phase_ = 0;  // phase of the frames in the reference's time, within a period
  std::array<std::uint8_t, 8> time_bytes_{};
  Time clock_error_{0};
};

}  // namespace servodrome::master
