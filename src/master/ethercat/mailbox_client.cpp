#include "master/ethercat/mailbox_client.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace servodrome::master {

namespace reg = ethercat::reg;
using ethercat::Command;
using ethercat::load_u16;
using ethercat::mailbox_header_size;

namespace {

constexpr Time mailbox_poll_interval = std::chrono::microseconds(250);
constexpr std::size_t kept_emergencies = 64;
constexpr std::size_t most_drained = kept_emergencies;  // at once: a slave may send emergencies without end

// Bits of the registers of a sync manager (ETG.1000.4 table 58).
constexpr std::uint8_t mailbox_full = 0x08;
constexpr std::uint8_t enable = 0x01;
constexpr std::uint8_t repeat_request = 0x02;

const char* text(ethercat::MailboxError error) {
  using ethercat::MailboxError;
  switch (error) {
    case MailboxError::syntax: return "syntax of the header is wrong";
    case MailboxError::unsupported_protocol: return "protocol not supported";
    case MailboxError::invalid_channel: return "invalid channel";
    case MailboxError::service_not_supported: return "service not supported";
    case MailboxError::invalid_header: return "invalid header";
    case MailboxError::size_too_short: return "mail too short";
    case MailboxError::no_more_memory: return "no memory";
    case MailboxError::invalid_size: return "invalid size";
  }
  return "unknown error";
}

}  // namespace

void MailboxClient::timed_out(const std::string& happened) const {
  throw EthercatError(
      EthercatError::Kind::no_answer, happened, where(),
      "check that it is in PREOP or above (`servodrome scan`), stop any other master of the segment "
      "(two masters read each other's answers), or, if it is busy, give a longer --timeout (where it is the time "
      "for each answer)");
}

bool MailboxClient::full(std::uint16_t number) {
  const auto status = master_.read<std::uint8_t>(station_, reg::sync_manager_at(number, reg::sync_manager_status));
  return (status & mailbox_full) != 0;
}

void MailboxClient::send(MailboxType type, std::span<const std::uint8_t> mail, Time timeout) {
  if (mail.size() > room_out()) {
    throw EthercatError(EthercatError::Kind::unsupported,
                        fmt::format("a mail of {} bytes does not fit into its mailbox of {}", mail.size(), room_out()),
                        where(), "this is a mistake of the program; please report it");
  }
  // Writes the whole area, because the slave receives the mail only when the last byte is written.
  std::vector<std::uint8_t> bytes(areas_.out.length);
  ethercat::store_u16(bytes.data(), static_cast<unsigned>(mail.size()));
  bytes[5] = static_cast<std::uint8_t>(static_cast<unsigned>(type) | static_cast<unsigned>(counter_) << 4);
  std::copy(mail.begin(), mail.end(), bytes.begin() + mailbox_header_size);
  const Time deadline = master_.now() + timeout;
  while (!is_empty_ && full(0)) {
    if (master_.now() >= deadline) timed_out("it does not read its mailbox");
    master_.wait(mailbox_poll_interval);
  }
  is_empty_ = false;
  bool may_be_there = false;
  while (true) {
    EthercatDatagram datagram{
        .command = Command::fpwr, .address = ethercat::address_of(station_, areas_.out.start), .data = bytes};
    const bool back = master_.try_exchange(std::span(&datagram, 1), master_.options().timeout);
    // If the frame was lost on its way back, the mail has been delivered already. The slave discards a repeated mail,
    // which it recognises by the counter. The mailbox was empty before, so it can contain no other mail.
    if ((back && datagram.counter != 0) || (back && may_be_there && full(0))) break;
    may_be_there = may_be_there || !back;
    if (master_.now() >= deadline) timed_out("it does not read its mailbox");
    if (back) master_.wait(mailbox_poll_interval);
  }
  counter_ = counter_ % 7 + 1;
  was_repeated_ = may_be_there;
}

bool MailboxClient::read_area(std::vector<std::uint8_t>& bytes) {
  EthercatDatagram datagram{
      .command = Command::fprd, .address = ethercat::address_of(station_, areas_.in.start), .data = bytes};
  if (!master_.try_exchange(std::span(&datagram, 1), master_.options().timeout)) {
    request_repeat();
    return false;
  }
  return datagram.counter != 0;
}

