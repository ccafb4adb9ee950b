#pragma once

#include <deque>
#include <functional>
#include <optional>

#include "ethercat/slave/mailbox_wire.hpp"
#include "master/emergency.hpp"
#include "master/ethercat/master.hpp"
#include "master/ethercat/sii_content.hpp"

namespace servodrome::master {

using ethercat::MailboxType;

// The content of a mailbox message after its header.
using Mail = std::vector<std::uint8_t>;

// Mailbox of one slave, through sync managers 0 and 1 (ETG.1000.4 clause 5.6): counters, polling, repetition of lost
// mails. Emergencies that arrive in between are stored. All calls throw EthercatError.
class MailboxClient {
 public:
  // The mailbox must be set up already. `fresh`: the slave has just gone from INIT to PREOP, which resets its counters.
  MailboxClient(EthercatMaster& master, std::uint16_t station, const MailboxAreas& areas, bool fresh)
      : master_(master), station_(station), areas_(areas), counter_(fresh ? 1 : 0), is_empty_(fresh) {}

  // Maximum size of a mail in bytes, in each direction.
  std::size_t room_out() const { return areas_.out.length - ethercat::mailbox_header_size; }
  std::size_t room_in() const { return areas_.in.length - ethercat::mailbox_header_size; }
  const MailboxAreas& areas() const { return areas_; }

  // Blocks while the slave has not yet fetched the previous mail.
  void send(MailboxType type, std::span<const std::uint8_t> mail, Time timeout);
  // Returns the next mail of the type for which `wanted` is true; other mails are late answers to abandoned requests
  // and are dropped. nullopt after the timeout. Throws if the slave reports a mailbox error.
  std::optional<Mail> receive(MailboxType type, Time timeout, const std::function<bool(const Mail&)>& wanted);
  // send() and receive(). Throws if no answer arrives in time.
  Mail ask(MailboxType type, std::span<const std::uint8_t> request, Time timeout,
           const std::function<bool(const Mail&)>& wanted);
  // Empties the mailbox: stores emergencies and drops late answers.
  void drain();

  // The last 64 emergencies, oldest first. Their node-ID is 0.
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
  // The mail in the slave's mailbox; nullopt if it is empty.
  std::optional<Letter> fetch();
  bool full(std::uint16_t sync_manager);
  bool read_area(std::vector<std::uint8_t>& bytes);
  void request_repeat();
  bool keep_emergency(const Letter& letter);
  [[noreturn]] void timed_out(const std::string& happened) const;

  EthercatMaster& master_;
  std::uint16_t station_;
  MailboxAreas areas_;
  std::uint8_t counter_;            // counter of the next mail; 0: the slave does not check it
  bool is_empty_;                   // the slave has read the last mail, because it has answered it
  bool was_repeated_ = false;       // the last mail may be in the mailbox again
  std::uint8_t last_received_ = 0;  // counter of the last mail
  bool repeat_bit_ = false;
  bool repeat_bit_known_ = false;
  std::deque<Emergency> emergencies_;
};

}  // namespace servodrome::master
