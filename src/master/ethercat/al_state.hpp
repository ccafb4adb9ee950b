#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "ethercat/slave/al_status.hpp"
#include "master/ethercat/master.hpp"

namespace servodrome::master {

using ethercat::AlState;
using ethercat::AlStatusCode;

// The AL state of a slave: registers 0130h and 0134h (ETG.1000.6 clause 6.4.1).
struct AlStatus {
  std::uint16_t status = 0;
  AlStatusCode code = AlStatusCode::none;

  AlState state() const { return static_cast<AlState>(status & 0x0F); }
  bool error() const { return (status & 0x10) != 0; }
};

// "INIT", "PREOP", "BOOT", "SAFEOP" or "OP", as other tools abbreviate them.
const char* short_name(AlState state);
// The reverse, case-insensitive; nullopt for any other word.
std::optional<AlState> parse_al_state(std::string_view word);
// For example "SAFEOP with error 001Bh sync manager watchdog".
std::string text_of(const AlStatus& status);
// The remedy for an AL status code (ETG.1020 table 11).
const char* remedy_of(AlStatusCode code);

// True for the codes of a slave that has not seen process data or SYNC0 in time. While the cycle runs, the same request
// may succeed a moment later.
bool is_transient(AlStatusCode code);

AlStatus read_al_status(EthercatMaster& master, std::uint16_t station);

// Acknowledges a pending error, writes AL control and waits until the slave has reached the state. The slave accepts
// only transitions of its state machine; EthercatSlave goes through the states in between. Throws EthercatError with
// the AL status code and its remedy.
void request_state(EthercatMaster& master, std::uint16_t station, AlState state, Time timeout);
// Clears the error bit; the state does not change.
void acknowledge_error(EthercatMaster& master, std::uint16_t station, Time timeout);

// Timeout of a state transition by ETG.1020 clause 15 and ETG.2000; an ESI file may define another.
constexpr Time state_timeout(AlState to) {
  using namespace std::chrono_literals;
  return to == AlState::safe_operational || to == AlState::operational ? Time{10s} : Time{5s};
}

}  // namespace servodrome::master