// Requests the slave's last mail again, which the master did not receive (ETG.1000.4 clause 5.6.3).
void MailboxClient::request_repeat() {
  constexpr std::uint16_t address = reg::sync_manager_at(1, reg::sync_manager_activate);
  if (!repeat_bit_known_) {
    repeat_bit_ = (master_.read<std::uint8_t>(station_, address) & repeat_request) != 0;
    repeat_bit_known_ = true;
  }
  repeat_bit_ = !repeat_bit_;
  master_.write<std::uint8_t>(station_, address,
                              static_cast<std::uint8_t>(enable | (repeat_bit_ ? repeat_request : 0U)));
  const Time deadline = master_.now() + std::chrono::milliseconds(100);
  while (((master_.read<std::uint8_t>(station_, static_cast<std::uint16_t>(address + 1)) & repeat_request) != 0) !=
         repeat_bit_) {
    if (master_.now() >= deadline) return;  // the slave does not support repetition; the answer is lost
    master_.wait(mailbox_poll_interval);
  }
}

std::optional<MailboxClient::Letter> MailboxClient::fetch() {
  if (!full(1)) return std::nullopt;
  std::vector<std::uint8_t> bytes(areas_.in.length);
  if (!read_area(bytes)) return std::nullopt;
  const std::size_t length = load_u16(bytes.data());
  const std::uint8_t counter = bytes[5] >> 4 & 7;
  if (counter != 0 && counter == last_received_) return std::nullopt;  // a repetition
  last_received_ = counter;
  if (length > room_in()) {
    throw EthercatError(EthercatError::Kind::malformed,
                        fmt::format("the header of its mail gives {} bytes, but its mailbox has {}", length, room_in()),
                        where(), "take it to INIT and PREOP again, which resets its mailbox");
  }
  const auto begin = bytes.begin() + mailbox_header_size;
  return Letter{static_cast<MailboxType>(bytes[5] & 0x0F), Mail(begin, begin + static_cast<std::ptrdiff_t>(length))};
}

bool MailboxClient::keep_emergency(const Letter& letter) {
  constexpr std::size_t size = ethercat::coe_header_size + 8;
  if (letter.type != MailboxType::coe || letter.mail.size() < size) return false;
  if (load_u16(letter.mail.data()) >> 12 != static_cast<unsigned>(ethercat::CoeService::emergency)) return false;
  Emergency emergency{.code = load_u16(&letter.mail[2]), .error_register = letter.mail[4]};
  std::copy_n(&letter.mail[5], emergency.vendor.size(), emergency.vendor.begin());
  emergencies_.push_back(emergency);
  if (emergencies_.size() > kept_emergencies) emergencies_.pop_front();
  return true;
}

std::optional<Mail> MailboxClient::receive(MailboxType type, Time timeout,
                                           const std::function<bool(const Mail&)>& wanted) {
  const Time deadline = master_.now() + timeout;
  while (true) {
    auto letter = fetch();
    if (letter && !keep_emergency(*letter)) {
      if (letter->type == MailboxType::error && letter->mail.size() >= 4) {
        const auto code = static_cast<ethercat::MailboxError>(load_u16(&letter->mail[2]));
        throw EthercatError(EthercatError::Kind::refused,
                            fmt::format("mailbox error {:04X}h: {}", static_cast<unsigned>(code), text(code)), where(),
                            "use a protocol that the slave has (`servodrome scan`)");
      }
      if (letter->type == type && wanted(letter->mail)) {
        is_empty_ = !was_repeated_;
        return std::move(letter->mail);
      }
    }
    if (master_.now() >= deadline) return std::nullopt;
    if (!letter) master_.wait(mailbox_poll_interval);
  }
}

Mail MailboxClient::ask(MailboxType type, std::span<const std::uint8_t> request, Time timeout,
                        const std::function<bool(const Mail&)>& wanted) {
  drain();
  send(type, request, timeout);
  if (auto answer = receive(type, timeout, wanted)) return std::move(*answer);
  timed_out("no answer in its mailbox");
}

void MailboxClient::drain() {
  for (std::size_t mails = 0; mails < most_drained; ++mails) {
    const auto letter = fetch();
    if (!letter) return;
    keep_emergency(*letter);
  }
}

}  // namespace servodrome::master
