#pragma once

#include "canopen/301/emergency.hpp"
#include "canopen/301/error_control.hpp"
#include "canopen/301/heartbeat_consumer.hpp"
#include "canopen/301/rpdo.hpp"
#include "canopen/301/sdo_server.hpp"
#include "canopen/301/sync.hpp"
#include "canopen/301/tpdo.hpp"
#include "canopen/305/lss_slave.hpp"
#include "canopen/device_events.hpp"
#include "canopen/node_storage.hpp"

namespace servodrome::canopen {

// A CANopen device: the caller passes frames and the time in and takes frames out. The node accesses the device through
// its dictionary (as listener of Owner::communication) and DeviceEvents. It uses no heap, clock or thread.
//
// Usage: load the objects and call start(). Then call receive() for every frame of the bus, poll() no later than
// next_deadline(), and after each of these calls take() until it returns false. Times must not decrease.
//
// The arguments of the constructor are not copied and must outlive the node.
class Node final : private dictionary::Listener {
 public:
  Node(dictionary::Dictionary& dictionary, const Profile& profile, DeviceEvents& events, const NodeMemory& memory);
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  // Power-on; the objects must hold their saved values. 1..127, or 255: no node-ID, the node waits for LSS.
  void start(std::uint8_t node_id, Time now);

  void receive(const Frame& frame, Time now);
  // Handles what is due. Costs one comparison if nothing is due.
  void poll(Time now) {
    link_.set_now(now);
    if (now >= link_.wake()) run_due();
  }
  // Time at which poll() must be called; may be early, never late. canopen::never: no deadline.
  Time next_deadline() const { return link_.wake(); }
  // Takes the next frame to send. Returns false if there is none.
  bool take(Frame& frame) {
    const WaitingFrame* next = next_frame();
    if (next == nullptr) return false;
    frame = next->frame;
    link_.pop();
    return true;
  }
  // The same for a CAN controller that can replace a frame until its transmission begins. Call it again after each call
  // of the node, because the frame may have newer data or be dropped, and report the sent frame with frame_sent().
  const WaitingFrame* next_frame() {
    const WaitingFrame* next = link_.next();
    return next != nullptr || link_.muted() || !produce() ? next : link_.next();
  }
  void frame_sent(const Frame& frame) { link_.sent(frame); }

  NmtState nmt_state() const { return state_; }
  std::uint8_t node_id() const { return node_id_; }
  // Sets the node-ID for the next reset communication, as LSS "configure node-ID" or an object of the device does.
  void set_pending_node_id(std::uint8_t node_id) { lss_.set_pending_node_id(node_id); }

  // The device calls this once per position-loop cycle, when process data may have changed. The data of TPDOs that are
  // sent on change are compared with the data sent last.
  void process_image_updated(Time now) {
    link_.set_now(now);
    tpdos_.process_image_updated();
  }
  // Sends TPDO `number` (0 is the first) even if its data have not changed; types 254 and 255 at once, type 0 at the
  // next SYNC.
  void trigger_tpdo(std::uint16_t number, Time now) {
    link_.set_now(now);
    tpdos_.trigger(number);
  }
  // Bits of the TPDO's data (bit 0 is bit 0 of byte 0) whose change counts.
  void set_tpdo_change_mask(std::uint16_t number, std::uint64_t mask) { tpdos_.set_change_mask(number, mask); }

  // Reports a device error: sends an EMCY, sets `error_register_bits` of 1001h, and adds it to the history 1003h.
  void raise(std::uint16_t code, std::uint8_t error_register_bits, const std::array<std::uint8_t, 5>& vendor = {}) {
    emergency_.raise(code, error_register_bits, vendor);
  }
  // Sets bits of 1001h for a device error for which the node has already sent its own EMCY; they stay until cleared.
  void hold(std::uint8_t error_register_bits) { emergency_.hold(error_register_bits); }
  // Device errors have ended; `remaining` are the bits of 1001h of those that are still active. Sends EMCY 0000h if the
  // profile requires it.
  void clear(std::uint8_t remaining = 0, const std::array<std::uint8_t, 5>& vendor = {}) {
    emergency_.clear(remaining, vendor);
  }
  std::uint8_t error_register() const { return emergency_.error_register(); }
  // Returns true if one of the errors is active that the node itself detects (CiA 301 table 26, 81xxh and 82xxh).
  bool communication_error() const { return emergency_.communication_error(); }

  // State of the CAN controller's fault confinement. Bus-off is a communication error; EMCY 8140h follows on recovery.
  void bus_state(BusState state, Time now);
  BusState bus_state() const { return bus_state_; }

 private:
  enum class Service : std::uint8_t { none, nmt, sync, time, sdo, heartbeat, emergency, lss, rpdo };

  // dictionary::Listener for the objects 1000h..1FFFh.
  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override;
  void written(const dictionary::Entry& entry) override;

  void run_due();
  bool produce();
  void receive_remote(const Frame& frame);
  void receive_nmt(const Frame& frame);
  void receive_time(const Frame& frame);
  void receive_heartbeat(std::uint8_t consumer, const Frame& frame);
  void receive_emergency(std::uint8_t consumer, const Frame& frame);
  void act_on_sync(std::uint8_t counter);
  void reset(NmtCommand command);
  void configure();
  void boot();
  void set_state(NmtState state);
  void communication_lost(LossCause cause, CommunicationError error);
  void communication_restored(LossCause cause, CommunicationError error);
  void check_length(const Frame& frame, std::uint8_t expected);
  dictionary::AbortCode check_signature(const dictionary::Entry& entry, std::uint32_t value);
  dictionary::AbortCode check_general(const dictionary::Entry& entry, std::uint32_t value) const;

  void rebuild_dispatch();
  void dispatch(std::uint32_t can_id, Service service, unsigned number = 0);
  bool services_allowed() const { return state_ == NmtState::operational || state_ == NmtState::pre_operational; }

  dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  DeviceEvents& events_;
  Link link_;
  Emergency emergency_;
  Rpdos rpdos_;
  Tpdos tpdos_;
  Sync sync_;
  SdoServer sdo_;
  ErrorControl error_control_;
  HeartbeatConsumers heartbeat_consumers_;
  LssSlave lss_;
  NmtState state_ = NmtState::initialising;
  BusState bus_state_ = BusState::error_active;
  std::uint8_t node_id_ = unconfigured_node_id;
  std::array<std::uint16_t, 2048> dispatch_{};  // by CAN-ID: service << 12 | number
};

}  // namespace servodrome::canopen
