#pragma once

#include <algorithm>
#include <optional>

#include "dictionary/dictionary.hpp"
#include "ethercat/esc/esc.hpp"
#include "ethercat/slave/communication_objects.hpp"
#include "ethercat/slave/foe_server.hpp"
#include "ethercat/slave/mailbox.hpp"
#include "ethercat/slave/process_image.hpp"
#include "ethercat/slave/sdo_information.hpp"
#include "ethercat/slave/sdo_server.hpp"
#include "ethercat/slave/slave_events.hpp"
#include "ethercat/slave/slave_interposer.hpp"

namespace servodrome::ethercat {

// Memory that a slave uses; see SlaveStorage.
struct SlaveMemory {
  std::span<MappedObject> outputs;
  std::span<MappedObject> inputs;
  std::span<std::byte> sdo;
  std::span<std::uint8_t> mailbox_waiting;
  std::span<std::uint8_t> mailbox_last;
};

template <std::size_t MappedObjects, std::size_t MailboxBytes, std::size_t SdoBytes>
struct SlaveStorage {
  std::array<MappedObject, MappedObjects> outputs{};
  std::array<MappedObject, MappedObjects> inputs{};
  std::array<std::byte, SdoBytes> sdo{};
  std::array<std::uint8_t, MailboxBytes> mailbox_waiting{};
  std::array<std::uint8_t, MailboxBytes> mailbox_last{};

  SlaveMemory memory() { return {outputs, inputs, sdo, mailbox_waiting, mailbox_last}; }
};

// The application side of an EtherCAT slave: state machine, mailbox with CoE, process data, synchronisation
// (ETG.1000.6, ETG.1020). It accesses the device only through its dictionary, `SlaveEvents` and a `Profile`.
class Slave final : dictionary::Listener {
 public:
  Slave(Esc& esc, dictionary::Dictionary& dictionary, const Profile& profile, SlaveEvents& events, SlaveMemory memory);

  // Enables FoE. The files must outlive the slave.
  void set_files(FoeFiles* files) { foe_.set_files(files); }

  // Call it after the controller's power-on. The dictionary must hold default or saved values.
  void start(Time now);

  // Call it after every frame, and no later than `next_deadline`.
  void poll(Time now);
  // Returns true if `poll` has something to do after a frame. Saves calls for a caller with many slaves.
  bool wants_poll(Time now) const { return esc_.calls(now); }
  Time next_deadline(Time now) {
    const Time own = std::min(operational_until_, std::min(shifted_at_, sampled_at_));
    const Time due = std::min(own, esc_.next_deadline(now));
    esc_.set_quiet_until(due);
    return due;
  }
  Time next_deadline() { return next_deadline(esc_.now()); }
  // A cached lower bound of `next_deadline`.
  Time quiet_until() const { return esc_.quiet_until(); }

  // Switches on the sampling of process data: as in an application that polls its inputs, a frame's process data are
  // handled at the next multiple of `cycle`, not at once. If frames come closer together than 1C32h:05, their data are
  // handled just before each control cycle. All other events are handled at once, together with the process data that
  // came before them. Sampling saves time, and changes results, only for frames closer together than `cycle`. 0
  // switches it off.
  void sample_process_data_every(Time cycle) {
    sampling_cycle_ = cycle;
    esc_.set_quiet_until(Esc::unknown);
  }
  // Returns true if only process data that wait for sampling have come and nothing else is due. Then `poll` does
  // nothing.
  bool puts_off(Time now);

  // Call it after each control cycle of the device, when the objects have new values. In free run, where no bus signal
  // triggers the copying, and after frames that came too fast for sampling, it copies them into the inputs. The time
  // between two calls is taken as the length of the next control cycle.
  void process_image_updated(Time now);

  AlState state() const { return state_; }
  AlStatusCode status_code() const { return code_; }
  bool error() const { return error_; }

  // For a device that cannot keep its state: falls back to `state` with `code`. With the present state, only the code
  // is shown. Returns false, and does nothing, if `state` is above the present one or cannot be reached from it
  // (ETG.1000.6 table 102).
  bool fall_back(AlState state, AlStatusCode code, Time now);

  // Sends an emergency (ETG.1000.6 clause 5.6.4) if the mailbox is active. Up to 8 wait until the master reads them.
  void emergency(std::uint16_t error_code, std::uint8_t error_register, const std::array<std::uint8_t, 5>& data);

  // ---- Misbehaviour on purpose ----

  // Sets the interposer; nullptr: none. It must outlive the slave or be removed. A message that the previous interposer
  // held stays held.
  void interpose(SlaveInterposer* interposer) {
    interposer_ = interposer;
    mailbox_.interpose(interposer);
  }
  // Puts a message that the slave did not make into the mailbox. The message includes its 6 bytes of header and is not
  // longer than the mailbox. `numbered`: the slave's next counter replaces the one in the header. The message comes
  // before those that wait or are held, and is not repeated on request. Returns false if the message does not fit, or
  // if the mailbox is full or not active.
  bool post(std::span<const std::uint8_t> message, bool numbered = true) {
    return mailbox_runs() && mailbox_.post(message, numbered);
  }
  // Sends the message that the interposer holds, and calls the interposer again for a message that it kept in the
  // mailbox.
  void release_mail();

