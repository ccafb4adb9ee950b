#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "ethercat/esc/distributed_clock.hpp"
#include "ethercat/esc/fmmu.hpp"
#include "ethercat/esc/live_registers.hpp"
#include "ethercat/esc/registers.hpp"
#include "ethercat/esc/sii_interface.hpp"
#include "ethercat/esc/sync_manager.hpp"
#include "ethercat/esc/watchdog.hpp"
#include "ethercat/frame/datagram.hpp"

namespace servodrome::ethercat {

// An EtherCAT slave controller (ETG.1000.4): its registers and memory, the execution of datagrams on them, and the
// interface for the application. Two ports, 8 FMMUs, 8 sync managers, 8 KiB of process data memory, a 64-bit
// distributed clock.
//
// A register write acts when its datagram is executed, not at the end of the frame. The processing unit takes the time
// of a frame once, at its beginning.
class alignas(64) Esc {
 public:
  static constexpr std::size_t memory_size = 0x3000;
  static constexpr unsigned ports = 2;
  static constexpr unsigned fmmus = reg::fmmus;
  static constexpr unsigned sync_managers = reg::sync_managers;

  // `sii` is the content of the slave information memory.
  explicit Esc(std::span<std::uint8_t> sii, SiiInterface::Timing timing = {}) : sii_(sii, timing) {}
  Esc(const Esc&) = delete;
  Esc& operator=(const Esc&) = delete;

  // Power-on or reset. Cables stay connected.
  void power_on(Time now);

  // ---- The line ----

  // Effects of a frame that concern the whole segment.
  static constexpr unsigned effect_receive_times =
      1;                                       // 0900h was written: the times at the other ports must be latched
  static constexpr unsigned effect_marks = 2;  // the frame's source address must be changed: see processes_only()

  // The processing unit executes the datagrams of a frame that passes at `now`. Returns the effects.
  unsigned process(Frame& frame, Time now);

  // A link: a cable with a working partner at its other end.
  void set_link(unsigned port, bool link);
  bool link(unsigned port) const { return link_[port]; }
  // Accepts frames from the slave before it: port 0 has a link and its loop is open.
  bool takes_frames() const { return link_[0] && !loop_closed_[0]; }
  // A closed loop sends frames back inside the controller (DL control, ETG.1000.4 table 33).
  bool loop_closed(unsigned port) const { return loop_closed_[port]; }
  // The port is set to close its loop automatically when the link is lost, not set by hand (DL control).
  bool closes_loops_itself(unsigned port) const { return (memory_[reg::dl_control + 1] >> 2 * port & 3U) < 2; }
  // A frame that arrives at a port with a closed loop is lost, but it reopens a loop that closed when the link was
  // lost.
  void frame_at_closed_port(unsigned port);
  // DL control bit 0: destroy frames that are not EtherCAT and change the source address of EtherCAT frames.
  bool processes_only() const { return (memory_[reg::dl_control] & 0x01) != 0; }
  void latch_port_time(unsigned port, Time arrival);
  // Error counters; they stop at 255.
  void count_invalid_frame(unsigned port) { increment(reg::rx_errors + 2U * port); }
  void count_forwarded_error(unsigned port) { increment(reg::forwarded_rx_errors + port); }
  void count_processing_unit_error() { increment(reg::processing_unit_errors); }

  // ---- The application's side ----

