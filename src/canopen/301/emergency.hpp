#pragma once

#include <array>

#include "canopen/link.hpp"
#include "canopen/profile.hpp"
#include "dictionary/dictionary.hpp"

namespace servodrome::canopen {

// Communication errors the node itself finds (CiA 301 table 26, 81xxh and 82xxh).
enum class CommunicationError : std::uint8_t {
  overrun,        // 8110h: frames were lost
  error_passive,  // 8120h
  heartbeat,      // 8130h, as life guarding is
  life_guarding,
  bus_off,         // 8140h, reported on recovery
  rpdo_too_short,  // 8210h
  rpdo_too_long,   // 8220h
  sync_length,     // 8240h
  rpdo_timeout,    // 8250h
  frame_length,    // Profile::frame_length_code
};
inline constexpr std::size_t communication_error_count = 10;

// EMCY producer (CiA 301 7.2.7) with the error register 1001h and the history 1003h.
class Emergency {
 public:
  Emergency(Link& link, dictionary::Dictionary& dictionary, const Profile& profile)
      : link_(link), dictionary_(dictionary), profile_(profile) {}

  // Power-on: no errors, empty history.
  void start();
  // After a reset: the node's own errors are gone, the device's stay until it clears them. Reads 1014h and 1015h.
  void configure(std::uint8_t node_id);
  void reconfigure();  // after a write to one of them

  // A device error appears: `bits` of 1001h are set, bit 0 in any case. The history keeps the code and vendor bytes
  // 0, 1.
  void raise(std::uint16_t code, std::uint8_t bits, const std::array<std::uint8_t, 5>& vendor);
  // A device error that an EMCY of the communication tells: its bits stay when the communication is back.
  void hold(std::uint8_t bits);
  // Device errors went: `remaining` are the bits of those still there. Sends an error-reset EMCY.
  void clear(std::uint8_t remaining, const std::array<std::uint8_t, 5>& vendor);

  // The same for the node's own errors; each begin is ended once.
  void begin(CommunicationError error, std::uint16_t code);
  void end(CommunicationError error);

  // Writes of 1003h: 0 to sub-index 0 empties the history.
  void clear_history();

  // EMCYs are sent in pre-operational and operational; what happens elsewhere waits.
  void set_allowed(bool allowed);
  void poll();

  std::uint8_t error_register() const { return error_register_; }
  bool communication_error() const;  // one of the node's own is present

 private:
  void update_register();
  bool tells_reset() const;
  void record(std::uint16_t code, const std::array<std::uint8_t, 5>& vendor);
  void queue(std::uint16_t code, const std::array<std::uint8_t, 5>& vendor);
  void send_waiting();

  Link& link_;
  dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  std::array<Frame, 8> queue_{};
  std::uint8_t queued_ = 0;
  bool allowed_ = false;
  bool valid_ = false;
  std::uint8_t node_id_ = 0;
  std::uint16_t can_id_ = 0;
  std::uint8_t device_bits_ = 0;
  std::uint8_t error_register_ = 0;
  std::array<std::uint16_t, communication_error_count> active_{};
  Time inhibit_time_{0};
  Time not_before_{0};
};

}  // namespace servodrome::canopen
