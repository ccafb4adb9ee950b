#pragma once

#include "dictionary/dictionary.hpp"
#include "modbus/profile.hpp"
#include "modbus/register_map.hpp"

namespace servodrome::modbus {

// The registers of a device: takes requests and returns responses, independent of the transport (RtuServer,
// TcpConnection). It accesses the device through its dictionary and keeps no state between requests.
//
// The arguments of the constructor are not copied and must outlive the server.
class Server {
 public:
  Server(dictionary::Dictionary& dictionary, std::span<const Register> map, const Profile& profile)
      : dictionary_(dictionary), map_(map), profile_(profile) {}

  using Response = std::span<std::uint8_t, longest_pdu>;

  // Executes a request PDU. Returns the length of the response; 0 only for an empty request.
  //
  // A request that writes several objects acts as a whole (dictionary::JointWrite): all values are stored before the
  // first owner acts, so a controlword acts with the targets of its request, as in an RPDO. A refused request changes
  // nothing. Only the owner of a string or of an object without storage (1010h) may refuse later, when the other
  // objects are written.
  std::size_t answer(std::span<const std::uint8_t> request, Response response);

  // Executes a request without an answer: functions 06 and 10h, if the profile has broadcasts.
  void broadcast(std::span<const std::uint8_t> request);

  const Profile& profile() const { return profile_; }

 private:
  struct Part;

  Exception execute(std::span<const std::uint8_t> request, Response response, std::size_t& length);
  Exception read_registers(std::span<const std::uint8_t> request, Response response, std::size_t& length);
  Exception write_single(std::span<const std::uint8_t> request, Response response, std::size_t& length);
  Exception write_multiple(std::span<const std::uint8_t> request, Response response, std::size_t& length);
  Exception read_write(std::span<const std::uint8_t> request, Response response, std::size_t& length);
  Exception identify(std::span<const std::uint8_t> request, Response response, std::size_t& length) const;

  dictionary::AbortCode locate(std::uint32_t address, std::size_t words, Part& part) const;
  dictionary::AbortCode read(std::uint16_t address, std::size_t words, std::uint8_t* data) const;
  dictionary::AbortCode write(std::uint16_t address, std::span<const std::uint8_t> data);
  // Decodes the value of an object from its registers into the memory of `value`, and shortens `value` to its size.
  dictionary::AbortCode decode(const Part& part, const std::uint8_t* data, std::span<std::byte>& value) const;
  bool extends(const dictionary::Entry& entry, std::span<const std::byte> number, std::byte surplus) const;
  std::byte extension(const dictionary::Entry& entry, std::span<const std::byte> number) const;
  Exception exception_of(dictionary::AbortCode abort) const;

  dictionary::Dictionary& dictionary_;
  std::span<const Register> map_;
  const Profile& profile_;
};

}  // namespace servodrome::modbus
