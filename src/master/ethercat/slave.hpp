#pragma once

#include "master/ethercat/coe_client.hpp"
#include "master/ethercat/foe_client.hpp"
#include "master/ethercat/scan.hpp"

namespace servodrome::master {

// One slave of a segment: its states and, if it has a mailbox, its services. All calls throw EthercatError.
class EthercatSlave {
 public:
  // `timeout`: for each mailbox answer.
  EthercatSlave(EthercatMaster& master, FoundSlave found, Time timeout = std::chrono::seconds(1))
      : master_(master), found_(std::move(found)), timeout_(timeout) {}
  EthercatSlave(const EthercatSlave&) = delete;
  EthercatSlave& operator=(const EthercatSlave&) = delete;

  const FoundSlave& found() const { return found_; }
  std::uint16_t station() const { return found_.station; }
  EthercatMaster& master() { return master_; }
  // For example "udp:127.0.0.1:34980, slave 3 (IHSV57-EC)".
  std::string where() const;

  AlStatus status() { return read_al_status(master_, station()); }
  void request(AlState state) { request_state(master_, station(), state, state_timeout(state)); }

  // Goes to INIT and switches sync managers, FMMUs and SYNC off.
  void to_init();
  // From any state. Coming from INIT, the mailbox is set up with the values of the SII.
  void to_pre_operational();
  void to_bootstrap();

  bool has_mailbox() const { return found_.sii.mailbox.out.length != 0 && found_.sii.mailbox.in.length != 0; }
  bool has_coe() const { return has_mailbox() && found_.sii.has(mailbox_protocol::coe); }
  bool has_foe() const { return has_mailbox() && found_.sii.has(mailbox_protocol::foe); }
  // Uses a mailbox that another program has set up as it is. Brings the slave to PREOP first if it is in INIT, and from
  // any other state through INIT if its sync managers 0 and 1 are not a mailbox.
  MailboxClient& mailbox();
  CoeClient& coe();
  FoeClient& foe();
  // As ObjectClient::limit_wait(), for the SDOs over an open mailbox.
  void limit_wait(std::optional<Time> longest) {
    if (coe_) coe_->limit_wait(longest);
  }

 private:
  void set_up_mailbox(const MailboxAreas& areas, std::uint8_t out_control, std::uint8_t in_control);
  void check_lengths(const MailboxAreas& areas) const;
  void open_mailbox(const MailboxAreas& areas, bool fresh);
  void close_mailbox();
  std::optional<MailboxAreas> areas_in_use();
  [[noreturn]] void lacks(const char* what, const char* remedy) const;

  EthercatMaster& master_;
  FoundSlave found_;
  Time timeout_;
  std::optional<MailboxClient> mailbox_;
  std::optional<CoeClient> coe_;
  std::optional<FoeClient> foe_;
};

}  // namespace servodrome::master
