#pragma once

#include <array>
#include <cstdint>

#include "dictionary/entry.hpp"
#include "drive/drive.hpp"
#include "drive/tuning/inertia_estimator.hpp"
#include "drive/tuning/resonance_analysis.hpp"

// The monitoring items d00 to d31 of the JMC EC drives (ch. 8.3). They are not CoE objects: for the service port and
// the bench, item dnn is object 200Dh sub-index nn + 1.
namespace servodrome::products::jmc_ec {

inline constexpr std::uint16_t monitor_index = 0x200D;
inline constexpr std::uint8_t last_item = 31;

// Functions of the PC software (ch. 7; ch. 8.2.2, P01-04; ch. 8.3, d26). Writing 1 starts a function, reading returns
// its state.
inline constexpr std::uint16_t function_index = 0x200E;
enum class FunctionState : std::uint8_t { idle, running, done, failed };

struct MonitorObjects {
  std::array<std::int32_t, last_item + 1> items{};
  std::uint8_t recognise_inertia = 0;  // 200Eh sub 1, AF-J-L
  std::uint8_t find_resonances = 0;    // 200Eh sub 2
};

inline constexpr auto monitor_section = [] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  struct Item {
    std::uint8_t number;
    const char* name;
    const char* unit;
  };
  constexpr Item items[]{
      {0, "d00 C.PU position command", "pos"},
      {1, "d01 F.PU position feedback", "pos"},
      {2, "d02 E.PU position deviation", "pos"},
      {3, "d03 C.PE position command", "counts"},
      {4, "d04 F.PE position feedback", "counts"},
      {5, "d05 E.PE position deviation", "counts"},
      {6, "d06 C.Fr command frequency", "1000 pos/s"},
      {7, "d07 C.SP speed command", "rpm"},
      {8, "d08 F.SP motor speed", "rpm"},
      {9, "d09 C.tQ torque command", "%"},
      {10, "d10 F.tQ torque feedback", "%"},
      {11, "d11 AG.L average torque", "%"},
      {12, "d12 PE.L peak torque", "%"},
      {13, "d13 oL overload rate", "%"},
      {14, "d14 rG regeneration load rate", "%"},
      {16, "d16 I.Io inputs", ""},
      {17, "d17 o.Io outputs", ""},
      {18, "d18 AnG mechanical angle", "0.1 deg"},
      {19, "d19 HAL UVW phase", ""},
      {20, "d20 ASS absolute encoder turn", ""},
      {21, "d21 ASH absolute encoder turns", ""},
      {22, "d22 J-L inertia ratio", "%"},
      {23, "d23 dcp main circuit voltage", "V"},
      {24, "d24 Ath drive temperature", "degC"},
      {25, "d25 tiE run time", "s"},
      {26, "d26 1.Fr resonance 1", "Hz"},
      {28, "d28 2.Fr resonance 2", "Hz"},
      {30, "d30 Ai1 analogue input 1", "0.01 V"},
      {31, "d31 Ai2 analogue input 2", "0.01 V"},
  };
  std::array<Entry, std::size(items) + 4> section{};
  section[0] = highest_sub(monitor_index, ObjectCode::record, "d Monitoring items", last_item + 1);
  for (std::size_t i = 0; i < std::size(items); ++i) {
    section[i + 1] = element(monitor_index, static_cast<std::uint8_t>(items[i].number + 1), ObjectCode::record,
                             items[i].name, SERVODROME_ELEMENT(MonitorObjects, items, items[i].number), Access::ro,
                             Pdo::none, {.unit = items[i].unit, .owner = Owner::product});
  }
  const std::size_t at = std::size(items) + 1;
  section[at] = highest_sub(function_index, ObjectCode::record, "AF Functions", 2);
  section[at + 1] = element(function_index, 1, ObjectCode::record, "AF-J-L inertia recognition",
                            SERVODROME_FIELD(MonitorObjects, recognise_inertia), Access::rw, Pdo::none,
                            {.maximum = 1, .owner = Owner::product});
  section[at + 2] = element(function_index, 2, ObjectCode::record, "Search for resonances",
                            SERVODROME_FIELD(MonitorObjects, find_resonances), Access::rw, Pdo::none,
                            {.maximum = 1, .owner = Owner::product});
  for (Entry& entry : section) entry.local = true;
  return section;
}();

// Computes the items. Mean torque, load and regeneration are over the last 10 s (ch. 8.3).
class Monitor {
 public:
  // The run time d25 continues from its last value, because it counts over the life of the device.
  void power_on(double rotor_inertia_kgm2, double inertia_ratio);

  // Call this once per position-loop cycle, after the drive's tick().
  void cycle(drive::Drive& drive);

  // Returns true if a function may be started.
  static bool may_start(const drive::Drive& drive);
  void start_recognition(drive::Drive& drive);
  void start_search(drive::Drive& drive);

  // Updates the item of an entry of monitor_section. `outputs`: bit n is 1 while DOn conducts.
  void refresh(const dictionary::Entry& entry, MonitorObjects& objects, const drive::Drive& drive,
               std::uint32_t outputs) const;

 private:
  static constexpr std::size_t slots = 100;  // of 100 ms
  struct Sums {
    double torque = 0.0;  // absolute value, fraction of rated
    double square = 0.0;
    double regeneration = 0.0;  // fraction of the time
  };

  void end_slot();
  std::int32_t item(std::uint8_t number, const drive::Drive& drive, std::uint32_t outputs) const;

  std::array<Sums, slots> history_{};
  std::size_t next_ = 0;
  std::size_t filled_ = 0;
  Sums total_{};
  Sums slot_{};
  std::uint32_t cycles_ = 0;
  float peak_ = 0.0F;
  double run_time_s_ = 0.0;

  double rotor_inertia_kgm2_ = 1e-5;
  double inertia_ratio_ = 0.0;
  drive::InertiaEstimator estimator_{};
  std::uint32_t windows_ = 0;
  FunctionState recognition_ = FunctionState::idle;
  FunctionState search_ = FunctionState::idle;
  drive::ResonanceAnalysis analysis_{};
  std::array<float, 2> resonance_hz_{};
};

}  // namespace servodrome::products::jmc_ec
