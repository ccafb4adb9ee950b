#pragma once

#include <functional>

#include "host/cyclic/can_cyclic_bus.hpp"
#include "host/cyclic/cyclic_axis.hpp"
#include "host/cyclic/cyclic_bus.hpp"
#include "host/tuning/drive_gains.hpp"

// Measures the velocity loop of one drive through whatever bus, by process data.
namespace servodrome::host::tuning {

// What is exchanged with a CANopen drive for it: one PDO each way. That it stops by itself when the cable is pulled is
// for a MasterWatch.
CanDrive tuning_drive(const ObjectClient& objects, const TuningDialect& dialect);

struct TunerOptions {
  double travel_revolutions = 4.0;  // to the positive side of where the axis stands; what goes beyond ends it
  double torque_limit = 0.6;        // share of TuningDialect::full_torque
  double seconds = 10.0;            // of a measurement, half of it in each direction
  double lowest_hz = 2.0;           // of the excitation
  std::size_t drive = 0;            // of the bus
  std::function<bool()> cancelled{};
  std::function<void(const char* doing, double share)> progress{};
};

// What a measurement found. Frequencies are the same in all responses.
struct Measurement {
  std::vector<ResponsePoint> velocity_by_command{};
  std::vector<ResponsePoint> torque_by_command{};
  std::vector<ResponsePoint> velocity_by_torque{};
  std::vector<double> frequencies_hz{};  // of those below, as far as the coherence is good
  std::vector<Complex> open_loop{};      // identified controller times measured mechanics
  std::vector<Complex> closed_loop{};    // measured, without the delay of command and bus
  Margins margins{};
  std::optional<double> bandwidth_hz{};
  Mechanics mechanics{};
  IdentifiedController controller{};
  double friction = 0.0;       // torque at the speed of the measurement: half the difference of both directions
  double constant_load = 0.0;  // half their sum: gravity
  double speed_rad_s = 0.0;
  double least_coherence = 1.0;  // of velocity by command, below twice the bandwidth
  std::uint64_t lost_cycles = 0;
};

// What is to be said of a measurement during which cycles were lost, behind another sentence; "" of 0.
std::string text_of_losses(std::uint64_t cycles);

struct StepResponse {
  double sample_s = 0.0;
  std::vector<double> velocity{};  // 0 before, 1 the new velocity; begins with the command
  double rise_s = 0.0;             // 10 % to 90 %
  double overshoot = 0.0;          // share of the step
  double settling_s = 0.0;         // for good within 5 %
};

// Enables the axis, moves it slowly to and fro, and puts it at rest and without power again. All calls throw HostError
// on a fault, a limit, lost data, and Cancelled when asked to; whatever leaves them, the axis is braked and disabled as
// far as the drive is still heard.
class Tuner {
 public:
  // All outlive this.
  Tuner(CyclicBus& bus, ObjectClient& objects, const TuningDialect& dialect, const TuningUnits& units,
        const TunerOptions& options);
  ~Tuner();
  Tuner(const Tuner&) = delete;
  Tuner& operator=(const Tuner&) = delete;

  // `notch`: what the drive has switched on now.
  Measurement measure(double bandwidth_hz, const std::optional<NotchSetting>& notch);
  StepResponse step();

 private:
  struct Record {
    std::vector<double> command, differences, torque;
  };

  void enable();
  void disable() noexcept;
  void cycle();
  // Lets time pass; throws what ended it.
  void wait(double seconds);
  template <typename Done>
  void wait_until(const Done& done, double timeout_s, const std::string& what);
  void move_at(double velocity_rad_s);
  Record record(const Multisine& excitation, unsigned periods, double bias_rad_s);
  std::uint64_t lost_cycles() const;  // since the bus runs
  // With a word on cycles lost since the axis was enabled.
  [[noreturn]] void fail(const std::string& happened, const std::string& remedy) const;

  CyclicBus& bus_;
  ObjectClient& objects_;
  const TuningDialect& dialect_;
  TuningUnits units_;
  TunerOptions options_;
  double sample_s_;
  CyclicAxis axis_;
  ProcessObject target_velocity_;
  ProcessObject position_;
  ProcessObject torque_;

  // Written by the cycle.
  bool controls_ = false;  // the axis is enabled, and has to stay so
  std::string problem_;    // what ended it; the axis is being braked
  std::string remedy_;
  bool has_position_ = false;
  std::int32_t last_position_ = 0;
  double travelled_ = 0.0;  // rad, since enabled
  double velocity_ = 0.0;   // rad/s, mean of the last period
  double torque_now_ = 0.0;
  unsigned over_torque_ = 0;
  unsigned losses_ = 0;            // cycles in a row
  std::uint64_t lost_before_ = 0;  // lost_cycles() when it was enabled
  double command_ = 0.0;           // rad/s, as sent, rounded
  std::function<double()> command_of_cycle_;
};

}  // namespace servodrome::host::tuning
