#include "tools/conform/cyclic_run.hpp"

#include <algorithm>
#include <cmath>

#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/cyclic/interpolation_time.hpp"
#include "catalogue/product.hpp"
#include "links/time.hpp"

namespace servodrome::master::conform {

using namespace std::chrono_literals;

namespace {

constexpr PdoObject controlword{{0x6040, 0}, 16};
constexpr PdoObject statusword_entry{{0x6041, 0}, 16};
constexpr PdoObject position_entry{{0x6064, 0}, 32};
constexpr PdoObject internal_position_entry{{0x6063, 0}, 32};
constexpr std::uint16_t own_rx_pdo = 0x1600;
constexpr std::uint16_t own_tx_pdo = 0x1A00;

}  // namespace

// ---- An EtherCAT slave whose process data lack an object that the mode needs ----

// Maps the objects into 1600h and 1A00h. The destructor restores these and the assignments.
struct CyclicRun::Slave {
  explicit Slave(Subject& its_subject) : subject(its_subject), slave(its_subject.ethercat().slave) {
    for (const std::uint16_t index : {own_rx_pdo, own_tx_pdo}) before[index] = read<std::uint32_t>(index);
    for (const std::uint16_t index : {rx_assignment, tx_assignment}) assigned[index] = read<std::uint16_t>(index);
  }
  ~Slave() {
    try {
      subject.leave_operation();
      slave.to_pre_operational();
      for (const auto& [index, entries] : before) write(index, entries);
      for (const auto& [index, entries] : assigned) write(index, entries);
    } catch (const MasterError&) {
      subject.note(
          fmt::format("{}: 1600h, 1A00h, 1C12h and 1C13h are not restored until its next power-on", subject.where()));
    }
  }
  Slave(const Slave&) = delete;
  Slave& operator=(const Slave&) = delete;

  void map(const std::vector<PdoObject>& outputs, const std::vector<PdoObject>& inputs) {
    const auto set = [&](std::uint16_t index, std::uint16_t assignment, const std::vector<PdoObject>& objects) {
      Pdo pdo{.index = index};
      for (const PdoObject& object : objects) pdo.entries.push_back({.object = object.object, .bits = object.bits});
      map_pdo(slave.coe(), pdo);
      assign_pdos(slave.coe(), assignment, std::array{index});
    };
    set(own_rx_pdo, rx_assignment, outputs);
    set(own_tx_pdo, tx_assignment, inputs);
  }

  template <typename T>
  std::vector<T> read(std::uint16_t index) {
    std::vector<T> entries;
    const auto count = slave.coe().read<std::uint8_t>(index, 0);
    for (unsigned sub = 1; sub <= count; ++sub)
      entries.push_back(slave.coe().read<T>(index, static_cast<std::uint8_t>(sub)));
    return entries;
  }
  template <typename T>
  void write(std::uint16_t index, const std::vector<T>& entries) {
    if (read<T>(index) == entries) return;
    slave.coe().write<std::uint8_t>(index, 0, 0);
    std::uint8_t sub = 0;
    for (const T entry : entries) slave.coe().write<T>(index, ++sub, entry);
    slave.coe().write<std::uint8_t>(index, 0, sub);
  }

