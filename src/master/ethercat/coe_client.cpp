// SDOs over CoE (ETG.1000.6 clause 5.6.2).
#include "master/ethercat/coe_client.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "master/abort_text.hpp"

namespace servodrome::master {

using dictionary::AbortCode;
using ethercat::CoeService;
using ethercat::load_u16;
using ethercat::load_u32;

namespace {

// First byte of SDO services (ETG.1000.6 tables 29 to 39).
constexpr std::uint8_t specifier_mask = 0xE0;
constexpr std::uint8_t download_segment = 0x00;
constexpr std::uint8_t initiate_download = 0x20;
constexpr std::uint8_t initiate_upload = 0x40;
constexpr std::uint8_t upload_segment = 0x60;
constexpr std::uint8_t abort_transfer = 0x80;
constexpr std::uint8_t upload_segment_answer = 0x00;
constexpr std::uint8_t download_segment_answer = 0x20;
constexpr std::uint8_t initiate_upload_answer = 0x40;
constexpr std::uint8_t initiate_download_answer = 0x60;
constexpr std::uint8_t complete_bit = 0x10;
constexpr std::uint8_t toggle_bit = 0x10;
constexpr std::uint8_t expedited_bit = 0x02;
constexpr std::uint8_t size_bit = 0x01;
constexpr std::uint8_t last_bit = 0x01;

using ethercat::coe_header_size;
constexpr std::size_t initiate_size = 8;
constexpr std::size_t least_segment = 7;  // minimum bytes of data in a segment; shorter ones are padded
constexpr std::size_t expedited_bytes = 4;

constexpr std::size_t largest_upload = std::size_t{64} << 20;

constexpr const char* mailbox_remedy =
    "check with `servodrome scan` that it is in PREOP or above, stop any other master of the segment (two masters read "
    "each other's answers), or give a longer --timeout (where it is the time for each answer)";

Mail request_of(std::uint8_t command, ObjectAddress object) {
  Mail mail(coe_header_size + initiate_size);
  ethercat::store_u16(mail.data(), static_cast<unsigned>(CoeService::sdo_request) << 12);
  mail[coe_header_size] = command;
  ethercat::store_u16(&mail[coe_header_size + 1], object.index);
  mail[coe_header_size + 3] = object.sub;
  return mail;
}

void append(std::vector<std::byte>& data, std::span<const std::uint8_t> bytes) {
  const auto* first = reinterpret_cast<const std::byte*>(bytes.data());
  data.insert(data.end(), first, first + bytes.size());
}

}  // namespace

CoeError::CoeError(const std::string& where, ObjectAddress object, bool upload, AbortCode code, bool from_slave)
    : ObjectError(text_of_failed_access(upload, code, from_slave), fmt::format("{}, {}", where, text_of(object)),
                  remedy_of_failed_access(code, from_slave) != nullptr ? remedy_of_failed_access(code, from_slave)
                                                                       : mailbox_remedy,
                  is_absent(code), from_slave),
      code_(code),
      from_slave_(from_slave) {}

// Sends an abort to the slave and throws.
void CoeClient::give_up(ObjectAddress object, bool is_upload, AbortCode code) {
  Mail mail = request_of(abort_transfer, object);
  ethercat::store_u32(&mail[coe_header_size + 4], static_cast<std::uint32_t>(code));
  mailbox_.send(MailboxType::coe, mail, timeout());
  throw CoeError(mailbox_.where(), object, is_upload, code, false);
}

// Sends the request and returns the answer from its SDO command byte on.
Mail CoeClient::ask(std::span<const std::uint8_t> request, ObjectAddress object, bool is_upload,
                    std::uint8_t expected) {
  const bool names_object = expected == initiate_upload_answer || expected == initiate_download_answer;
  mailbox_.drain();
  mailbox_.send(MailboxType::coe, request, timeout());
  expect_late_answer(object);
  auto answer = mailbox_.receive(MailboxType::coe, timeout(), [&](const Mail& mail) {
    if (mail.size() < coe_header_size + 1) return false;
    const auto service = static_cast<CoeService>(load_u16(mail.data()) >> 12);
    const std::uint8_t command = mail[coe_header_size];
    const bool long_enough = mail.size() >= coe_header_size + initiate_size;
    const bool same_object =
        long_enough && load_u16(&mail[coe_header_size + 1]) == object.index && mail[coe_header_size + 3] == object.sub;
    // By the standard an abort is a request; some slaves send it as a response.
    if ((command & specifier_mask) == abort_transfer) return same_object;
    if (service != CoeService::sdo_response || (command & specifier_mask) != expected) return false;
    return !names_object || same_object;
  });
  if (!answer) {
    expect_late_answer(object);
    throw CoeError(mailbox_.where(), object, is_upload, AbortCode::protocol_timed_out, false);
  }
  late_answer_.rule_out();
  answer->erase(answer->begin(), answer->begin() + coe_header_size);
  if (((*answer)[0] & specifier_mask) == abort_transfer) {
    throw CoeError(mailbox_.where(), object, is_upload, static_cast<AbortCode>(load_u32(&(*answer)[4])), true);
  }
  return std::move(*answer);
}

void CoeClient::expect_late_answer(ObjectAddress object) {
  if (!LateAnswer::is_constant(object)) late_answer_.expect(mailbox_.master().now());
}

void CoeClient::drain_late_answer(ObjectAddress object) {
  if (!late_answer_.is_expected(mailbox_.master().now()) || LateAnswer::is_constant(object)) return;
  const ObjectAddress constant = late_answer_.next_object();
  try {
    ask(request_of(initiate_upload, constant), constant, true, initiate_upload_answer);
  } catch (const CoeError& error) {
    if (!error.from_slave()) throw CoeError(mailbox_.where(), object, true, error.code(), false);
  }
}

std::vector<std::byte> CoeClient::upload(ObjectAddress object, bool complete) {
  try {
    return upload_once(object, complete);
  } catch (const CoeError& error) {
    if (error.from_slave() || error.code() != AbortCode::protocol_timed_out || limit_.retries(1) == 0) throw;
    try {
      return upload_once(object, complete);
    } catch (const EthercatError& of_mailbox) {
      if (of_mailbox.kind() != EthercatError::Kind::no_answer) throw;
    }
    throw;  // the slave does not read its mailbox any more: throws the first error
  }
}

std::vector<std::byte> CoeClient::upload_once(ObjectAddress object, bool complete) {
  drain_late_answer(object);
  const auto command = static_cast<std::uint8_t>(initiate_upload | (complete ? complete_bit : 0U));
  const Mail first = ask(request_of(command, object), object, true, initiate_upload_answer);
  std::vector<std::byte> data;
  if ((first[0] & expedited_bit) != 0) {
    const std::size_t unused = (first[0] & size_bit) != 0 ? first[0] >> 2 & 3U : 0U;
    append(data, std::span(first).subspan(4, expedited_bytes - unused));
    return data;
  }
  const std::uint32_t size = load_u32(&first[4]);
  if (size > largest_upload) give_up(object, true, AbortCode::out_of_memory);
  const std::span<const std::uint8_t> content = std::span(first).subspan(initiate_size);
  append(data, content.first(std::min<std::size_t>(content.size(), size)));
  for (bool toggle = false; data.size() < size; toggle = !toggle) {
    const auto next = static_cast<std::uint8_t>(upload_segment | (toggle ? toggle_bit : 0U));
    const Mail segment = ask(request_of(next, {}), object, true, upload_segment_answer);
    if (((segment[0] & toggle_bit) != 0) != toggle) give_up(object, true, AbortCode::toggle_bit_not_alternated);
    std::size_t count = segment.size() - 1;
    if (count == least_segment) count -= segment[0] >> 1 & 7U;
    append(data, std::span(segment).subspan(1, count));
    const bool last = (segment[0] & last_bit) != 0;
    // A slave that sends segments without data would never end the transfer.
    const bool wrong = data.size() > size || last != (data.size() == size) || (count == 0 && !last);
    if (wrong) give_up(object, true, AbortCode::length_mismatch);
  }
  return data;
}

void CoeClient::download(ObjectAddress object, std::span<const std::byte> data, bool complete) {
  const std::span<const std::uint8_t> bytes(reinterpret_cast<const std::uint8_t*>(data.data()), data.size());
  const unsigned complete_flag = complete ? complete_bit : 0U;
  if (!bytes.empty() && bytes.size() <= expedited_bytes) {
    const auto unused = static_cast<unsigned>(expedited_bytes - bytes.size());
    Mail mail = request_of(
        static_cast<std::uint8_t>(initiate_download | complete_flag | unused << 2 | expedited_bit | size_bit), object);
    std::copy(bytes.begin(), bytes.end(), mail.begin() + coe_header_size + 4);
    ask(mail, object, false, initiate_download_answer);
    return;
  }
  Mail mail = request_of(static_cast<std::uint8_t>(initiate_download | complete_flag | size_bit), object);
  ethercat::store_u32(&mail[coe_header_size + 4], static_cast<std::uint32_t>(bytes.size()));
  std::size_t sent = std::min(bytes.size(), mailbox_.room_out() - mail.size());
  mail.insert(mail.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(sent));
  ask(mail, object, false, initiate_download_answer);
  for (bool toggle = false; sent < bytes.size(); toggle = !toggle) {
    const std::size_t count = std::min(bytes.size() - sent, mailbox_.room_out() - coe_header_size - 1);
    const bool last = sent + count == bytes.size();
    const auto unused = count < least_segment ? static_cast<unsigned>(least_segment - count) : 0U;
    Mail segment(coe_header_size + 1);
    ethercat::store_u16(segment.data(), static_cast<unsigned>(CoeService::sdo_request) << 12);
    segment[coe_header_size] =
        static_cast<std::uint8_t>(download_segment | (toggle ? toggle_bit : 0U) | unused << 1 | (last ? last_bit : 0U));
    const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(sent);
    segment.insert(segment.end(), from, from + static_cast<std::ptrdiff_t>(count));
    segment.resize(segment.size() + unused);
    const Mail answer = ask(segment, object, false, download_segment_answer);
    if (((answer[0] & toggle_bit) != 0) != toggle) give_up(object, false, AbortCode::toggle_bit_not_alternated);
    sent += count;
  }
}

}  // namespace servodrome::master
