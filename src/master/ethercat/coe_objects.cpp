#include "master/ethercat/coe_objects.hpp"

#include <fmt/format.h>

namespace servodrome::master {

namespace {

// Cycles from writing an output until the inputs show its effect: the output is sent, the slave applies it with its
// next SYNC0, and the frame after that returns the inputs; plus one cycle for a lost frame.
constexpr int cycles_to_act = 4;

}  // namespace

std::vector<std::byte> CoeObjects::upload(ObjectAddress object) {
  if (exchanges()) {
    if (const auto input = exchange_->input(member_, object); input && input->bits() % 8 == 0) {
      exchange_->check(member_);
      const std::uint64_t value = input->raw();
      const auto bytes = std::as_bytes(std::span(&value, 1)).first(input->bits() / 8);
      return {bytes.begin(), bytes.end()};
    }
  }
  return slave_.coe().upload(object);
}

void CoeObjects::download(ObjectAddress object, std::span<const std::byte> data) {
  if (exchanges()) {
    if (auto output = exchange_->output(member_, object)) {
      if (data.size() != (output->bits() + 7) / 8) {
        throw ObjectError(fmt::format("the mapped object has {} bits, not {} bytes", output->bits(), data.size()),
                          fmt::format("{}, {}", where(), text_of(object)), "give the object's own data type", false);
      }
      std::uint64_t value = 0;
      std::memcpy(&value, data.data(), std::min(data.size(), sizeof value));
      output->set_raw(value);
      const Time written = now();
      wait(cycles_to_act * exchange_->period());
      while (exchange_->processed(member_) <= written) wait(exchange_->period());  // throws if the slave is lost
      return;
    }
  }
  slave_.coe().download(object, data);
}

void CoeObjects::wait(Time span) {
  slave_.master().wait(span);
  if (exchanges()) exchange_->check(member_);
}

std::optional<Emergency> CoeObjects::latest_emergency() {
  if (!slave_.has_mailbox()) return std::nullopt;
  MailboxClient& mailbox = slave_.mailbox();
  mailbox.drain();
  if (mailbox.emergencies().empty()) return std::nullopt;
  return mailbox.emergencies().back();
}

}  // namespace servodrome::master
