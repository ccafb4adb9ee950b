#pragma once

#include "canopen/301/emergency.hpp"
#include "canopen/device_events.hpp"

namespace servodrome::canopen {

// Error control messages of this node: boot-up, heartbeat producer (1017h), node guarding and life guarding (100Ch,
// 100Dh); CiA 301 7.2.8.2.2 and 7.2.8.3.
class ErrorControl {
 public:
  ErrorControl(Link& link, dictionary::Dictionary& dictionary, const Profile& profile)
      : link_(link), dictionary_(dictionary), profile_(profile) {}

  void configure(std::uint8_t node_id);  // after a reset
  void reconfigure();                    // after a write to one of the objects
  void boot_up();

  std::uint16_t can_id() const { return can_id_; }

  // Handles a remote frame on 700h + node-ID. Returns true if the master had been lost.
  bool guard_request(NmtState state);
  // Sends a heartbeat if it is due. Returns true if the master was lost just now.
  bool poll(NmtState state);

 private:
  bool guarding_allowed() const {
    return profile_.node_guarding == NodeGuarding::simultaneous ||
           (profile_.node_guarding == NodeGuarding::heartbeat_wins && heartbeat_time_ == Time{0});
  }
  Frame message(std::uint8_t state) const;

  Link& link_;
  dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  std::uint16_t can_id_ = 0;
  bool toggle_ = false;
  bool lost_ = false;
  Time heartbeat_time_{0};
  Time heartbeat_deadline_ = never;
  Time life_time_{0};
  Time life_deadline_ = never;
  Link::Place place_ = Link::no_place;  // place of the last heartbeat in the queue
};

}  // namespace servodrome::canopen
