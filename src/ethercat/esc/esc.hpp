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

// An EtherCAT slave controller: its registers and memory, what frames do to them, and the side of the application
// (ETG.1000.4). Two ports, 8 FMMUs, 8 sync managers, 8 KiB of process data memory, a 64-bit distributed clock.
//
// Register writes act where the datagram stands in the frame, not at its end. The processing unit takes the time of a
// frame once, at its beginning.
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

  // Power-on or reset. What is plugged in stays plugged in.
  void power_on(Time now);

  // ---- The line ----

  // What a frame did that concerns the segment.
  static constexpr unsigned effect_receive_times =
      1;                                       // 0900h was written: the times of the other ports are to be latched
  static constexpr unsigned effect_marks = 2;  // the frame's source address is to be changed: processes_only()

  // A frame passes the processing unit at `now`; its datagrams are executed. Returns effects.
  unsigned process(Frame& frame, Time now);

  // A cable with a working partner at its other end.
  void set_link(unsigned port, bool link);
  bool link(unsigned port) const { return link_[port]; }
  // Frames of the slave before it get in: a link, and no closed loop at port 0.
  bool takes_frames() const { return link_[0] && !loop_closed_[0]; }
  // A closed loop turns frames back inside the controller (DL control, ETG.1000.4 table 33).
  bool loop_closed(unsigned port) const { return loop_closed_[port]; }
  // Closed because its link is gone, rather than by hand.
  bool closes_loops_itself(unsigned port) const { return (memory_[reg::dl_control + 1] >> 2 * port & 3U) < 2; }
  // A frame came to a port with its loop closed, and is lost: it opens a loop that closed because the link was gone.
  void frame_at_closed_port(unsigned port);
  // DL control bit 0: frames that are not EtherCAT are destroyed, those that are get their source address changed.
  bool processes_only() const { return (memory_[reg::dl_control] & 0x01) != 0; }
  void latch_port_time(unsigned port, Time arrival);
  // Error counters, which stop at 255.
  void count_invalid_frame(unsigned port) { increment(reg::rx_errors + 2U * port); }
  void count_forwarded_error(unsigned port) { increment(reg::forwarded_rx_errors + port); }
  void count_processing_unit_error() { increment(reg::processing_unit_errors); }

  // ---- The application's side ----

  // What wants the application: bits as in the AL event request, whether or not a mask lets them through, and this.
  static constexpr std::uint32_t attention_reset = 0x80000000;  // the controller was reset over the bus
  std::uint32_t attention() const { return attention_; }
  void settle(std::uint32_t events) { attention_ &= ~events; }
  // Is there anything for the application to do at `now`? What it has put off wants it again when it is no longer known
  // that nothing is due.
  bool calls(Time now) const { return (attention_ & ~put_off_) != 0 || (attention_ != 0 && now >= quiet_until_); }
  // Nor is anything due, by the clock: most often so, and quickly known.
  bool quiet(Time now) const { return (attention_ & ~put_off_) == 0 && now < quiet_until_; }
  // Of these bits, nothing new or old wants the application before something is due or something else wants it; in
  // place of those it put off before.
  void put_off(std::uint32_t events) { put_off_ = events; }
  // Nothing is due before, neither here nor for the application, which works that out. Any write to a register makes it
  // unknown, since it may bring something forward; so does the application.
  static constexpr Time unknown = Time::min();
  Time quiet_until() const { return quiet_until_; }
  void set_quiet_until(Time time) { quiet_until_ = time; }

  // Reading acknowledges it: the master can write the next one.
  std::uint16_t take_al_control();
  void set_al_status(std::uint16_t status, std::uint16_t code);
  std::uint16_t station_alias() const { return load_u16(&memory_[reg::station_alias]); }  // in force: 0012h
  std::uint16_t al_status() const { return load_u16(&memory_[reg::al_status]); }
  std::uint32_t al_event_request() const;

  const SyncManager& sync_manager(unsigned n) const { return sync_managers_[n]; }
  const Fmmu& fmmu(unsigned n) const { return fmmus_[n]; }
  // The buffer to be read (mailbox: empty when there is none; buffered: the newest complete one), and the one to be
  // written. Each is to be closed.
  std::span<const std::uint8_t> open_for_reading(unsigned n);
  void close_reading(unsigned n);
  std::span<std::uint8_t> open_for_writing(unsigned n);
  void close_writing(unsigned n);
  // The mailbox the master asks to have repeated is full again; acknowledges the request.
  bool repeat_requested(unsigned n) const;
  void repeat(unsigned n);
  void acknowledge_repeat(unsigned n);
  // PDI control bit 0: the application takes a channel out of use.
  void disable_sync_manager(unsigned n, bool disabled);

  DistributedClock& clock() { return clock_; }
  const DistributedClock& clock() const { return clock_; }
  SiiInterface& sii() { return sii_; }
  const Watchdog& process_data_watchdog() const { return process_data_watchdog_; }
  void pdi_alive(Time now) {
    pdi_watchdog_.check(now);
    pdi_watchdog_.trigger(now);
    quiet_until_ = unknown;
  }
  // Ends pulses that 0980h puts into the application's hands, where no master can.
  void stop_own_pulses();
  // A latch input changed (ETG.1000.4 clause 6.7.4).
  void latch_edge(unsigned unit, bool rising, Time now);

  Time now() const { return now_; }                 // of the last frame or poll
  std::uint32_t frames() const { return frames_; }  // that have passed since power-on

  // Pulses, watchdogs and delays that are due; no later than `next_deadline`. Returns bit n for SYNCn.
  unsigned poll(Time now);
  Time next_deadline(Time now) {
    const Time watchdogs = std::min(process_data_watchdog_.deadline(), pdi_watchdog_.deadline());
    return std::min(watchdogs, std::min(dl_control_until_, clock_.next_sync(now)));
  }

  // The bytes of a register as they are now, for the application and for tests.
  std::uint8_t read_byte(std::uint16_t address, Time now);
  template <typename T>
  T read_register(std::uint16_t address, Time now) {
    std::array<std::uint8_t, sizeof(T)> bytes;
    for (std::size_t i = 0; i < sizeof(T); ++i) bytes[i] = read_byte(static_cast<std::uint16_t>(address + i), now);
    return load<T>(bytes.data());
  }
  const std::uint8_t* registers(std::uint16_t address) const { return &memory_[address]; }
  // What the application may write without further ado: station alias, PDI access of the SII, pulse length...
  template <typename T>
  void write_register(std::uint16_t address, T value) {
    store(&memory_[address], value);
  }

 private:
  struct Mapping {  // an FMMU of whole bytes
    std::uint32_t logical;
    std::uint32_t length;
    std::uint16_t physical;
    std::uint8_t sync_manager;  // that holds all of it, or none
  };
  static constexpr std::uint8_t no_sync_manager = 0xFF;
  // Where both buffers lie in a datagram with all of them. Masters send the same one in every cycle.
  struct Fit {
    std::uint32_t logical = 0;   // of the datagram
    std::uint32_t length = ~0U;  // likewise; none is as long as that
    std::uint32_t outputs = 0;   // first byte in its data
    std::uint32_t inputs = 0;
    std::uint32_t events = 0;  // of the two sync managers
    SyncManager* writing = nullptr;
    SyncManager* reading = nullptr;
  };
  // The logical addresses in which both buffers lie. Beside it no datagram concerns them.
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
  bool combine_word(Datagram datagram);
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

  // What a frame of process data needs lies together: the caches are never warm when one comes.
  Time now_{0};  // of the frame or poll at work
  Time quiet_until_ = unknown;
  std::uint32_t attention_ = 0;
  std::uint32_t put_off_ = 0;  // by the application
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
  // All FMMUs are of whole bytes, no reading one touches a writing one's memory, and nothing is write-protected.
  bool whole_bytes_ = true;
  // There is one of each, and they are a whole three-buffer channel of few bytes: what most slaves are in operation.
  bool one_buffer_each_ = false;

  DistributedClock clock_;
  SiiInterface sii_;
  Watchdog pdi_watchdog_;

  bool al_control_pending_ = false;
  bool sync_active_ = false;         // 0981h bit 0, as it was acted upon
  bool latches_ports_ = false;       // the command at work, if it writes 0900h
  bool registers_unlocked_ = false;  // by 0020h in this frame
  bool memory_unlocked_ = false;     // by 0030h in this frame
  bool reset_pending_ = false;
  std::uint8_t reset_progress_ = 0;
  std::uint32_t reset_frame_ = 0;
  std::uint8_t lasting_loops_ = 0;
  Time dl_control_until_ = never;
};

}  // namespace servodrome::ethercat
