#include "modbus/server.hpp"

#include "dictionary/joint_write.hpp"

namespace servodrome::modbus {

using dictionary::AbortCode;
using dictionary::Entry;

// The registers of one object within a request.
struct Server::Part {
  const Register* row = nullptr;
  const Entry* entry = nullptr;
  std::size_t first = 0;  // relative to the object's address
  std::size_t words = 0;
};

namespace {

// Returns which 16 bits of a number are in register `word` of `words`; 0: the lowest.
std::size_t significance(WordOrder order, std::size_t word, std::size_t words) {
  return order == WordOrder::low_word_first || word >= words ? word : words - 1 - word;
}

}  // namespace

std::size_t Server::answer(std::span<const std::uint8_t> request, Response response) {
  if (request.empty()) return 0;
  std::size_t length = 0;
  response[0] = request[0];
  const Exception exception = execute(request, response, length);
  if (exception == Exception::none) return length;
  response[0] = static_cast<std::uint8_t>(request[0] | error_bit);
  for (const ErrorFunction& row : profile_.error_functions) {
    if (row.function == request[0]) response[0] = row.error;
  }
  response[1] = static_cast<std::uint8_t>(exception);
  return 2;
}

void Server::broadcast(std::span<const std::uint8_t> request) {
  if (!profile_.broadcast || request.empty()) return;
  const auto function = static_cast<Function>(request[0]);
  if (function != Function::write_single_register && function != Function::write_multiple_registers) return;
  std::array<std::uint8_t, longest_pdu> unsent{};
  answer(request, unsent);
}

Exception Server::execute(std::span<const std::uint8_t> request, Response response, std::size_t& length) {
  if (!profile_.functions.contains(request[0])) return Exception::illegal_function;
  switch (static_cast<Function>(request[0])) {
    case Function::read_holding_registers:
    case Function::read_input_registers: return read_registers(request, response, length);
    case Function::write_single_register: return write_single(request, response, length);
    case Function::write_multiple_registers: return write_multiple(request, response, length);
    case Function::read_write_multiple_registers: return read_write(request, response, length);
    case Function::encapsulated_interface_transport: return identify(request, response, length);
  }
  return Exception::illegal_function;
}

// 6.3, 6.4: address, quantity -> byte count, data
Exception Server::read_registers(std::span<const std::uint8_t> request, Response response, std::size_t& length) {
  if (request.size() != 5) return Exception::illegal_data_value;
  const std::uint16_t quantity = read_u16(&request[3]);
  if (quantity < 1 || quantity > most_registers_read) return Exception::illegal_data_value;
  const AbortCode abort = read(read_u16(&request[1]), quantity, &response[2]);
  if (abort != AbortCode::none) return exception_of(abort);
  response[1] = static_cast<std::uint8_t>(2 * quantity);
  length = 2U + 2U * quantity;
  return Exception::none;
}

// 6.6: address, value -> the same
Exception Server::write_single(std::span<const std::uint8_t> request, Response response, std::size_t& length) {
  if (request.size() != 5) return Exception::illegal_data_value;
  const AbortCode abort = write(read_u16(&request[1]), request.subspan(3, 2));
  if (abort != AbortCode::none) return exception_of(abort);
  std::copy(request.begin(), request.end(), response.begin());
  length = 5;
  return Exception::none;
}

// 6.12: address, quantity, byte count, data -> address, quantity
Exception Server::write_multiple(std::span<const std::uint8_t> request, Response response, std::size_t& length) {
  if (request.size() < 6) return Exception::illegal_data_value;
  const std::uint16_t quantity = read_u16(&request[3]);
  if (quantity < 1 || quantity > most_registers_written || request[5] != 2 * quantity ||
      request.size() != 6U + request[5]) {
    return Exception::illegal_data_value;
  }
  const AbortCode abort = write(read_u16(&request[1]), request.subspan(6));
  if (abort != AbortCode::none) return exception_of(abort);
  std::copy_n(request.begin(), 5, response.begin());
  length = 5;
  return Exception::none;
}

// 6.17: address and quantity to read, address and quantity to write, byte count, data -> byte count, data. Writes
// before it reads, but checks first that reading is possible.
Exception Server::read_write(std::span<const std::uint8_t> request, Response response, std::size_t& length) {
  if (request.size() < 10) return Exception::illegal_data_value;
  const std::uint16_t read_address = read_u16(&request[1]);
  const std::uint16_t read_quantity = read_u16(&request[3]);
  const std::uint16_t write_quantity = read_u16(&request[7]);
  if (read_quantity < 1 || read_quantity > most_registers_read || write_quantity < 1 ||
      write_quantity > most_registers_written_and_read || request[9] != 2 * write_quantity ||
      request.size() != 10U + request[9]) {
    return Exception::illegal_data_value;
  }
  AbortCode abort = read(read_address, read_quantity, &response[2]);
  if (abort == AbortCode::none) abort = write(read_u16(&request[5]), request.subspan(10));
  if (abort == AbortCode::none) abort = read(read_address, read_quantity, &response[2]);
  if (abort != AbortCode::none) return exception_of(abort);
  response[1] = static_cast<std::uint8_t>(2 * read_quantity);
  length = 2U + 2U * read_quantity;
  return Exception::none;
}

// Finds the object at `address`, and the number of the `words` registers from there on that belong to it.
AbortCode Server::locate(std::uint32_t address, std::size_t words, Part& part) const {
  auto next = std::upper_bound(map_.begin(), map_.end(), address,
                               [](std::uint32_t wanted, const Register& row) { return wanted < row.address; });
  if (next == map_.begin()) return AbortCode::object_does_not_exist;
  const Register& row = *(next - 1);
  std::size_t end = std::max<std::size_t>(row.words, profile_.registers_per_object_at_least);
  end = std::min<std::size_t>(end, (next != map_.end() ? next->address : 0x10000U) - row.address);
  const std::size_t first = address - row.address;
  if (first >= end) return AbortCode::object_does_not_exist;
  AbortCode abort = AbortCode::none;
  const Entry* entry = dictionary_.find(row.index, row.sub, abort);
  part = {&row, entry, first, std::min(words, end - first)};
  return abort;
}

AbortCode Server::read(std::uint16_t address, std::size_t words, std::uint8_t* data) const {
  for (std::size_t done = 0; done < words;) {
    Part part;
    if (const AbortCode abort = locate(static_cast<std::uint32_t>(address + done), words - done, part);
        abort != AbortCode::none) {
      return abort;
    }
    dictionary::ReadValue value;
    if (const AbortCode abort = dictionary_.read(*part.entry, value); abort != AbortCode::none) return abort;
    const bool is_number = part.entry->fixed_size();
    const std::byte fill = is_number ? extension(*part.entry, value.bytes) : std::byte{0};
    for (std::size_t i = 0; i < part.words; ++i) {
      const std::size_t word = part.first + i;
      const std::size_t place = 2 * (is_number ? significance(profile_.word_order, word, part.row->words) : word);
      const auto at = [&value, fill](std::size_t k) {
        return std::to_integer<std::uint8_t>(k < value.bytes.size() ? value.bytes[k] : fill);
      };
      *data++ = at(is_number ? place + 1 : place);
      *data++ = at(is_number ? place : place + 1);
    }
    done += part.words;
  }
  return AbortCode::none;
}

AbortCode Server::write(std::uint16_t address, std::span<const std::uint8_t> data) {
  std::array<std::byte, 2 * most_registers_written> bytes{};
  dictionary::JointWrite request(dictionary_);
  const std::size_t words = data.size() / 2;
  for (std::size_t done = 0; done < words;) {
    Part part;
    std::span<std::byte> value = std::span(bytes).subspan(2 * done);
    AbortCode abort = locate(static_cast<std::uint32_t>(address + done), words - done, part);
    if (abort == AbortCode::none) abort = decode(part, &data[2 * done], value);
    if (abort == AbortCode::none) abort = request.add(*part.entry, value);
    if (abort != AbortCode::none) return abort;
    done += part.words;
  }
  return request.commit();
}

AbortCode Server::decode(const Part& part, const std::uint8_t* data, std::span<std::byte>& value) const {
  const Entry& entry = *part.entry;
  if (!entry.writable()) return AbortCode::read_only;
  // Half of a number must not be written.
  if (part.first != 0 || part.words < part.row->words) return AbortCode::length_mismatch;
  const auto bytes = value.first(2 * part.words);
  const std::size_t size = dictionary::size_of(entry.type);
  if (size == 0) {
    std::transform(data, data + bytes.size(), bytes.begin(), [](std::uint8_t byte) { return std::byte{byte}; });
    value = bytes;
    while (!value.empty() && value.back() == std::byte{0}) value = value.first(value.size() - 1);
    return AbortCode::none;
  }
  for (std::size_t word = 0; word < part.words; ++word) {
    const std::size_t place = 2 * significance(profile_.word_order, word, part.row->words);
    bytes[place + 1] = std::byte{data[2 * word]};
    bytes[place] = std::byte{data[2 * word + 1]};
  }
  value = bytes.first(size);
  for (std::size_t i = size; i < bytes.size(); ++i) {
    if (bytes[i] != bytes[size] || !extends(entry, value, bytes[i])) return AbortCode::value_invalid;
  }
  return AbortCode::none;
}

std::byte Server::extension(const Entry& entry, std::span<const std::byte> number) const {
  const bool by_sign = profile_.extension == Extension::by_top_bit || dictionary::is_signed(entry.type);
  const bool top_bit = (number.back() & std::byte{0x80}) != std::byte{0};
  return by_sign && top_bit ? std::byte{0xFF} : std::byte{0};
}

bool Server::extends(const Entry& entry, std::span<const std::byte> number, std::byte surplus) const {
  if (surplus == extension(entry, number)) return true;
  return profile_.extension == Extension::by_top_bit && surplus == std::byte{0};
}

Exception Server::exception_of(AbortCode abort) const {
  for (const AbortException& row : profile_.exceptions) {
    if (row.abort == abort) return row.exception;
  }
  return Exception::server_device_failure;
}

}  // namespace servodrome::modbus