  // Pending events for the application: bits as in the AL event request (without its mask), and this one.
  static constexpr std::uint32_t attention_reset = 0x80000000;  // the controller was reset over the bus
  std::uint32_t attention() const { return attention_; }
  void settle(std::uint32_t events) { attention_ &= ~events; }
  // Returns true if the application has something to do at `now`. Deferred events (put_off) count again from
  // `quiet_until` on.
  bool calls(Time now) const { return (attention_ & ~put_off_) != 0 || (attention_ != 0 && now >= quiet_until_); }
  // Quick check, mostly true: no event is pending except deferred ones, and no deadline is reached.
  bool quiet(Time now) const { return (attention_ & ~put_off_) == 0 && now < quiet_until_; }
  // The application defers these events: they do not call it before `quiet_until` or another event. Replaces the set
  // that was deferred before.
  void put_off(std::uint32_t events) { put_off_ = events; }
  // Nothing is due before this time, neither in the controller nor in the application, which calculates it. A write to
  // a register resets it to `unknown`, since it may create an earlier deadline; the application resets it in the same
  // way.
  static constexpr Time unknown = Time::min();
  Time quiet_until() const { return quiet_until_; }
  void set_quiet_until(Time time) { quiet_until_ = time; }

  // Reading AL control acknowledges it: the master can then write the next one.
  std::uint16_t take_al_control();
  void set_al_status(std::uint16_t status, std::uint16_t code);
  std::uint16_t station_alias() const { return load_u16(&memory_[reg::station_alias]); }  // the alias in use, 0012h
  std::uint16_t al_status() const { return load_u16(&memory_[reg::al_status]); }
  std::uint32_t al_event_request() const;

  const SyncManager& sync_manager(unsigned n) const { return sync_managers_[n]; }
  const Fmmu& fmmu(unsigned n) const { return fmmus_[n]; }
  // Opens the buffer to be read (mailbox: empty if there is no message; buffered mode: the newest complete buffer) or
  // the buffer to be written. The caller closes each buffer that it opened. The bytes to be read may be changed until
  // then.
  std::span<std::uint8_t> open_for_reading(unsigned n);
  void close_reading(unsigned n);
  std::span<std::uint8_t> open_for_writing(unsigned n);
  void close_writing(unsigned n);
  // Repeat request of the master: repeat() marks the mailbox full again and acknowledges the request.
  bool repeat_requested(unsigned n) const;
  void repeat(unsigned n);
  void acknowledge_repeat(unsigned n);
  // PDI control bit 0: the application disables or enables a channel.
  void disable_sync_manager(unsigned n, bool disabled);

  // Faults of the clock, for tests of masters; DistributedClock describes them. These functions also reset
  // quiet_until(), because a fault may bring the next deadline forward.
  void set_oscillator(std::int32_t error_ppb, Time now) {
    clock_.set_oscillator(error_ppb, now);
    quiet_until_ = unknown;
  }
  void stop_clock(bool stopped, Time now) {
    clock_.stop(stopped, now);
    quiet_until_ = unknown;
  }
  void jump_clock(Time by, Time now) {
    clock_.jump(by, now);
    quiet_until_ = unknown;
  }

  // Further faults. Without process data, datagrams with logical addresses pass the slave without effect. With a dead
  // watchdog the process data watchdog never expires, whatever a master writes to it. Both last until the caller
  // ends them, also after power_on.
  void set_without_process_data(bool without) {
    without_process_data_ = without;
    configure_mappings();
  }
  void set_watchdog_dead(bool dead) {
    watchdog_dead_ = dead;
    configure_watchdogs();
    quiet_until_ = unknown;
  }
  bool watchdog_dead() const { return watchdog_dead_; }

  DistributedClock& clock() { return clock_; }
  const DistributedClock& clock() const { return clock_; }
  // sii().memory() is the content of the slave information memory. A caller may change it at any time: a master reads
  // the new bytes at once, the controller takes its own settings from them at power-on or a reload command. The
  // checksum is not corrected (sii_checksum); with a wrong one the slave refuses Pre-Operational with 0051h.
  SiiInterface& sii() { return sii_; }
  // Loads the controller's settings from the SII as at power-on, with the alias, and checks the checksum.
  void load_sii_anew();
  const Watchdog& process_data_watchdog() const { return process_data_watchdog_; }
  void pdi_alive(Time now) {
    pdi_watchdog_.check(now);
    pdi_watchdog_.trigger(now);
    quiet_until_ = unknown;
  }
  // Stops pulses that 0980h assigns to the application, since no master can stop those.
  void stop_own_pulses();
  // A latch input changed (ETG.1000.4 clause 6.7.4).
  void latch_edge(unsigned unit, bool rising, Time now);