 private:
  struct Emergency {
    std::uint16_t code;
    std::uint8_t error_register;
    std::array<std::uint8_t, 5> data;
  };
  // events of both process data channels
  static constexpr std::uint32_t process_data_events = 3U * (reg::al_event::sync_manager0 << 2);
  // 1C32h sub-index 1.
  enum class SyncType : std::uint16_t { free_run = 0, sync_manager = 1, dc_sync0 = 2, dc_sync1 = 3 };

  void reset_mailbox();

  // state_machine.cpp
  void al_control_written(Time now);
  AlStatusCode change_state(AlState to, Time now);
  AlStatusCode check_transition(AlState to);
  AlStatusCode check_mailbox(const AreaRule& out, const AreaRule& in, AlStatusCode failure) const;
  AlStatusCode check_process_data_channels() const;
  AlStatusCode check_process_data();
  void enter(AlState to, AlStatusCode cause, Time now);
  void report();
  void refuse(AlStatusCode code);
  void open_process_data(bool outputs, bool inputs);
  void hold_process_data_back();
  void await_operational(Time now);
  void follow_configuration(Time now);

  // synchronisation.cpp
  AlStatusCode choose_synchronisation();
  void start_exchange();
  void outputs_arrived(Time now);
  void sync0_came(Time now);
  void sync0_arrived(Time now);
  void miss_sync0(Time now);
  void exchange_shifted(Time now);
  void exchange_event(std::uint16_t index, Time now);
  void measure_cycle(Time now);
  void cycle_measurement_written(unsigned command);
  void take_outputs(Time now);
  void give_inputs();
  void count_missed(Time now);
  void count(std::uint16_t index, std::uint8_t counter);
  bool stays_with_sync_errors() const;
  void show_sync_error(bool error);
  void show_synchronisation();
  void forget_synchronisation();
  void set_sync_parameter(std::uint16_t index, std::uint8_t sub, std::int64_t value);
  void set_sync_parameter(std::uint8_t sub, std::int64_t value);  // in both 1C32h and 1C33h

  // mailbox
  void serve_mailbox();
  void serve_letters();
  void serve(const Mailbox::Request& request, Message& reply);
  void serve_coe(const Mailbox::Request& request, Message& reply);

  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override;
  void written(const dictionary::Entry& entry) override;

  bool mailbox_runs() const { return state_ != AlState::init; }
  bool inputs_run() const { return state_ == AlState::safe_operational || state_ == AlState::operational; }

  Esc& esc_;
  dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  SlaveEvents& events_;
  SlaveInterposer* interposer_ = nullptr;
  Mailbox mailbox_;
  SdoServer sdo_;
  SdoInformation information_;
  FoeServer foe_;
  ProcessImage outputs_;
  ProcessImage inputs_;

  AlState state_ = AlState::init;
  bool error_ = false;
  bool identifies_ = false;  // the master requested the identification value
  AlStatusCode code_ = AlStatusCode::none;
  Time operational_until_ = never;  // deadline for outputs and SYNC0

  SyncType sync_type_ = SyncType::free_run;     // synchronisation in use
  std::optional<SyncType> wanted_sync_type_{};  // what the master wrote to 1C32h:01 since Init
  bool serves_mailbox_ = false;
  bool outputs_seen_ = false;   // since Safe-Operational
  bool outputs_fresh_ = false;  // since the last SYNC0
  bool sync_seen_ = false;      // since Safe-Operational
  std::uint32_t missed_ = 0;    // 10F1h: +3 for a cycle without outputs, -1 for a cycle with outputs

  // 1C32h:03 and 1C33h:03: delay from SYNC0 until the outputs become valid and the inputs are sampled.
  Time output_shift_{0};
  Time input_shift_{0};
  Time outputs_at_ = never;  // when the delayed outputs become valid
  Time inputs_at_ = never;
  Time late_sync0_at_ = never;  // when the application sees a pulse that the interposer delayed
  unsigned late_pulses_ = 0;    // how often it then sees the pulse
  Time shifted_at_ = never;     // the earliest of the three
  Time last_sync0_ = never;     // when the application saw the last pulse

  Time sampling_cycle_{0};
  Time sampled_at_ = never;  // when the waiting process data are handled
  bool overrun_ = false;     // frames come too fast for sampling: handle them before the next control cycle
  Time loop_at_ = never;     // time of the last control cycle
  Time loop_{0};             // time between two control cycles; 0: unknown

  bool sync_error_ = false;      // 1C32h:20
  bool measures_cycle_ = false;  // 1C32h:08
  Time last_event_ = never;      // last event that timed the exchange, in Operational
  Time last_exchange_ = never;   // last sync manager event since the measurement began
  Time shortest_cycle_ = never;

  std::array<Emergency, 8> emergencies_{};
  std::size_t emergency_count_ = 0;
};

}  // namespace servodrome::ethercat
