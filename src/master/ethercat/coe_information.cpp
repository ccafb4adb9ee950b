// SDO information over CoE (ETG.1000.6 clause 5.6.3).
#include <algorithm>
#include <fmt/format.h>

#include "master/ethercat/coe_client.hpp"

namespace servodrome::master {

using dictionary::AbortCode;
using ethercat::CoeService;
using ethercat::load_u16;
using ethercat::load_u32;

namespace {

// Opcodes (ETG.1000.6 table 42).
constexpr std::uint8_t list_request = 1;
constexpr std::uint8_t object_request = 3;
constexpr std::uint8_t entry_request = 5;
constexpr std::uint8_t information_error = 7;
constexpr std::uint8_t opcode_mask = 0x7F;

constexpr std::size_t information_header_size = ethercat::coe_header_size + 4;

// Of all fragments with their headers; the longest list has 65536 indices. A slave may say without end that more
// follows.
constexpr std::size_t largest_information = std::size_t{1} << 20;

// Value info (ETG.1000.6 table 48).
constexpr std::uint8_t with_unit = 0x08;
constexpr std::uint8_t with_default = 0x10;
constexpr std::uint8_t with_minimum = 0x20;
constexpr std::uint8_t with_maximum = 0x40;

Mail information_request(std::uint8_t opcode, std::initializer_list<std::uint8_t> data) {
  Mail mail(information_header_size + data.size());
  ethercat::store_u16(mail.data(), static_cast<unsigned>(CoeService::sdo_information) << 12);
  mail[ethercat::coe_header_size] = opcode;
  std::copy(data.begin(), data.end(), mail.begin() + information_header_size);
  return mail;
}

std::uint8_t low(std::uint16_t value) { return static_cast<std::uint8_t>(value); }
std::uint8_t high(std::uint16_t value) { return static_cast<std::uint8_t>(value >> 8); }

std::string text_from(const Mail& data, std::size_t at) {
  if (at >= data.size()) return {};
  std::string text(data.begin() + static_cast<std::ptrdiff_t>(at), data.end());
  text.erase(text.find_last_not_of('\0') + 1);
  return text;
}

}  // namespace

// Sends the request and returns the joined data of all fragments.
Mail CoeClient::ask_information(std::span<const std::uint8_t> request, std::uint16_t index) {
  const std::uint8_t opcode = request[ethercat::coe_header_size];
  const auto wanted = [&](const Mail& mail) {
    if (mail.size() < information_header_size) return false;
    if (load_u16(mail.data()) >> 12 != static_cast<unsigned>(CoeService::sdo_information)) return false;
    const std::uint8_t answered = mail[ethercat::coe_header_size] & opcode_mask;
    return answered == opcode + 1 || answered == information_error;
  };
  // The first fragment of a description begins with the object. A late answer may describe another one.
  const std::ptrdiff_t named = opcode == object_request ? 2 : opcode == entry_request ? 3 : 0;
  const auto of_object = [&](const Mail& mail) {
    if (!wanted(mail)) return false;
    if ((mail[ethercat::coe_header_size] & opcode_mask) == information_error) return true;
    const auto object = mail.begin() + information_header_size;
    return mail.end() - object >= named &&
           std::equal(object, object + named, request.begin() + information_header_size);
  };
  Mail data;
  std::size_t received = 0;
  Mail fragment = mailbox_.ask(MailboxType::coe, request, timeout(), of_object);
  while (true) {
    received += fragment.size();
    if (received > largest_information) {
      throw CoeError(mailbox_.where(), {index, 0}, true, AbortCode::out_of_memory, false);
    }
    if ((fragment[ethercat::coe_header_size] & opcode_mask) == information_error) {
      const std::uint32_t code =
          fragment.size() >= information_header_size + 4 ? load_u32(&fragment[information_header_size]) : 0;
      throw CoeError(mailbox_.where(), {index, 0}, true, static_cast<AbortCode>(code), true);
    }
    data.insert(data.end(), fragment.begin() + information_header_size, fragment.end());
    if (load_u16(&fragment[ethercat::coe_header_size + 2]) == 0) return data;
    auto next = mailbox_.receive(MailboxType::coe, timeout(), wanted);
    if (!next) throw CoeError(mailbox_.where(), {index, 0}, true, AbortCode::protocol_timed_out, false);
    fragment = std::move(*next);
  }
}

std::array<std::uint16_t, 5> CoeClient::list_lengths() {
  const Mail data = ask_information(information_request(list_request, {0, 0}), 0);
  std::array<std::uint16_t, 5> lengths{};
  for (std::size_t i = 0; i < lengths.size() && 2 * i + 4 <= data.size(); ++i) lengths[i] = load_u16(&data[2 * i + 2]);
  return lengths;
}

std::vector<std::uint16_t> CoeClient::list(ObjectList which) {
  const auto number = static_cast<std::uint16_t>(which);
  const Mail data = ask_information(information_request(list_request, {low(number), high(number)}), 0);
  std::vector<std::uint16_t> indices;
  for (std::size_t at = 2; at + 2 <= data.size(); at += 2) indices.push_back(load_u16(&data[at]));
  return indices;
}

ObjectDescription CoeClient::describe(std::uint16_t index) {
  const Mail data = ask_information(information_request(object_request, {low(index), high(index)}), index);
  if (data.size() < 6) give_up({index, 0}, true, AbortCode::length_mismatch);
  return {.index = load_u16(data.data()),
          .type = load_u16(&data[2]),
          .highest_sub = data[4],
          .code = data[5],
          .name = text_from(data, 6)};
}

EntryDescription CoeClient::describe(ObjectAddress entry) {
  constexpr std::uint8_t everything = with_unit | with_default | with_minimum | with_maximum;
  const Mail data = ask_information(
      information_request(entry_request, {low(entry.index), high(entry.index), entry.sub, everything}), entry.index);
  if (data.size() < 10) give_up(entry, true, AbortCode::length_mismatch);
  EntryDescription description{.address = {load_u16(data.data()), data[2]},
                               .type = load_u16(&data[4]),
                               .bits = load_u16(&data[6]),
                               .access = load_u16(&data[8])};
  const std::uint8_t info = data[3];
  std::size_t at = 10;
  if ((info & with_unit) != 0 && at + 4 <= data.size()) {
    description.unit = load_u32(&data[at]);
    at += 4;
  }
  const std::size_t bytes = (description.bits + 7U) / 8U;
  const auto take = [&](std::uint8_t flag, std::vector<std::uint8_t>& value) {
    if ((info & flag) == 0 || at + bytes > data.size()) return;
    const auto from = data.begin() + static_cast<std::ptrdiff_t>(at);
    value.assign(from, from + static_cast<std::ptrdiff_t>(bytes));
    at += bytes;
  };
  take(with_default, description.default_value);
  take(with_minimum, description.minimum);
  take(with_maximum, description.maximum);
  description.name = text_from(data, at);
  return description;
}

}  // namespace servodrome::master
