#pragma once

#include "canopen/301/emergency.hpp"
#include "canopen/301/pdo_mapping.hpp"
#include "canopen/device_events.hpp"

namespace servodrome::canopen {

// Configuration and reception state of one RPDO.
struct Rpdo {
  static constexpr std::uint16_t none = 0xFFFF;

  ResolvedMapping mapping;
  bool exists = false;
  bool valid = false;
  bool synchronous = false;
  bool pending = false;  // received, waits for SYNC
  bool too_short = false;
  bool too_long = false;
  bool timed_out = false;
  std::uint16_t can_id = 0;
  std::uint16_t next_of_same_can_id = none;
  std::uint64_t received = 0;
  Time event_time{0};  // timeout, 0: none
  Time deadline = never;
  Time length_error_end = never;  // for too_short and too_long
};

// RPDOs (CiA 301 7.2.2, objects 1400h.. and 1600h..).
class Rpdos {
 public:
  Rpdos(Link& link, dictionary::Dictionary& dictionary, const Profile& profile, Emergency& emergency,
        DeviceEvents& events, std::span<Rpdo> pdos, std::span<MappedObject> objects, std::span<std::uint16_t> pending)
      : link_(link),
        dictionary_(dictionary),
        profile_(profile),
        emergency_(emergency),
        events_(events),
        pdos_(pdos),
        objects_(objects),
        entries_(pdos.empty() ? 0 : objects.size() / pdos.size()),
        pending_(pending) {}

  std::size_t capacity() const { return pdos_.size(); }
  const Rpdo& operator[](std::size_t number) const { return pdos_[number]; }
  void link_same_can_id(std::uint16_t number, std::uint16_t next) { pdos_[number].next_of_same_can_id = next; }

  void configure();  // all of them, after a reset
  // One of them, after a write to its objects. Drops its data that wait for SYNC. Ends its timeout error if the RPDO is
  // no longer valid, or no longer has an event timer.
  void configure(std::uint16_t number);
  dictionary::AbortCode check(const dictionary::Entry& entry, std::uint32_t value) const;

  void set_operational(bool operational);

  // A frame for RPDO `number` and for all other RPDOs with the same CAN-ID.
  void receive(std::uint16_t number, const Frame& frame) {
    if (!operational_) return;
    do {
      Rpdo& pdo = pdos_[number];
      receive_one(number, pdo, frame);
      number = pdo.next_of_same_can_id;
    } while (number != Rpdo::none);
  }

  // A SYNC: writes the data received since the last one. Further synchronous RPDOs are accepted until `window_end`.
  void sync(Time window_end);
  void poll();

 private:
  void receive_one(std::uint16_t number, Rpdo& pdo, const Frame& frame);
  void tell(std::uint16_t number, std::uint64_t to_tell);
  std::span<const MappedObject> mapped(std::uint16_t number);
  void drop_pending(std::uint16_t number);
  void end_timeout(Rpdo& pdo);
  void end_length_errors();
  bool check_length(Rpdo& pdo, std::uint8_t length);
  std::span<MappedObject> objects(std::size_t number) const { return objects_.subspan(number * entries_, entries_); }

  Link& link_;
  dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  Emergency& emergency_;
  DeviceEvents& events_;
  std::span<Rpdo> pdos_;
  std::span<MappedObject> objects_;
  std::size_t entries_;  // mapping entries per PDO
  std::span<std::uint16_t> pending_;
  std::size_t pending_count_ = 0;
  bool operational_ = false;
  Time window_end_ = never;
};

}  // namespace servodrome::canopen
