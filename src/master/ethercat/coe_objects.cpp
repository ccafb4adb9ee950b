#include "master/ethercat/coe_objects.hpp"

#include <algorithm>
#include <cstdlib>
#include <fmt/format.h>

#include "links/time.hpp"

namespace servodrome::master {

namespace {

// Cycles from writing an output until the inputs show its effect: the output is sent, the slave applies it with its
// next SYNC0, and the frame after that returns the inputs; plus one cycle for a lost frame.
constexpr int cycles_to_act = 4;

constexpr ObjectAddress controlword{0x6040, 0};
constexpr ObjectAddress statusword{0x6041, 0};
constexpr ObjectAddress position{0x6064, 0};

}  // namespace

bool CoeObjects::inputs_have_changed() const {
  const std::span<const std::uint8_t> inputs = exchange_->inputs(member_);
  return !std::equal(inputs.begin(), inputs.end(), inputs_.begin(), inputs_.end());
}

bool CoeObjects::differs(ObjectAddress object, std::uint32_t mask, std::int64_t tolerance) {
  constexpr int looks = 3;
  const auto input = exchange_->input(member_, object);
  if (!input) return false;
  const auto kept = input->get<std::int32_t>();
  for (int look = 0; look < looks; ++look) {
    std::int32_t present = 0;
    try {
      present = slave_.coe().read<std::int32_t>(object.index, object.sub);
    } catch (const CoeError& error) {
      if (error.from_slave()) return false;
      throw;
    }
    wait(cycles_to_act * exchange_->period());  // until then the answer can be newer than the inputs
    if (inputs_have_changed() || !exchange_->inputs_are_fresh()) return false;
    const std::int64_t difference = std::int64_t{present} - kept;
    if (((static_cast<std::uint32_t>(present) ^ static_cast<std::uint32_t>(kept)) & mask) == 0 &&
        std::abs(difference) <= tolerance) {
      return false;
    }
  }
  return true;
}

void CoeObjects::watch_inputs() {
  if (inputs_have_changed()) {
    const std::span<const std::uint8_t> inputs = exchange_->inputs(member_);
    inputs_.assign(inputs.begin(), inputs.end());
    unchanged_since_ = now();
    compared_ = false;
    return;
  }
  if (compared_ || now() - unchanged_since_ < longest_unchanged) return;
  constexpr std::uint32_t state_and_target_reached = 0x046F;
  constexpr std::int64_t any = std::int64_t{1} << 32;
  constexpr std::int64_t encoder_noise = 10;
  const auto fail = [&](const std::string& happened) {
    throw EthercatError(EthercatError::Kind::malformed, happened, where(),
                        "the application of the slave hangs, or does not update its inputs: switch its power off and "
                        "on; look for a newer firmware");
  };
  const auto unchanged = links::to_seconds(longest_unchanged);
  try {
    inputs_are_stale_ = differs(statusword, state_and_target_reached, any) || differs(position, 0, encoder_noise);
    compared_ = exchange_->inputs_are_fresh();
    unchanged_since_ = now();
  } catch (const MasterError& error) {
    exchange_->check(member_);
    if (inputs_have_changed()) return;
    unchanged_since_ = now();  // until the next comparison the caller can read the state, to stop the axis
    fail(fmt::format("the inputs have not changed for {:g} s, and {}", unchanged, error.happened()));
  }
  if (inputs_are_stale_) {
    fail(fmt::format("the inputs have not changed for {:g} s, but statusword or position have other values by SDO",
                     unchanged));
  }
}

std::vector<std::byte> CoeObjects::upload(ObjectAddress object) {
  const auto bytes_of = [](const ProcessObject& mapped) {
    const std::uint64_t value = mapped.raw();
    const auto bytes = std::as_bytes(std::span(&value, 1)).first(mapped.bits() / 8);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  // Each cycle overwrites a controlword that was written by SDO. So the outputs have the present one, and a stop needs
  // no mailbox.
  if (exchanges() && object == controlword) {
    if (const auto output = exchange_->output(member_, object)) return bytes_of(*output);
  }
  if (exchanges() && !inputs_are_stale_) {
    if (const auto input = exchange_->input(member_, object); input && input->bits() % 8 == 0) {
      exchange_->check(member_);
      watch_inputs();
      return bytes_of(*input);
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
      if (compared_) unchanged_since_ = written;
      compared_ = false;
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
