#pragma once

#include <array>

#include "canopen/link.hpp"
#include "canopen/profile.hpp"
#include "dictionary/dictionary.hpp"

namespace servodrome::canopen {

// Communication errors that the node itself detects (CiA 301 table 26, 81xxh and 82xxh).
enum class CommunicationError : std::uint8_t {
  overrun,        // 8110h: frames were lost
  error_passive,  // 8120h
  heartbeat,      // 8130h, also for life guarding
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
  // After a reset: clears the node's own errors; device errors stay until the device clears them. Reads 1014h and
  // 1015h.
  void configure(std::uint8_t node_id);
  void reconfigure();  // after a write to 1014h or 1015h

  // Reports a device error: sets `bits` of 1001h, and bit 0 in any case. The history stores the code and vendor bytes
  // 0, 1.
  void raise(std::uint16_t code, std::uint8_t bits, const std::array<std::uint8_t, 5>& vendor);
  // Sets bits of 1001h for a device error without an EMCY of its own, because the node has already sent one for the
  // communication error. The bits stay when the communication is restored.
  void hold(std::uint8_t bits);
  // Device errors have ended; `remaining` are the bits of 1001h of those that are still active. Sends EMCY 0000h if the
  // profile requires it.
  void clear(std::uint8_t remaining, const std::array<std::uint8_t, 5>& vendor);

  // The start and the end of one of the node's own errors; call end() once for each begin().
  void begin(CommunicationError error, std::uint16_t code);
  void end(CommunicationError error);

  // For writes of 1003h: writing 0 to sub-index 0 clears the history.
  void clear_history();

  // EMCYs are sent only in pre-operational and operational; in other states they wait in the queue.
  void set_allowed(bool allowed);
  void poll();

  std::uint8_t error_register() const { return error_register_; }
  bool communication_error() const;  // one of the node's own errors is active

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
