#pragma once

#include <deque>
#include <functional>
#include <optional>

#include "ethercat/slave/mailbox_wire.hpp"
#include "host/emergency.hpp"
#include "host/ethercat/master.hpp"
#include "host/ethercat/sii_content.hpp"

namespace servodrome::host {

using ethercat::MailboxType;

// What travels in a mailbox behind its header.
using Mail = std::vector<std::uint8_t>;

// The mailbox of one slave, sync managers 0 and 1 (ETG.1000.4 clause 5.6): counters, polling, repetition of what was
// lost. Emergencies that come between are kept. All calls throw EthercatError.
class MailboxClient {
 public:
  // The mailbox is set up already. `fresh`: by INIT to PREOP, so its counters start anew.
  MailboxClient(EthercatMaster& master, std::uint16_t station, const MailboxAreas& areas, bool fresh)
      : master_(master), station_(station), areas_(areas), counter_(fresh ? 1 : 0) {}

  // Bytes of a mail, each way.
  std::size_t room_out() const { return areas_.out.length - ethercat::mailbox_header_size; }
  std::size_t room_in() const { return areas_.in.length - ethercat::mailbox_header_size; }
  const MailboxAreas& areas() const { return areas_; }

  // Waits while the slave has not fetched the last one.
  void send(MailboxType type, std::span<const std::uint8_t> mail, Time timeout);
  // The next mail of the type that `wanted` is true for; others are dropped, since they answer what was given up. A
  // mailbox error throws. Nothing: none came in time.
  std::optional<Mail> receive(MailboxType type, Time timeout, const std::function<bool(const Mail&)>& wanted);
  // Both. Throws if no answer comes.
  Mail ask(MailboxType type, std::span<const std::uint8_t> request, Time timeout,
           const std::function<bool(const Mail&)>& wanted);
  // Fetches what waits in the mailbox: emergencies, and late answers, which are dropped.
  void drain();

  // In the order they came, the last 64. Node-ID 0.
  const std::deque<Emergency>& emergencies() const { return emergencies_; }
  void forget_emergencies() { emergencies_.clear(); }

  EthercatMaster& master() { return master_; }
  std::uint16_t station() const { return station_; }
  std::string where() const { return slave_text(master_, station_); }

 private:
  struct Letter {
    MailboxType type;
    Mail mail;
  };
  // The letter that waits in the mailbox, if there is one.
  std::optional<Letter> fetch();
  bool full(std::uint16_t sync_manager);
  bool read_area(std::vector<std::uint8_t>& bytes);
  void request_repeat();
  bool keep_emergency(const Letter& letter);
  [[noreturn]] void timed_out(const std::string& happened) const;

  EthercatMaster& master_;
  std::uint16_t station_;
  MailboxAreas areas_;
  std::uint8_t counter_;            // of the next mail; 0: the slave does not check
  std::uint8_t last_received_ = 0;  // counter
  bool repeat_bit_ = false;
  bool repeat_bit_known_ = false;
  std::deque<Emergency> emergencies_;
};

}  // namespace servodrome::host
