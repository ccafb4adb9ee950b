// File access over EtherCAT, mail by mail. The checks write no file, because a file of any name may have an effect on
// the slave.
#include <algorithm>

#include "ethercat/slave/foe_server.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::foe_group {
namespace {

using namespace std::chrono_literals;
using ethercat::FoeError;

constexpr std::size_t header = 6;
constexpr std::uint8_t read_request = 1;
constexpr std::uint8_t data_packet = 3;
constexpr std::uint8_t acknowledgement = 4;
constexpr std::uint8_t error_answer = 5;
constexpr std::uint8_t busy_answer = 6;

MailboxClient& mailbox_of(Trial& trial) {
  trial.subject().leave_operation();
  EthercatSlave& slave = trial.subject().ethercat().slave;
  if (!slave.has_foe()) Trial::skip("it has no FoE, as its SII says");
  slave.to_pre_operational();
  return slave.mailbox();
}

std::string_view file_of(Trial& trial) {
  const std::string_view file = trial.settings().foe_file.empty() ? trial.settings().product->dialect.foe_file
                                                                  : std::string_view(trial.settings().foe_file);
  if (file.empty()) Trial::skip("no file name is known: give --foe-file");
  return file;
}

Mail mail_of(std::uint8_t operation, std::uint32_t value, std::string_view text = {}) {
  Mail mail(header + text.size());
  mail[0] = operation;
  ethercat::store_u32(&mail[2], value);
  std::copy(text.begin(), text.end(), mail.begin() + header);
  return mail;
}

std::string text_of_mail(const Mail& mail) {
  std::string text = "FoE";
  for (std::size_t i = 0; i < std::min<std::size_t>(mail.size(), 24); ++i) text += fmt::format(" {:02X}", mail[i]);
  return mail.size() > 24 ? text + " ..." : text;
}

struct Answer {
  std::optional<Mail> mail;
  std::string text;  // text of the mail, or the reason why there is none

  bool is(std::uint8_t operation, std::uint32_t value) const {
    return mail && (*mail)[0] == operation && ethercat::load_u32(&(*mail)[2]) == value;
  }
  bool is_error() const { return mail && (*mail)[0] == error_answer; }
};

// Sends the request, and repeats it while the slave answers that it is busy.
Answer ask(Trial& trial, const Mail& request) {
  MailboxClient& mailbox = mailbox_of(trial);
  const Time deadline = mailbox.master().now() + trial.settings().patience;
  try {
    while (true) {
      Mail answer = mailbox.ask(MailboxType::foe, request, 1s, [](const Mail& mail) { return mail.size() >= header; });
      if (answer[0] != busy_answer || mailbox.master().now() >= deadline) return {answer, text_of_mail(answer)};
      mailbox.master().wait(10ms);
    }
  } catch (const EthercatError& error) {
    return {std::nullopt, error.happened()};
  }
}

// Ends a transfer by an error message, which the slave does not answer.
void give_up(Trial& trial) {
  MailboxClient& mailbox = mailbox_of(trial);
  mailbox.send(MailboxType::foe, mail_of(error_answer, static_cast<std::uint32_t>(FoeError::not_defined)), 1s);
  mailbox.master().wait(20ms);
  mailbox.drain();
}

std::string text_of_code(FoeError error) { return fmt::format("error {:04X}h", static_cast<std::uint32_t>(error)); }

void unknown_file(Trial& trial, int) {
  give_up(trial);
  const Mail request = mail_of(read_request, 0, "no-such-file.xyz");
  const Answer answer = ask(trial, request);
  if (answer.is(error_answer, static_cast<std::uint32_t>(FoeError::bootstrap_only)))
    Trial::skip("it has files in bootstrap only (8008h)");
  trial.expect(answer.is(error_answer, static_cast<std::uint32_t>(FoeError::not_found)), "read of no-such-file.xyz",
               text_of_code(FoeError::not_found), answer.text);
}

void stray_packets(Trial& trial, int) {
  give_up(trial);
  for (const std::uint8_t operation : {data_packet, acknowledgement}) {
    const Mail request = mail_of(operation, 1);
    const Answer answer = ask(trial, request);
    trial.expect(answer.is_error(), text_of_mail(request) + " without a transfer", "an error", answer.text);
  }
}

void unknown_operation(Trial& trial, int) {
  give_up(trial);
  const Mail request = mail_of(9, 0);
  const Answer answer = ask(trial, request);
  trial.expect(answer.is_error(), text_of_mail(request) + " (an operation code that does not exist)", "an error",
               answer.text);
}

void reads(Trial& trial, int) {
  mailbox_of(trial);
  const std::string file(file_of(trial));
  give_up(trial);
  std::vector<std::uint8_t> content;
  try {
    content = trial.subject().ethercat().slave.foe().read(file);
    const auto again = trial.subject().ethercat().slave.foe().read(file);
    trial.expect(!content.empty() && !again.empty(), fmt::format("read of {}, twice", file), "a file, both times",
                 fmt::format("{} and {} bytes", content.size(), again.size()));
  } catch (const EthercatError& error) {
    trial.expect(false, "read of " + file, "a file", error.happened());
  }
}

void packet_number(Trial& trial, int) {
  MailboxClient& mailbox = mailbox_of(trial);
  const std::string file(file_of(trial));
  give_up(trial);
  const Answer first = ask(trial, mail_of(read_request, 0, file));
  trial.require(first.is(data_packet, 1), "read of " + file, "data packet 1", first.text);
  if (first.mail->size() < mailbox.room_in()) {
    mailbox.send(MailboxType::foe, mail_of(acknowledgement, 1), 1s);
    Trial::skip("the file is a single packet");
  }
  const Mail wrong = mail_of(acknowledgement, 7);
  const Answer answer = ask(trial, wrong);
  trial.expect(answer.is(error_answer, static_cast<std::uint32_t>(FoeError::packet_number_wrong)),
               text_of_mail(wrong) + " after data packet 1", text_of_code(FoeError::packet_number_wrong), answer.text);
  // The error has ended the transfer.
  const Mail late = mail_of(acknowledgement, 1);
  const Answer after = ask(trial, late);
  trial.expect(after.is_error(), text_of_mail(late) + " after that", "an error", after.text);
}

constexpr auto codes = "ETG.1000.6 5.8, table 93";

constexpr std::array rows{
    Check{"foe.unknown-file", codes, "A missing file gives error 8001h", Demand::nothing, buses::ethercat,
          unknown_file},
    Check{"foe.read", "ETG.1000.6 5.8", "A file that it offers can be read", Demand::nothing, buses::ethercat, reads},
    Check{"foe.packet-number", codes, "A wrong packet number gives error 8005h and ends the transfer", Demand::nothing,
          buses::ethercat, packet_number},
    Check{"foe.stray-packet", codes, "A packet without a transfer gives an error", Demand::nothing, buses::ethercat,
          stray_packets},
    Check{"foe.unknown-operation", codes, "An unknown operation gives an error", Demand::nothing, buses::ethercat,
          unknown_operation},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::foe_group
