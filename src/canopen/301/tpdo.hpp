#pragma once

#include "canopen/301/pdo_mapping.hpp"
#include "canopen/link.hpp"

namespace servodrome::canopen {

// Configuration and transmission state of one TPDO.
struct Tpdo {
  ResolvedMapping mapping;
  bool exists = false;
  bool valid = false;
  bool remote_allowed = false;  // bit 30 of the COB-ID is 0
  bool on_change = false;       // asynchronous, sent when its data change
  bool waiting = false;         // due, but held back by the inhibit time or a full queue
  std::uint8_t type = 0;
  std::uint8_t sync_start_value = 0;
  std::uint8_t syncs_left = 0;  // until a cyclic synchronous TPDO is sent
  bool awaits_sync_start = false;
  std::uint16_t can_id = 0;
  Link::Place place = Link::no_place;  // place of its frame in the transmit queue
  std::uint64_t data = 0;              // last data sent or, for type 252, last sampled
  std::uint64_t change_mask = ~std::uint64_t{0};
  Time inhibit_time{0};
  Time not_before{0};
  Time event_time{0};
  Time event_deadline = never;
};

// TPDOs (CiA 301 7.2.2, objects 1800h.. and 1A00h..).
class Tpdos {
 public:
  Tpdos(Link& link, dictionary::Dictionary& dictionary, const Profile& profile, std::span<Tpdo> pdos,
        std::span<MappedObject> objects, std::span<std::uint16_t> synchronous, std::span<std::uint16_t> event_driven)
      : link_(link),
        dictionary_(dictionary),
        profile_(profile),
        pdos_(pdos),
        objects_(objects),
        entries_(pdos.empty() ? 0 : objects.size() / pdos.size()),
        synchronous_(synchronous),
        event_driven_(event_driven) {}

  std::size_t capacity() const { return pdos_.size(); }
  const Tpdo& operator[](std::size_t number) const { return pdos_[number]; }

  void configure();  // all of them, after a reset
  void configure(std::uint16_t number);
  dictionary::AbortCode check(const dictionary::Entry& entry, std::uint32_t value) const;
  void set_change_mask(std::uint16_t number, std::uint64_t mask) { pdos_[number].change_mask = mask; }

  void set_operational(bool operational);
  // Bus-off: discards all waiting frames; TPDOs sent by event become due again.
  void bus_off();

  // Process data may have changed: sends asynchronous TPDOs whose data have changed, and updates the data of
  // asynchronous TPDOs that still wait for the bus.
  void process_image_updated() {
    if (operational_ && event_driven_count_ != 0) update_event_driven();
  }
  // An application event: sends the TPDO even if it has not changed (types 254, 255 at once, type 0 at the next SYNC).
  void trigger(std::uint16_t number);
  void sync(std::uint8_t counter);
  void remote_request(std::uint32_t can_id);
  void poll();

 private:
  std::uint64_t pack_data(std::size_t number, const Tpdo& pdo) const {
    return pack(dictionary_, std::span<const MappedObject>(objects(number)).first(pdo.mapping.count));
  }
  // The inhibit time has passed, or the last frame still waits and can be updated.
  bool may_send(const Tpdo& pdo) const { return link_.now() >= pdo.not_before || link_.waits(pdo.place); }
  void hold(Tpdo& pdo) {
    pdo.waiting = true;
    link_.wake_at(pdo.not_before);
  }
  void send(Tpdo& pdo, std::uint64_t data);
  void send_when_allowed(std::uint16_t number, Tpdo& pdo);
  void update_event_driven();
  void rebuild_lists();
  std::span<MappedObject> objects(std::size_t number) const { return objects_.subspan(number * entries_, entries_); }

  Link& link_;
  dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  std::span<Tpdo> pdos_;
  std::span<MappedObject> objects_;
  std::size_t entries_;                    // mapping entries per PDO
  std::span<std::uint16_t> synchronous_;   // numbers of the TPDOs that react to a SYNC
  std::span<std::uint16_t> event_driven_;  // numbers of the asynchronous TPDOs
  std::size_t synchronous_count_ = 0;
  std::size_t event_driven_count_ = 0;
  bool operational_ = false;
};

}  // namespace servodrome::canopen
