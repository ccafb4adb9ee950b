#pragma once

#include <array>
#include <exception>
#include <memory>
#include <vector>

#include "axis/cyclic/cyclic_bus.hpp"
#include "master/canopen/master.hpp"
#include "master/canopen/pdo_set_up.hpp"
#include "master/canopen/sdo_client.hpp"

namespace servodrome::master {

// Process data of one drive at each SYNC: lists of objects, one list for each PDO, 8 bytes each at most.
struct CanDrive {
  std::uint8_t node_id = 0;
  std::vector<std::vector<PdoObject>> rpdos{};  // from master to drive
  std::vector<std::vector<PdoObject>> tpdos{};
  // True: 60C2h is set to the period.
  bool sets_interpolation_time = true;
  // An object written by SDO before the exchange starts and restored afterwards, such as 2105h or a mode of operation
  // that is not mapped.
  struct Value {
    ObjectAddress object;
    std::int64_t value = 0;
    std::uint8_t bytes = 0;
  };
  std::vector<Value> values{};
};

// For cyclic synchronous position: controlword and statusword, mode, target and actual position, and actual velocity.
CanDrive synchronous_position_drive(std::uint8_t node_id);
// For all cyclic modes: the same plus target velocity and torque, actual torque and 603Fh.
CanDrive synchronous_drive(std::uint8_t node_id);
// For interpolated position (60C1h sub 1); the mode is set by SDO.
CanDrive interpolated_position_drive(std::uint8_t node_id);

struct CanCyclicOptions {
  Time period = std::chrono::milliseconds(4);  // period of SYNC
  unsigned tolerated_losses = 10;              // in a row: SYNC periods without all TPDOs before check() throws
  SdoOptions sdo{};
  // True: TPDOs may arrive until the next SYNC instead of within half a period; for a master without outputs, such as a
  // recorder.
  bool waits_whole_period = false;
  bool stops_drives = true;  // true: drives that are still enabled at the end are stopped; false: they stay enabled
  // True: no more SYNC after `tolerated_losses`, so that a bus whose rate is too low for all TPDOs has room again.
  bool ends_when_lost = false;
  std::function<void()> between{};  // called before each PDO is set up or restored; others may use the bus meanwhile
};

// Drives on a CAN bus, synchronised by SYNC. Each period: (1) SYNC, at which the drives apply the last RPDOs and sample
// and send their TPDOs; (2) the cycle, when all TPDOs have arrived or half the period has elapsed; (3) the RPDOs, which
// the next SYNC applies. The PDOs are set up by SDO. At the end they are restored, and the nodes are pre-operational.
class CanCyclicBus final : public CyclicBus {
 public:
  // Sets up the PDOs and starts the nodes and SYNC. `bus` must outlive this. Throws MasterError after restoring what it
  // changed; the same applies to an exception of a timer or a listener of the bus.
  CanCyclicBus(Bus& bus, std::vector<CanDrive> drives, const CanCyclicOptions& options = {});
  // Like close(), but ignores all exceptions.
  ~CanCyclicBus() override;

  // Sends a quick stop to drives that are still enabled (if CanCyclicOptions::stops_drives), ends SYNC and restores all
  // objects. If a drive does not answer, the others are stopped and restored all the same. If a timer or a
  // listener of the bus throws, as at Ctrl-C, the present step is repeated once. Throws the first exception at the end.
  void close();

  Time period() const override { return options_.period; }
  Time now() const override { return bus_.now(); }
  void wait(Time span) override { bus_.run_for(span); }
  std::size_t size() const override { return stations_.size(); }
  ProcessImage& image(std::size_t drive) override { return *stations_[drive]; }
  bool is_fresh(std::size_t drive) const override { return stations_[drive]->losses == 0; }
  void on_cycle(std::function<void()> action) override { action_ = std::move(action); }
  void check() const override;
  CycleCounters counters() const override { return counters_; }
  Time inputs_taken() const override { return last_sync_.value_or(bus_.now()); }
  // SDO access to the drive's objects, besides the cyclic exchange.
  SdoClient& objects(std::size_t drive) { return stations_[drive]->objects; }

 private:
  struct Station final : ProcessImage {
    struct Channel {
      PdoParameters pdo;
      std::array<std::uint8_t, 8> bytes{};
      bool arrived = false;
    };

    Station(Bus& bus, CanDrive its_drive, const SdoOptions& options)
        : drive(std::move(its_drive)), objects(bus, drive.node_id, options) {}
    std::optional<ProcessObject> output(ObjectAddress object) override { return find(rpdos, object); }
    std::optional<ProcessObject> input(ObjectAddress object) override { return find(tpdos, object); }
    std::string where() const override { return objects.where(); }
    static std::optional<ProcessObject> find(std::vector<Channel>& channels, ObjectAddress object);
    bool complete() const;

    CanDrive drive;
    SdoClient objects;
    std::vector<Channel> rpdos, tpdos;
    std::vector<PdoParameters> pdos_before;
    std::vector<CanDrive::Value> values_before;
    unsigned losses = 0;
  };

  void set_up(Station& station);
  void set_value(Station& station, const CanDrive::Value& value);
  void set_interpolation_time(Station& station);
  void set_up_pdos(Station& station, bool transmit);
  void put_back(Station& station);
  void tick();
  void receive(const Frame& frame);
  void run_cycle();
  void send_outputs();
  void send_quick_stops();
  void stop_drives(std::exception_ptr& problem);
  void wait_until_stopped(Station& station);

  Bus& bus_;
  Master master_;
  CanCyclicOptions options_;
  std::vector<std::unique_ptr<Station>> stations_;
  std::function<void()> action_;
  CycleCounters counters_;
  bool open_ = false;
  bool half_ = false;       // the next tick is in the middle of a period
  bool cycle_ran_ = false;  // in this period
  unsigned losses_ = 0;
  std::optional<Time> last_sync_;
  Bus::Subscription listening_;
  Bus::Subscription ticking_;
};

}  // namespace servodrome::master
