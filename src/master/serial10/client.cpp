#include "master/serial10/client.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "links/link_error.hpp"

namespace servodrome::master {
namespace {

using serial10::Frame;

// Pause before a retry: the drive discards an incomplete frame after 50 ms.
constexpr Time recovery_time = std::chrono::milliseconds(60);

bool answers(const Frame& answer, const Frame& request) {
  return answer.is_intact() && (answer.id() == request.id() || request.id() == serial10::universal_id) &&
         answer.index() == request.index() && answer.sub() == request.sub();
}

bool is_answer_to(serial10::Command answer, serial10::Command request) {
  if (answer == serial10::Command::error) return true;
  return request == serial10::Command::read ? serial10::data_bytes(answer) != 0 : answer == serial10::Command::written;
}

}  // namespace

Serial10Error::Serial10Error(const std::string& link, std::uint8_t id, std::uint16_t index, std::uint8_t sub,
                             dictionary::AbortCode code, bool from_drive)
    : ObjectError(from_drive ? fmt::format("object {:04X}:{:02X} was refused: {:08X}h, {}", index, sub,
                                           static_cast<std::uint32_t>(code), dictionary::text(code))
                             : fmt::format("no answer for object {:04X}:{:02X}", index, sub),
                  fmt::format("{}, drive {}", link, id),
                  from_drive ? "check object, value and the state of the drive"
                             : "check id and bit rate, and that the drive speaks this protocol on this port",
                  code == dictionary::AbortCode::object_does_not_exist ||
                      code == dictionary::AbortCode::sub_index_does_not_exist,
                  from_drive),
      code_(code),
      from_drive_(from_drive) {}

Serial10Client Serial10Client::open(const std::string& link, const Serial10Options& options) {
  try {
    return {links::heard(links::open_byte_client(links::parse_serial_link(link), options.format), options.heard), link,
            options};
  } catch (const links::LinkError& error) {
    throw MasterError(error.what(), link, "check that the device or the line is running");
  }
}

Frame Serial10Client::request(std::uint8_t id, serial10::Command command, std::uint16_t index, std::uint8_t sub,
                              std::uint32_t data, unsigned retries) {
  const Frame frame = Frame::make(id, command, index, sub, data);
  std::optional<Frame> answer;
  try {
    for (unsigned attempt = 0; attempt <= limit_.retries(retries) && !answer; ++attempt) {
      if (attempt > 0) client_->wait(recovery_time);
      answer = exchange(frame);
    }
  } catch (const links::LinkError& error) {
    throw MasterError(error.what(), name_, "check that the device or the line is running");
  }
  if (!answer) throw Serial10Error(name_, id, index, sub, dictionary::AbortCode::protocol_timed_out, false);
  if (answer->command() == serial10::Command::error) {
    throw Serial10Error(name_, id, index, sub, static_cast<dictionary::AbortCode>(answer->data()), true);
  }
  return *answer;
}

std::optional<Frame> Serial10Client::exchange(const Frame& request) {
  std::vector<std::uint8_t> received;
  while (client_->receive(received, Time{0})) received.clear();
  client_->send(request.bytes);
  const Time deadline =
      client_->now() + options_.format.character_time() * serial10::frame_bytes + limit_.timeout(options_.timeout);
  received.clear();
  while (received.size() < serial10::frame_bytes) {
    const Time left = deadline - client_->now();
    if (left <= Time{0}) return std::nullopt;
    client_->receive(received, left);
  }
  Frame answer;
  std::copy_n(received.begin(), serial10::frame_bytes, answer.bytes.begin());
  if (!answers(answer, request) || !is_answer_to(answer.command(), request.command())) return std::nullopt;
  return answer;
}

std::string Serial10Client::where(std::uint8_t id) const { return fmt::format("{}, drive {}", name_, id); }

std::vector<std::byte> Serial10Client::upload(std::uint8_t id, ObjectAddress object) {
  const Frame answer = request(id, serial10::Command::read, object.index, object.sub, 0, options_.retries);
  const std::uint32_t data = answer.data();
  const auto bytes = std::as_bytes(std::span(&data, 1)).first(serial10::data_bytes(answer.command()));
  return {bytes.begin(), bytes.end()};
}

void Serial10Client::download(std::uint8_t id, ObjectAddress object, std::span<const std::byte> data) {
  const serial10::Command command = data.size() == 1   ? serial10::Command::write_1
                                    : data.size() == 2 ? serial10::Command::write_2
                                                       : serial10::Command::write_4;
  if (data.size() != serial10::data_bytes(command)) {
    throw ObjectError(fmt::format("{} bytes cannot be sent", data.size()),
                      fmt::format("{}, {}", where(id), text_of(object)), "the protocol carries 1, 2 or 4", false);
  }
  std::uint32_t value = 0;
  std::memcpy(&value, data.data(), data.size());
  request(id, command, object.index, object.sub, value, 0);
}

}  // namespace servodrome::master
