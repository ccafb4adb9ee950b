#pragma once

#include <functional>

#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/cyclic_axis.hpp"
#include "axis/cyclic/cyclic_bus.hpp"
#include "catalogue/product.hpp"
#include "tools/tuning/drive_gains.hpp"

// Measures the velocity loop of one drive by process data, on any bus.
namespace servodrome::master::tuning {

// Process data for a CANopen drive: one PDO in each direction. It does not stop the axis if the cable is pulled; use a
// MasterWatch for that.
CanDrive tuning_drive(const ObjectClient& objects, const catalogue::TuningDialect& dialect);

struct TunerOptions {
  double travel_revolutions = 4.0;  // in positive direction from the present position; a longer way ends the
                                    // measurement
  double torque_limit = 0.6;        // share of catalogue::TuningDialect::full_torque
  double seconds = 10.0;            // of a measurement, half of it in each direction
  double lowest_hz = 2.0;           // of the excitation
  std::size_t drive = 0;            // number of the drive on the bus
  std::function<bool()> cancelled{};
  std::function<void(const char* doing, double share)> progress{};
};

// Result of a measurement. All responses have the same frequencies.
struct Measurement {
  std::vector<ResponsePoint> velocity_by_command{};
  std::vector<ResponsePoint> torque_by_command{};
  std::vector<ResponsePoint> velocity_by_torque{};
  std::vector<double> frequencies_hz{};  // of the following, those with good coherence
  std::vector<Complex> open_loop{};      // measured, without the delays outside of the loop
  std::vector<Complex> closed_loop{};    // the same
  Margins margins{};
  std::optional<double> bandwidth_hz{};
  Mechanics mechanics{};
  VelocityController controller{};  // identified
  double friction = 0.0;            // torque at the speed of the measurement: half the difference of the directions
  double constant_load = 0.0;       // half their sum: gravity
  double speed_rad_s = 0.0;
  double least_coherence = 1.0;  // of velocity/command, below twice the bandwidth
  std::uint64_t lost_cycles = 0;
};

// A sentence about lost cycles, to append to a message; "" for 0.
std::string text_of_losses(std::uint64_t cycles);

struct StepResponse {
  double sample_s = 0.0;
  std::vector<double> velocity{};  // 0 before the step, 1 after it; starts with the command
  double rise_s = 0.0;             // 10 % to 90 %
  double overshoot = 0.0;          // relative to the step
  double settling_s = 0.0;         // time until it stays within 5 %
};

// Enables the axis, moves it slowly back and forth, and then stops and disables it. All calls throw MasterError on a
// fault, a limit or lost data, and Cancelled on request. At the end of each call, also after an error, the axis is
// braked and disabled, if the drive can be reached.
class Tuner {
 public:
  // All arguments must outlive this.
  Tuner(CyclicBus& bus, ObjectClient& objects, const catalogue::Product& product, const TuningUnits& units,
        const TunerOptions& options);
  ~Tuner();
  Tuner(const Tuner&) = delete;
  Tuner& operator=(const Tuner&) = delete;

  // `notch`: the notch filter that is active in the drive now.
  Measurement measure(double bandwidth_hz, const std::optional<NotchSetting>& notch);
  StepResponse step();
  // Throws Cancelled if the caller has asked for the end.
  void leave_if_cancelled() const;

 private:
  struct Record {
    std::vector<double> command, differences, torque;
  };

  void enable();
  void disable() noexcept;
  void cycle();
  // Waits; throws the problem that stopped the axis, if any.
  void wait(double seconds);
  template <typename Done>
  void wait_until(const Done& done, double timeout_s, const std::string& what);
  void move_at(double velocity_rad_s);
  Record record(const Multisine& excitation, unsigned periods, double bias_rad_s);
  std::uint64_t lost_cycles() const;  // since the start of the bus
  std::string shown_statusword() const;
  void explain_by_limit_switch();
  // Throws; the text mentions cycles lost since the axis was enabled.
  [[noreturn]] void fail(const std::string& happened, const std::string& remedy) const;

  CyclicBus& bus_;
  ObjectClient& objects_;
  const catalogue::Product& product_;
  const catalogue::TuningDialect& dialect_ = product_.tuning;
  TuningUnits units_;
  TunerOptions options_;
  double sample_s_;
  CyclicAxis axis_;
  ProcessObject target_velocity_;
  ProcessObject position_;
  ProcessObject torque_;

  // The cycle writes these members.
  bool controls_ = false;  // the axis is enabled and must stay enabled
  std::string problem_;    // why the axis is being braked; empty: no problem
  std::string remedy_;
  bool has_position_ = false;
  std::int32_t last_position_ = 0;
  double travelled_ = 0.0;  // rad, since it was enabled
  double asked_ = 0.0;      // rad, commanded since the last check whether the axis follows
  double moved_ = 0.0;      // rad, since the same time
  unsigned looked_cycles_ = 0;
  double velocity_ = 0.0;  // rad/s, mean over the last period
  double torque_now_ = 0.0;
  unsigned over_torque_ = 0;
  unsigned losses_ = 0;            // consecutive lost cycles
  std::uint64_t lost_before_ = 0;  // lost_cycles() when it was enabled
  double command_ = 0.0;           // rad/s, as sent, rounded
  std::function<double()> command_of_cycle_;
};

}  // namespace servodrome::master::tuning
