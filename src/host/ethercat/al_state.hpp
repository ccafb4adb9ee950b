#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "ethercat/slave/al_status.hpp"
#include "host/ethercat/master.hpp"

namespace servodrome::host {

using ethercat::AlState;
using ethercat::AlStatusCode;

// What a slave says of its state: registers 0130h and 0134h (ETG.1000.6 clause 6.4.1).
struct AlStatus {
  std::uint16_t status = 0;
  AlStatusCode code = AlStatusCode::none;

  AlState state() const { return static_cast<AlState>(status & 0x0F); }
  bool error() const { return (status & 0x10) != 0; }
};

// "INIT", "PREOP", "BOOT", "SAFEOP", "OP": as tools have it.
const char* short_name(AlState state);
// The reverse, in any case; nothing if it is none.
std::optional<AlState> parse_al_state(std::string_view word);
// "SAFEOP with error 001Bh sync manager watchdog"
std::string text_of(const AlStatus& status);
// What to do about an AL status code (ETG.1020 table 11).
const char* remedy_of(AlStatusCode code);

AlStatus read_al_status(EthercatMaster& master, std::uint16_t station);

// Writes AL control and waits until the slave is there; an error that stands is acknowledged first. Only steps that the
// state machine has are taken by a slave: see EthercatSlave for the ways between. Throws EthercatError with the AL
// status code and its remedy.
void request_state(EthercatMaster& master, std::uint16_t station, AlState state, Time timeout);
// The error bit goes, the state stays.
void acknowledge_error(EthercatMaster& master, std::uint16_t station, Time timeout);

// ETG.1020 clause 15 and ETG.2000: how long a slave may take, unless its ESI says otherwise.
constexpr Time state_timeout(AlState to) {
  using namespace std::chrono_literals;
  return to == AlState::safe_operational || to == AlState::operational ? Time{10s} : Time{5s};
}

}  // namespace servodrome::host