  Time now() const { return now_; }                 // of the last frame or poll
  std::uint32_t frames() const { return frames_; }  // frames that have passed since power-on

  // Handles pulses, watchdogs and delays that are due; call it no later than `next_deadline`. Returns bit n for SYNCn.
  unsigned poll(Time now);
  Time next_deadline(Time now) {
    const Time watchdogs = std::min(process_data_watchdog_.deadline(), pdi_watchdog_.deadline());
    return std::min(watchdogs, std::min(dl_control_until_, clock_.next_sync(now)));
  }

  // The current bytes of a register, for the application and for tests.
  std::uint8_t read_byte(std::uint16_t address, Time now);
  template <typename T>
  T read_register(std::uint16_t address, Time now) {
    std::array<std::uint8_t, sizeof(T)> bytes;
    for (std::size_t i = 0; i < sizeof(T); ++i) bytes[i] = read_byte(static_cast<std::uint16_t>(address + i), now);
    return load<T>(bytes.data());
  }
  const std::uint8_t* registers(std::uint16_t address) const { return &memory_[address]; }
  // Registers that the application may write without side effects: station alias, PDI access of the SII, pulse
  // length...
  template <typename T>
  void write_register(std::uint16_t address, T value) {
    store(&memory_[address], value);
  }

 private:
  struct Mapping {  // an FMMU that maps whole bytes
    std::uint32_t logical;
    std::uint32_t length;
    std::uint16_t physical;
    std::uint8_t sync_manager;  // the sync manager whose area contains the whole mapping, or none
  };
  static constexpr std::uint8_t no_sync_manager = 0xFF;
  // Positions of both buffers in a datagram that contains both completely. Cached: masters send the same one in every
  // cycle.
  struct Fit {
    std::uint32_t logical = 0;   // logical address of the datagram
    std::uint32_t length = ~0U;  // its length in bytes; the initial value fits no datagram
    std::uint32_t outputs = 0;   // position of the outputs in its data
    std::uint32_t inputs = 0;
    std::uint32_t events = 0;  // event bits of the two sync managers
    SyncManager* writing = nullptr;
    SyncManager* reading = nullptr;
  };
  // The range of logical addresses that holds both buffers. Datagrams outside of it do not concern this slave.
  struct Reach {
    std::uint64_t begin = 0;
    std::uint64_t end = std::uint64_t{1} << 32;
    bool touches(const Datagram& datagram) const {
      return datagram.logical() < end && std::uint64_t{datagram.logical()} + datagram.length > begin;
    }
  };

  unsigned process_rest(std::span<Datagram> datagrams);
  bool execute_at_once(Datagram datagram);
  void execute(Datagram& datagram);
  bool fit(const Datagram& datagram);
  bool addressed(std::uint16_t station) const;
  void exchange(Datagram& datagram, bool reads, bool writes, bool combines);
  void exchange_logical(Datagram& datagram, bool reads, bool writes);
  bool is_plain(Datagram datagram) const;
  bool combine_word(Datagram datagram);
  bool read_plain(Datagram datagram);
  bool exchange_buffers(Datagram datagram);
  void exchange_bits(Datagram& datagram, bool reads, bool writes);
  bool read_mapped(const Mapping& mapping, const Datagram& datagram, std::uint32_t logical, std::uint32_t length);
  bool write_mapped(const Mapping& mapping, const Datagram& datagram, std::uint32_t logical, std::uint32_t length);

  template <typename Put>
  bool read_memory(std::uint32_t address, std::uint32_t length, Put put);
  template <typename Get>
  bool write_memory(std::uint32_t address, std::uint32_t length, Get get);
  unsigned sync_manager_at(std::uint32_t address) const;
  std::uint32_t plain_until(std::uint32_t address, std::uint32_t end) const;

