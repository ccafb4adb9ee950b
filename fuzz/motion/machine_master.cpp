#include <algorithm>

#include "life_machine.hpp"

// The master: it sets the axes up, runs its cycles, writes objects, and brings the axes to Operation enabled.
namespace servodrome::motion {

void Life::Machine::set_up(std::size_t i) {
  if (!axes_[i].around.powered) return;
  ProcessValues& values = master_->values(i);
  values = {};
  dictionary::Dictionary& objects = axis(i).device().bus_dictionary();
  // Starts with the actual position as the target, as a careful master does.
  values.position = static_cast<std::int32_t>(objects.number(0x6064));
  values.mode = static_cast<std::int8_t>(objects.number(0x6060));
  line_.changed();
  master_->set_up(i, sequence_.mapped);
  if (on_can()) axis(i).send_waiting(line_.now());
  watches_[i]->pdos_mapped();
  axes_[i].set_up = true;
}

void Life::Machine::run_cycle() {
  if (pause_ > 0) {
    --pause_;
    return;
  }
  if (!cycling_) return;
  for (std::size_t i = 0; i < axes_.size(); ++i) step_stream(i);
  master_->cycle(sequence_.sync);
  ++cycles_;
}

void Life::Machine::step_stream(std::size_t i) {
  Stream& stream = axes_[i].stream;
  if (stream.left <= 0) return;
  streamed_ = true;
  --stream.left;
  ++stream.sent;
  ProcessValues& values = master_->values(i);
  std::int64_t value = values.get(stream.index) + stream.step;
  if (stream.index == 0x6071) {
    value = std::clamp<std::int64_t>(value, -32768, 32767);
  } else {
    value = static_cast<std::int32_t>(static_cast<std::uint32_t>(static_cast<std::uint64_t>(value)));
  }
  values.set(stream.index, value);
  if (stream.gap > 0 && stream.sent % stream.gap == 0) return;  // this value is not sent
  if (stream.index == 0x60C1) {
    write(i, stream.index, 1, value, Via::direct);
  } else if (on_can()) {
    write(i, stream.index, 0, value, Via::pdo);
  }
  axes_[i].around.commanded = tick_;
}

void Life::Machine::write(std::size_t i, std::uint16_t index, std::uint8_t sub, std::int64_t value, Via via) {
  dictionary::Dictionary& objects = axis(i).device().bus_dictionary();
  line_.changed();
  if (index == 0x609A && value > 0) {
    std::uint32_t& gentlest = axes_[i].around.gentlest_homing_ramp;
    gentlest = static_cast<std::uint32_t>(gentlest == 0 ? value : std::min<std::int64_t>(gentlest, value));
  }
  if (via == Via::direct && !(master_->in_process_data(i, index) && !on_can())) {
    master_->values(i).set(index, value);
    objects.set_number(index, sub, value);
    if (on_can()) axis(i).send_waiting(line_.now());
    return;
  }
  const dictionary::Entry* entry = objects.find(index, sub);
  const unsigned bytes = entry == nullptr ? 4 : static_cast<unsigned>(dictionary::size_of(entry->type));
  master_->write(i, index, sub, value, bytes, via == Via::pdo);
}

void Life::Machine::control(std::size_t i, std::uint16_t word) {
  write(i, 0x6040, 0, word, Via::pdo);
  axes_[i].around.commanded = tick_;
}

// The master brings an axis to Operation enabled, step by step.
void Life::Machine::poll_axis(std::size_t i) {
  AxisState& state = axes_[i];
  if (state.set_up_at != 0 && tick_ >= state.set_up_at) {
    state.set_up_at = 0;
    set_up(i);
  }
  if (!state.enabling || !state.around.powered) return;
  if (tick_ > state.enabling_until) {
    state.enabling = false;
    return;
  }
  switch (axis(i).device().drive().state()) {
    case drive::PowerState::fault:  // each level for two cycles, because process data carry only one value per cycle
      control(i, tick_ / (2 * std::max(cycle_ticks_, master_period)) % 2 == 0 ? 0x80 : 0x00);
      break;
    case drive::PowerState::switch_on_disabled: control(i, 0x06); break;
    case drive::PowerState::ready_to_switch_on: control(i, 0x07); break;
    case drive::PowerState::switched_on: control(i, 0x0F); break;
    case drive::PowerState::quick_stop_active: control(i, 0x00); break;
    case drive::PowerState::operation_enabled: state.enabling = false; break;
    default: break;
  }
}

void Life::Machine::heard(std::size_t i, const canopen::Frame& frame, line::Time at) {
  for (std::size_t byte = 0; byte < frame.length; ++byte) mix(std::uint64_t{frame.id} << 8 | frame.data[byte]);
  if (i < watches_.size()) watches_[i]->heard(frame, at);
}

}  // namespace servodrome::motion
