#include "master/ethercat/foe_client.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "ethercat/slave/foe_server.hpp"

namespace servodrome::master {

using ethercat::FoeError;
using ethercat::load_u32;

namespace {

// Header (ETG.1000.6 table 86): operation, reserved, then 4 bytes of password, packet number, error code or progress.
constexpr std::size_t foe_header_size = 6;
constexpr std::uint8_t read_request = 1;
constexpr std::uint8_t write_request = 2;
constexpr std::uint8_t data_packet = 3;
constexpr std::uint8_t acknowledgement = 4;
constexpr std::uint8_t foe_error = 5;
constexpr std::uint8_t busy_answer = 6;

constexpr Time busy_interval = std::chrono::milliseconds(10);
constexpr std::size_t largest_file = std::size_t{256} << 20;

template <typename Bytes = std::span<const std::uint8_t>>
Mail mail_of(std::uint8_t operation, std::uint32_t value, const Bytes& data = {}) {
  Mail mail(foe_header_size + data.size());
  mail[0] = operation;
  ethercat::store_u32(&mail[2], value);
  std::copy(data.begin(), data.end(), mail.begin() + foe_header_size);
  return mail;
}

const char* text(FoeError error) {
  switch (error) {
    case FoeError::none:
    case FoeError::not_defined: return "not defined";
    case FoeError::not_found: return "file not found";
    case FoeError::access_denied: return "access denied";
    case FoeError::disk_full: return "disk full";
    case FoeError::illegal: return "illegal";
    case FoeError::packet_number_wrong: return "packet number wrong";
    case FoeError::already_exists: return "file exists already";
    case FoeError::no_user: return "no user";
    case FoeError::bootstrap_only: return "in Bootstrap only";
    case FoeError::not_in_bootstrap: return "not in Bootstrap";
    case FoeError::no_rights: return "no rights";
    case FoeError::program_error: return "program error";
  }
  return "unknown error";
}

const char* remedy_of(FoeError error) {
  switch (error) {
    case FoeError::not_found: return "check the name of the file in the slave's manual";
    case FoeError::access_denied:
    case FoeError::no_user:
    case FoeError::no_rights: return "check the password and whether the file can be accessed this way";
    case FoeError::bootstrap_only: return "take the slave to BOOT first";
    case FoeError::not_in_bootstrap: return "take the slave from BOOT to PREOP first";
    case FoeError::disk_full: return "the file is too long for the slave";
    default: return "see the slave's manual, and try again";
  }
}

}  // namespace

void FoeClient::fail(std::string_view file, const std::string& happened, const std::string& remedy) {
  throw EthercatError(EthercatError::Kind::refused, happened, fmt::format("{}, file {}", mailbox_.where(), file),
                      remedy);
}

// Sends the request, and repeats it while the slave answers that it is busy.
Mail FoeClient::ask(std::span<const std::uint8_t> request, std::string_view file) {
  const Time deadline = mailbox_.master().now() + timeout_;
  while (true) {
    Mail answer = mailbox_.ask(MailboxType::foe, request, timeout_,
                               [](const Mail& mail) { return mail.size() >= foe_header_size; });
    if (answer[0] == foe_error) {
      const auto error = static_cast<FoeError>(load_u32(&answer[2]));
      const std::string words(answer.begin() + foe_header_size, answer.end());
      fail(file,
           fmt::format("refused: {} ({:04X}h){}{}", text(error), static_cast<std::uint32_t>(error),
                       words.empty() ? "" : ", ", words),
           remedy_of(error));
    }
    if (answer[0] != busy_answer) return answer;
    if (mailbox_.master().now() >= deadline) fail(file, "the slave stays busy", "give it more time");
    mailbox_.master().wait(busy_interval);
  }
}

std::vector<std::uint8_t> FoeClient::read(std::string_view file, std::uint32_t password, const Progress& progress) {
  std::vector<std::uint8_t> content;
  Mail request = mail_of(read_request, password, file);
  for (std::uint32_t packet = 1;; ++packet) {
    const Mail answer = ask(request, file);
    if (answer[0] != data_packet || load_u32(&answer[2]) != packet) {
      fail(file, fmt::format("packet {} was expected, but operation {} was received", packet, answer[0]), "try again");
    }
    content.insert(content.end(), answer.begin() + foe_header_size, answer.end());
    if (content.size() > largest_file) fail(file, "the file has no end", "see the slave's manual");
    if (progress) progress(content.size());
    request = mail_of(acknowledgement, packet);
    // A packet that does not fill the mailbox is the last one; its acknowledgement has no answer.
    if (answer.size() < mailbox_.room_in()) break;
  }
  mailbox_.send(MailboxType::foe, request, timeout_);
  return content;
}

void FoeClient::write(std::string_view file, std::span<const std::uint8_t> content, std::uint32_t password,
                      const Progress& progress) {
  const auto acknowledged = [&](const Mail& answer, std::uint32_t packet) {
    if (answer[0] == acknowledgement && load_u32(&answer[2]) == packet) return;
    fail(file, fmt::format("packet {} is not acknowledged", packet), "try again");
  };
  acknowledged(ask(mail_of(write_request, password, file), file), 0);
  const std::size_t packet_size = mailbox_.room_out() - foe_header_size;
  std::size_t sent = 0;
  // If the last data packet is full, an empty one follows.
  for (std::uint32_t packet = 1;; ++packet) {
    const std::size_t count = std::min(packet_size, content.size() - sent);
    acknowledged(ask(mail_of(data_packet, packet, content.subspan(sent, count)), file), packet);
    sent += count;
    if (progress) progress(sent);
    if (count < packet_size) return;
  }
}

}  // namespace servodrome::master
