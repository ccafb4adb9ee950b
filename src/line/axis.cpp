#include "line/axis.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "canopen/connection_set.hpp"
#include "canopen/node.hpp"
#include "drive/drive.hpp"
#include "ethercat/slave/slave.hpp"
#include "line/coupled_axes.hpp"
#include "links/file_medium.hpp"

namespace servodrome::line {
namespace {

// The delay of a slave controller and its two PHYs, in one direction.
constexpr Time controller_delay{600};

// The non-volatile memory of a drive without a store file. It survives a power cycle, but not the end of the line.
class KeptInMemory final : public dictionary::Medium {
 public:
  explicit KeptInMemory(std::uint32_t bytes) : memory_(new std::byte[bytes]{}), medium_({memory_.get(), bytes}) {}

  std::uint32_t size() const override { return medium_.size(); }
  bool read(std::uint32_t address, std::span<std::byte> bytes) override { return medium_.read(address, bytes); }
  bool write(std::uint32_t address, std::span<const std::byte> bytes) override { return medium_.write(address, bytes); }
  bool flush() override { return medium_.flush(); }

 private:
  std::unique_ptr<std::byte[]> memory_;
  dictionary::RamMedium medium_;
};

std::shared_ptr<dictionary::Medium> open_store(const std::string& path, std::uint32_t bytes) {
  if (path.empty()) return std::make_shared<KeptInMemory>(bytes);
  return std::make_shared<links::FileMedium>(path, bytes);
}

// NMT reset node or reset communication for this node or for all (CiA 301 7.2.8.3.1).
bool resets(const canopen::Frame& frame, std::uint8_t node_id) {
  if (frame.id != canopen::connection_set::nmt || frame.extended || frame.remote || frame.length != 2) return false;
  const auto command = static_cast<canopen::NmtCommand>(frame.data[0]);
  return (command == canopen::NmtCommand::reset_node || command == canopen::NmtCommand::reset_communication) &&
         (frame.data[1] == 0 || frame.data[1] == node_id);
}

}  // namespace

Axis::Axis(const AxisSettings& settings, const AxisBuses& buses)
    : settings_(settings),
      bus_(buses.can),
      ethercat_(buses.ethercat),
      serial_(buses.serial),
      store_(open_store(settings.store, settings.product->store_bytes)),
      plant_(settings.plant) {
  products::Settings& device_settings = device_settings_;
  device_settings.node_id = settings.node_id;
  if (bus_ != nullptr) device_settings.bit_rate = settings.bit_rate != 0 ? settings.bit_rate : bus_->bit_rate();
  device_settings.serial_number = settings.serial_number;
  device_settings.motor = settings.motor_data;
  device_settings.model = settings_.model;
  device_settings.store = store_.get();
  device_settings.description = data_sheet(*settings.product);
  if (serial_ != nullptr) {
    device_settings.serial = {settings.serial->station, serial_->format(), settings.serial->protocol,
                              buses.serial_silence};
    serial_port_ = serial_->attach(station_, links::SerialSender::drive);
    serial_format_ = serial_->format();
  }
  if (ethercat_ != nullptr) {
    device_settings.ethercat = {settings.ethercat->alias,
                                static_cast<std::int32_t>(std::lround(settings.ethercat->oscillator_ppm * 1000.0)),
                                settings.ethercat->sync_error_limit};
  }
  device_ = settings.product->make(device_settings);
  if (bus_ != nullptr) port_ = bus_->attach(*this, 1);  // depth of the queue; other frames wait in the device
  if (ethercat_ != nullptr) {
    const Time hop = controller_delay + settings.ethercat->cable;
    ethercat_slave_ = device_->ethercat_slave();
    // The drive acts once per tick. If several frames come within one tick, only the last one has an effect.
    ethercat_slave_->sample_process_data_every(tick_length);
    slave_ = ethercat_->attach(ethercat_station_, {hop, hop});
  }
  plant_.sample(feedback_);
  power_on(Time{});
}

Axis::~Axis() {
  if (bus_ != nullptr) bus_->detach(port_);
  if (ethercat_ != nullptr) ethercat_->detach(slave_);
  if (serial_ != nullptr) serial_->detach(serial_port_);
}

void Axis::run_to(std::int64_t tick) { pair_ != nullptr ? pair_->run_to(tick) : run_alone_to(tick); }

// Interrupts the ticks only where samples are due, so an axis without taps has no cost per tick.
void Axis::run_alone_to(std::int64_t tick) {
  while (samples_due_ <= tick) {
    run_ticks(samples_due_);
    take_samples();
  }
  run_ticks(tick);
}

void Axis::take_samples() {
  samples_due_ = no_tick;
  for (Tap* tap : taps_) {
    if (tap->due() == tick_) tap->take();
    samples_due_ = std::min(samples_due_, tap->due());
  }
}

void Axis::attach(Tap& tap) {
  taps_.push_back(&tap);
  samples_due_ = std::min(samples_due_, tap.due());
}

void Axis::detach(Tap& tap) {
  std::erase(taps_, &tap);
  samples_due_ = no_tick;
  for (const Tap* other : taps_) samples_due_ = std::min(samples_due_, other->due());
}

// Polls the slave for each event that its own clock causes up to and including `until`; usually there is none.
inline void Axis::poll_slave(Time until) {
  if (until >= ethercat_slave_->quiet_until()) poll_due_slave(until);
}

// When the device must be polled next. If a poll returns a deadline that has already passed, the next poll follows one
// tick later, so that polling cannot loop forever. A frame may set a deadline that lies before the time of the frame.
// Such a deadline is due at the time of the frame, even if the axis has not yet run up to this time.
Time Axis::next_poll() const {
  Time due = device_->next_deadline();
  if (ethercat_slave_ != nullptr) due = std::max(due, device_->ethercat_controller()->now());
  return due <= last_poll_ ? last_poll_ + tick_length : due;
}

void Axis::poll_due_slave(Time until) {
  while (until >= ethercat_slave_->quiet_until()) {
    const Time due = next_poll();
    if (due > until) return;
    last_poll_ = due;
    device_->poll(due);
  }
}

void Axis::run_ticks(std::int64_t tick) {
  if (!powered_) {
    for (; tick_ < tick; ++tick_) plant_.step(actuation_, feedback_);
    return;
  }
  drive::Drive& drive = device_->drive();
  while (tick_ < tick) {
    if (ethercat_slave_ != nullptr) poll_slave((tick_ + 1) * tick_length);
    plant_.step(actuation_, feedback_);
    ++tick_;
    if (drive.tick(feedback_, actuation_)) {
      if (last_cycle_ != unknown) cycle_ticks_ = tick_ - last_cycle_;
      last_cycle_ = tick_;
      const Time now = tick_ * tick_length;
      device_->cycle(now);
      send_waiting(now);
    }
  }
}

Time Axis::next_appearance(Time now) const {
  if (!powered_) return links::never;
  // Until two cycles have been seen, the cycle time is unknown and any tick may end a cycle.
  const bool known = last_cycle_ != unknown && cycle_ticks_ != unknown;
  const std::int64_t cycle = known ? std::max(last_cycle_ + cycle_ticks_, tick_ + 1) : tick_ + 1;
  return std::min(cycle * tick_length, std::max(next_poll(), now));
}

// The line may not have run up to the frame yet, so the slave runs its own axis up to it. Exception: process data that
// can wait until the drive samples them.
Time Axis::EthercatStation::frame_passed(Time at) {
  if (!axis_.ethercat_slave_->puts_off(at)) {
    axis_.run_to(at / tick_length);
    axis_.last_poll_ = at;
    axis_.device_->poll(at);
  }
  return axis_.device_->next_deadline();
}

void Axis::poll(Time now) {
  if (!powered_) return;
  if (ethercat_slave_ != nullptr) {
    poll_slave(now);
  } else {
    poll_node(now);
  }
}

void Axis::poll_node(Time now) {
  if (now == last_poll_ || device_->next_deadline() > now) return;
  last_poll_ = now;
  device_->poll(now);
  send_waiting(now);
}

void Axis::send_waiting(Time now) {
  canopen::Frame frame;
  if (bus_ == nullptr) {  // there is no CAN bus: discards the frames
    while (device_->take(frame)) {
    }
  } else {
    const canopen::WaitingFrame* next = next_frame(now);
    bus_->offer(port_, next != nullptr ? &next->frame : nullptr, next != nullptr ? next->since : now);
    follow_bit_rate();
  }
  if (serial_ != nullptr) follow_serial_format();
}

// Returns the frame that the drive sends next, and removes those before it that the interposer takes. A frame that is
// already on the wire has passed the interposer.
const canopen::WaitingFrame* Axis::next_frame(Time now) {
  const canopen::WaitingFrame* next = device_->next_frame();
  if (can_interposer_ == nullptr || bus_->sending(port_)) return next;
  while (next != nullptr && !can_interposer_->lets_out(next->frame, now)) {
    const canopen::Frame taken = next->frame;
    device_->frame_sent(taken);
    next = device_->next_frame();
  }
  return next;
}

void Axis::follow_bit_rate() {
  const std::uint32_t bit_rate = device_->bit_rate();
  if (bit_rate == port_bit_rate_) return;
  port_bit_rate_ = bit_rate;
  bus_->set_port_bit_rate(port_, bit_rate);
}

void Axis::follow_serial_format() {
  const products::SerialPort* port = device_->serial_port();
  if (port == nullptr || port->format() == serial_format_) return;
  serial_format_ = port->format();
  serial_->set_format(serial_port_, serial_format_);
}

std::shared_ptr<products::Device> Axis::stored_device() const {
  struct Stored {
    explicit Stored(std::uint32_t bytes) : memory(bytes) {}
    KeptInMemory memory;
    std::shared_ptr<products::Device> device;
  };
  const auto stored = std::make_shared<Stored>(store_->size());
  std::vector<std::byte> bytes(store_->size());
  if (store_->read(0, bytes)) stored->memory.write(0, bytes);
  products::Settings settings = device_settings_;
  settings.store = &stored->memory;
  stored->device = settings_.product->make(settings);
  stored->device->power_on(feedback_, Time{});
  return {stored, stored->device.get()};
}

void Axis::power_on(Time now) {
  if (powered_) return;
  powered_ = true;
  ++starts_;
  last_cycle_ = unknown;
  last_poll_ = Time{-1};
  if (bus_ != nullptr) bus_->set_participation(port_, links::Participation::normal);
  if (ethercat_ != nullptr) ethercat_->set_powered(slave_, true, now);
  plant_.sample(feedback_);  // the plant may have changed while the power was off
  device_->power_on(feedback_, now);
  for (const drive::Cause cause : injected_) device_->drive().inject(cause, true);
  send_waiting(now);
}

void Axis::power_off(Time now) {
  if (!powered_) return;
  powered_ = false;
  device_->power_off();
  actuation_ = drive::Actuation{};
  if (bus_ != nullptr) bus_->set_participation(port_, links::Participation::off);
  if (ethercat_ != nullptr) ethercat_->set_powered(slave_, false, now);
  if (serial_ != nullptr) serial_->discard(serial_port_);
  plant_.discharge_dc_link();
}

void Axis::on_frame(const canopen::Frame& frame, Time at) {
  canopen::Frame received = frame;
  if (can_interposer_ == nullptr || can_interposer_->lets_in(received, at)) deliver(received, at);
}

void Axis::deliver(const canopen::Frame& frame, Time now) {
  if (!powered_) return;
  if (resets(frame, device_->node_id())) ++starts_;
  device_->receive(frame, now);
  send_waiting(now);
}

void Axis::on_sent(const canopen::Frame& frame, std::uint32_t, Time at) {
  device_->frame_sent(frame);
  if (can_interposer_ != nullptr) can_interposer_->sent(frame, at);
  send_waiting(at);
}

void Axis::on_error_state(links::ErrorState state, Time at) {
  if (!powered_) return;
  constexpr std::array states{canopen::BusState::error_active, canopen::BusState::error_passive,
                              canopen::BusState::bus_off};
  device_->can_node()->bus_state(states[static_cast<std::size_t>(state)], at);
  send_waiting(at);
}

void Axis::Station::receive(std::uint8_t character, bool intact, Time at) {
  if (products::SerialPort* port = axis_.serial_port()) {
    port->receive(character, intact, at);
    axis_.send_waiting(at);
  }
}

void Axis::Station::poll(Time now) {
  if (products::SerialPort* port = axis_.serial_port()) {
    port->poll(now);
    axis_.send_waiting(now);
  }
}

Time Axis::Station::next_deadline() const {
  const products::SerialPort* port = axis_.serial_port();
  return port != nullptr ? port->next_deadline() : links::never;
}

std::span<const std::uint8_t> Axis::Station::take() {
  products::SerialPort* port = axis_.serial_port();
  return port != nullptr ? port->take() : std::span<const std::uint8_t>{};
}

bool Axis::place(std::int64_t position_counts) {
  // The drive switches the motor on in the tick before the plant sees it.
  if (powered_ && (actuation_.pwm_enabled || device_->drive().energised())) return false;
  plant_.set_position_counts(position_counts);
  if (pair_ != nullptr) pair_->relax();
  plant_.sample(feedback_);
  if (powered_) device_->drive().displaced(feedback_);
  return true;
}

void Axis::force_input(int wire, std::optional<bool> level) {
  if (level) {
    plant_.force_input(wire, *level);
    forced_inputs_[wire] = *level;
  } else {
    plant_.release_input(wire);
    forced_inputs_.erase(wire);
  }
}

void Axis::inject(drive::Cause cause, bool present) {
  if (present) {
    injected_.insert(cause);
  } else {
    injected_.erase(cause);
  }
  device_->drive().inject(cause, present);
}

}  // namespace servodrome::line