  void refresh(std::uint32_t address, std::uint32_t length) {
    for (std::uint32_t block = address / 16; block <= (address + length - 1) / 16; ++block) {
      if (live_register_blocks[block]) refresh_block(block);
    }
  }
  void refresh_block(std::uint32_t block);
  void registers_read(std::uint32_t address, std::uint32_t length);
  bool may_write(std::uint32_t address, std::uint32_t sync_managers_enabled) const;
  bool take_register_bytes(std::uint32_t address, std::span<const std::uint8_t> bytes);
  void block_written(std::uint32_t block, std::uint32_t first, std::uint32_t length);
  void written_by_master(unsigned n) {
    attention_ |= reg::al_event::sync_manager0 << n;
    if (sync_managers_[n].triggers_watchdog) process_data_came();
  }
  void process_data_came() {
    if (process_data_watchdog_.check(now_)) attention_ |= reg::al_event::watchdog_process_data;
    process_data_watchdog_.trigger(now_);
  }
  void read_by_master(unsigned n) { attention_ |= reg::al_event::sync_manager0 << n; }
  void configure_sync_manager(unsigned n);
  void configure_mappings();
  void configure_watchdogs();
  void configure_ports();
  void start_time_written(bool low_half, bool high_half);
  void configure_sync();
  void load_from_sii();
  void reset_letter(std::uint8_t letter);
  void expire_watchdogs();
  std::uint16_t ecat_event_request() const;
  void increment(std::uint32_t address) {
    if (memory_[address] != 0xFF) ++memory_[address];
  }
  void end_frame();

  // The members that a process data frame needs lie together, because the CPU caches are cold when a frame comes.
  Time now_{0};  // time of the frame or poll being handled
  Time quiet_until_ = unknown;
  std::uint32_t attention_ = 0;
  std::uint32_t put_off_ = 0;  // set by the application
  std::uint32_t frames_ = 0;
  unsigned effects_ = 0;
  std::uint16_t ecat_events_ = 0;
  bool raises_events_ = false;  // 0200h is not 0
  bool frame_end_work_ = false;
  std::array<bool, ports> link_{};
  std::array<bool, ports> loop_closed_{true, true};
  Fit fit_;
  Watchdog process_data_watchdog_;
  Reach reach_;
  alignas(64) std::array<SyncManager, sync_managers> sync_managers_{};
  alignas(64) std::array<std::uint8_t, memory_size> memory_{};

  std::array<Fmmu, fmmus> fmmus_{};
  std::array<Mapping, fmmus> reading_{};
  std::array<Mapping, fmmus> writing_{};
  std::uint8_t reading_count_ = 0;
  std::uint8_t writing_count_ = 0;
  // All FMMUs map whole bytes, no FMMU that reads overlaps the memory of one that writes, and nothing is
  // write-protected.
  bool whole_bytes_ = true;
  // One FMMU in each direction, each mapping exactly one small three-buffer channel: the usual case in Operational.
  bool one_buffer_each_ = false;

  DistributedClock clock_;
  SiiInterface sii_;
  Watchdog pdi_watchdog_;
  bool without_process_data_ = false;
  bool watchdog_dead_ = false;

  bool al_control_pending_ = false;
  bool sync_active_ = false;         // 0981h bit 0 as it was applied last
  bool latches_ports_ = false;       // the datagram being executed writes 0900h
  bool registers_unlocked_ = false;  // by 0020h in this frame
  bool memory_unlocked_ = false;     // by 0030h in this frame
  bool reset_pending_ = false;
  std::uint8_t reset_progress_ = 0;
  std::uint32_t reset_frame_ = 0;
  std::uint8_t lasting_loops_ = 0;
  Time dl_control_until_ = never;
};

}  // namespace servodrome::ethercat
