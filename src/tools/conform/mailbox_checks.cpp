// The mailbox and the SDO protocol in it, mail by mail.
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::mailbox_group {
namespace {

using namespace std::chrono_literals;
using dictionary::AbortCode;
using ethercat::CoeService;

MailboxClient& mailbox_of(Trial& trial) {
  trial.subject().leave_operation();
  EthercatSlave& slave = trial.subject().ethercat().slave;
  if (!slave.has_coe()) Trial::skip("it has no CoE");
  slave.to_pre_operational();
  return slave.mailbox();
}

std::string text_of_mail(const Mail& mail) {
  std::string text;
  for (const std::uint8_t byte : mail) text += fmt::format("{}{:02X}", text.empty() ? "" : " ", byte);
  return text;
}

// Sends the mail and expects a mailbox error with one of these codes.
void expect_mailbox_error(Trial& trial, MailboxType type, const Mail& mail, std::initializer_list<const char*> codes,
                          const char* sent) {
  MailboxClient& mailbox = mailbox_of(trial);
  std::string seen = "no answer";
  bool right = false;
  try {
    const Mail answer = mailbox.ask(type, mail, 500ms, [](const Mail&) { return true; });
    seen = "a mail " + text_of_mail(answer);
  } catch (const EthercatError& error) {
    seen = error.happened();
    for (const char* code : codes)
      right = right || seen.find(fmt::format("mailbox error {}", code)) != std::string::npos;
  }
  std::string wanted = "mailbox error";
  for (const char* code : codes) wanted += fmt::format(" {}", code);
  trial.expect(right, sent, wanted, seen);
}

void unsupported_protocol(Trial& trial, int) {
  const auto& sii = trial.subject().ethercat().slave.found().sii;
  const bool has_voe = sii.has(mailbox_protocol::voe);
  const bool has_soe = sii.has(mailbox_protocol::soe);
  if (has_voe && has_soe) Trial::skip("it has both VoE and SoE");
  const MailboxType type = has_soe ? MailboxType::voe : MailboxType::soe;
  expect_mailbox_error(trial, type, Mail{0, 0, 0, 0, 0, 0, 0, 0}, {"0002h"},
                       has_soe ? "a VoE mail, which its SII does not list" : "a SoE mail, which its SII does not list");
}

void short_mail(Trial& trial, int) {
  expect_mailbox_error(trial, MailboxType::coe, Mail{0}, {"0006h", "0008h", "0005h", "0001h"},
                       "a CoE mail of one byte, shorter than its header");
}

// Sends an SDO request with a CoE header, and returns the answer without the header.
std::optional<Mail> ask_coe(Trial& trial, const std::array<std::uint8_t, 8>& sdo) {
  Mail mail(ethercat::coe_header_size);
  ethercat::store_u16(mail.data(), static_cast<unsigned>(CoeService::sdo_request) << 12);
  mail.insert(mail.end(), sdo.begin(), sdo.end());
  MailboxClient& mailbox = mailbox_of(trial);
  mailbox.drain();
  mailbox.send(MailboxType::coe, mail, 1s);
  auto answer = mailbox.receive(MailboxType::coe, 1s,
                                [](const Mail& one) { return one.size() >= ethercat::coe_header_size + 3; });
  if (answer) answer->erase(answer->begin(), answer->begin() + ethercat::coe_header_size);
  return answer;
}

void expect_abort(Trial& trial, const std::array<std::uint8_t, 8>& sdo, AbortCode code) {
  const auto answer = ask_coe(trial, sdo);
  const bool right = answer && answer->size() >= 8 && (*answer)[0] == 0x80 &&
                     ethercat::load_u32(&(*answer)[4]) == static_cast<std::uint32_t>(code);
  trial.expect(right, "SDO " + text_of_mail(Mail(sdo.begin(), sdo.end())), "abort " + text_of(code),
               answer ? "SDO " + text_of_mail(*answer) : "no answer");
}

void unknown_command(Trial& trial, int) {
  expect_abort(trial, {0xE0, 0x00, 0x10, 0x00, 0, 0, 0, 0}, AbortCode::command_specifier_unknown);
}

void stray_segment(Trial& trial, int) {
  expect_abort(trial, {0x60, 0, 0, 0, 0, 0, 0, 0}, AbortCode::command_specifier_unknown);
}

constexpr std::array rows{
    Check{"mailbox.unsupported-protocol", "ETG.1000.4 5.6, table 30", "An unsupported protocol is refused with 0002h",
          Demand::nothing, buses::ethercat, unsupported_protocol},
    Check{"mailbox.short-mail", "ETG.1000.4 5.6, table 30", "A mail shorter than its header gives a mailbox error",
          Demand::nothing, buses::ethercat, short_mail},
    Check{"mailbox.unknown-sdo-command", "ETG.1000.6 table 41", "An unknown command is refused with 0504 0001h",
          Demand::nothing, buses::ethercat, unknown_command},
    Check{"mailbox.stray-segment", "ETG.1000.6 table 41", "A segment without a transfer is refused with 0504 0001h",
          Demand::nothing, buses::ethercat, stray_segment},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::mailbox_group