  Subject& subject;
  EthercatSlave& slave;
  std::map<std::uint16_t, std::vector<std::uint32_t>> before;
  std::map<std::uint16_t, std::vector<std::uint16_t>> assigned;
};

// ---- Set-up ----

CyclicRun::CyclicRun(Trial& trial, const CyclicMode& mode) : trial_(trial), mode_(mode) {
  trial.units();
  trial.bring_to(PowerState::switch_on_disabled);
  trial.set_mode(mode.mode);
  // The cycles write the target of the mode only: offsets (60B1h, 60B2h) would act as well.
  Axis402 axis(trial.objects(), {.product = trial.settings().product});
  axis.take_back_targets_before_enabling();
  brake_delay_ = axis.brake_delay();
  set_gentle_ramps();
  if (mode_.other_target && !has(mode_.target)) mode_.target = *mode_.other_target;
  if (mode_.actual && !has(*mode_.actual)) mode_.actual.reset();
  shown_position_ = has(position_entry) ? position_entry : internal_position_entry;
  if (trial.subject().bus_kind() == buses::can) {
    open_can();
  } else {
    open_ethercat();
  }
  ProcessImage& image = bus_->image(0);
  axis_.emplace(image);
  target_place_ = image.output(mode_.target.object);
  position_ = image.input(shown_position_.object);
  if (mode_.actual) actual_ = image.input(mode_.actual->object);
  bus_->on_cycle([this] { cycle(); });
  try {
    run(20 * bus_->period());
  } catch (...) {
    bus_->on_cycle({});
    throw;
  }
}

// Sets the ramps of halt and quick stop. The objects are optional: a drive without profile modes may lack them.
void CyclicRun::set_gentle_ramps() {
  const auto ramp = static_cast<std::uint32_t>(Trial::whole(trial_.units().acceleration * 10.0));
  for (const std::uint16_t index : {std::uint16_t{0x6083}, std::uint16_t{0x6084}, std::uint16_t{0x6085}})
    trial_.write_if_present<std::uint32_t>(index, 0, ramp);
}

bool CyclicRun::has(const PdoObject& object) {
  return !Trial::refusal_of([&] { trial_.subject().services().upload(object.object); });
}

std::vector<PdoObject> CyclicRun::outputs() const { return {controlword, mode_.target}; }
std::vector<PdoObject> CyclicRun::inputs() const {
  std::vector<PdoObject> objects{statusword_entry, shown_position_};
  if (mode_.actual) objects.push_back(*mode_.actual);
  return objects;
}

void CyclicRun::open_can() {
  auto& [bus, sdo] = trial_.subject().can();
  const CanCyclicOptions options;
  CanDrive drive{.node_id = sdo.node_id(), .rpdos = {outputs()}, .tpdos = {{statusword_entry, shown_position_}}};
  if (mode_.actual) drive.tpdos.push_back({*mode_.actual});
  for (const catalogue::CycleObject& object : trial_.settings().product->dialect.cycle_objects) {
    drive.values.push_back({object.object, object.value_of(options.period), object.bytes});
  }
  try {
    bus_ = std::make_unique<CanCyclicBus>(bus, std::vector{drive}, options);
  } catch (const SdoError& error) {
    if (!error.from_node()) throw;
    Trial::skip(fmt::format("its PDOs do not take what the mode needs: {}", error.what()));
  }
}

void CyclicRun::open_ethercat() {
  Subject& subject = trial_.subject();
  EthercatSlave& slave = subject.ethercat().slave;
  const auto all_mapped = [](const std::vector<PdoObject>& objects, const std::vector<Pdo>& pdos) {
    return std::all_of(objects.begin(), objects.end(),
                       [&](const PdoObject& object) { return find_mapped(pdos, object.object).has_value(); });
  };
  subject.leave_operation();
  slave.to_pre_operational();
  const ProcessData data = read_process_data(slave);
  if (!all_mapped(outputs(), data.outputs) || !all_mapped(inputs(), data.inputs)) {
    const auto refusal = Trial::refusal_of([&] {
      slave_ = std::make_unique<Slave>(subject);
      slave_->map(outputs(), inputs());
    });
    if (refusal) Trial::skip("its process data do not have what the mode needs, nor take it: " + refusal->text);
  }
  trial_.objects();
  bus_ = std::make_unique<EthercatCyclicBus>(subject.ethercat().master, subject.operation(),
                                             EthercatCyclicOptions{.brake_delay = brake_delay_});
  set_interpolation_time();
  for (const catalogue::CycleObject& object : trial_.settings().product->dialect.cycle_objects) {
    const std::int64_t value = object.value_of(bus_->period());
    const auto bytes = std::as_bytes(std::span(&value, 1)).first(object.bytes);
    if (trial_.objects().upload(object.object) != std::vector(bytes.begin(), bytes.end()))
      trial_.objects().download(object.object, bytes);
  }
  // The drive may have lost the mode when it left OP.
  trial_.set_mode(mode_.mode);
}

void CyclicRun::set_interpolation_time() {
  KeptObjects& objects = trial_.objects();
  const auto value = objects.read_if_present<std::uint8_t>(0x60C2, 1);
  const auto index = objects.read_if_present<std::int8_t>(0x60C2, 2);
  const auto time = interpolation_time_of(bus_->period());
  if (!value || !index || !time || (*value == time->value && *index == time->index)) return;
  // With SYNC0 the drive may measure the time between the pulses and refuse a write, so a refusal is ignored.
  Trial::refusal_of([&] {
    objects.write<std::uint8_t>(0x60C2, 1, time->value);
    objects.write<std::int8_t>(0x60C2, 2, time->index);
  });
}

// ---- Cycles ----

double CyclicRun::period_s() const { return links::to_seconds(bus_->period()); }

void CyclicRun::cycle() {
  positions_.push_back(position());
  if (positions_.size() > cycles_of_speed + 1) positions_.erase(positions_.begin());
  const double cycles = static_cast<double>(positions_.size() - 1);
  speed_ = cycles == 0.0 ? 0.0 : (static_cast<double>(positions_.back()) - positions_.front()) / (cycles * period_s());
  if (each_ && !done_) done_ = each_();
  if (control_) axis_->set_controlword(*control_);
  target_place_->set(target_);
}

bool CyclicRun::run(Time span, const std::function<bool()>& each) {
  done_ = false;
  each_ = each;
  const Time end = bus_->now() + span;
  try {
    while (!done_ && bus_->now() < end) {
      if (!ends_ && trial_.settings().cancelled && trial_.settings().cancelled()) throw Cancelled{};
      bus_->wait(std::min(bus_->period(), end - bus_->now()));
      bus_->check();
      if (!ends_) trial_.require_on_way(position());
    }
  } catch (...) {
    each_ = nullptr;
    throw;
  }
  each_ = nullptr;
  return done_;
}

void CyclicRun::enable() {
  control_.reset();
  trial_.require_no_wrap(position());
  trial_.begin_way(position());
  const bool enabled = run(trial_.settings().patience, [this] {
    const bool there = axis_->enable();
    target_ = mode_.is_position ? position() : 0;
    return there;
  });
  trial_.require(enabled, fmt::format("enable in {}, with a target in each cycle", master::name(mode_.mode)),
                 drive::name(PowerState::operation_enabled), text_of_state(statusword()));
  control(enabled_word());
}

bool CyclicRun::comes_to_rest(Time patience) {
  const double tolerance = trial_.units().position / 2000.0 + 1.0;
  unsigned still = 0;
  std::int32_t last = position();
  unsigned cycles = 0;
  return run(patience, [&] {
    if (++cycles % 10 != 0) return false;
    still = std::abs(static_cast<double>(position()) - last) <= tolerance ? still + 1 : 0;
    last = position();
    return still >= 3;
  });
}

// ---- End ----

void CyclicRun::stop() {
  const Time longest = 2s + brake_delay_;
  if (state() == PowerState::operation_enabled) {
    control(command_word::quick_stop);
    run(longest,
        [this] { return state() != PowerState::operation_enabled && std::abs(speed_) < trial_.units().position / 50; });
  }
  control(command_word::disable_voltage);
  run(longest, [this] { return state() == PowerState::switch_on_disabled || state() == PowerState::fault; });
}

CyclicRun::~CyclicRun() {
  ends_ = true;
  try {
    stop();
  } catch (const MasterError&) {
    // Subject::settle() runs after the check and tries again.
  }
  bus_->on_cycle({});
}

}  // namespace servodrome::master::conform
