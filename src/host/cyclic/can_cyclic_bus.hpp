#pragma once

#include <array>
#include <memory>
#include <vector>

#include "host/canopen/master.hpp"
#include "host/canopen/pdo_set_up.hpp"
#include "host/canopen/sdo_client.hpp"
#include "host/cyclic/cyclic_bus.hpp"

namespace servodrome::host {

// What a drive exchanges at each SYNC: lists of objects, one for each PDO, 8 bytes each at most.
struct CanDrive {
  std::uint8_t node_id = 0;
  std::vector<std::vector<PdoObject>> rpdos{};  // master to drive
  std::vector<std::vector<PdoObject>> tpdos{};
  // 60C2h is set to the period.
  bool sets_interpolation_time = true;
  // Written by SDO before the exchange starts, and put back after: a mode of operation that is not mapped, 2105h, ...
  struct Value {
    ObjectAddress object;
    std::int64_t value = 0;
    std::uint8_t bytes = 0;
  };
  std::vector<Value> values{};
};

// Cyclic synchronous position: control- and statusword, mode, position each way, and velocity.
CanDrive synchronous_position_drive(std::uint8_t node_id);
// The same and target velocity and torque, actual torque and 603Fh: what all cyclic modes need.
CanDrive synchronous_drive(std::uint8_t node_id);
// Interpolated position (60C1h sub 1), the mode set by SDO.
CanDrive interpolated_position_drive(std::uint8_t node_id);

struct CanCyclicOptions {
  Time period = std::chrono::milliseconds(4);  // of SYNC
  unsigned tolerated_losses = 10;              // SYNC periods in a row without all TPDOs, until check() throws
  SdoOptions sdo{};
  // TPDOs may come until the next SYNC, instead of half the period: for a master that sends nothing after them.
  bool waits_whole_period = false;
  bool stops_drives = true;  // that are still enabled at the end; false: they stay as they are
};

// Drives on a CAN bus, in step with SYNC. Each period: SYNC, to which drives act on the last RPDOs and send what they
// see; when all TPDOs have come, or half the period has gone, the cycle runs; then the RPDOs, which the next SYNC makes
// effective. PDOs are set up by SDO and, when this ends, put back as they were, with the nodes pre-operational.
class CanCyclicBus final : public CyclicBus {
 public:
  // Sets PDOs up, starts the nodes and SYNC. `bus` outlives this. Throws HostError; what was changed is put back then.
  CanCyclicBus(Bus& bus, std::vector<CanDrive> drives, const CanCyclicOptions& options = {});
  // As close(), and says nothing.
  ~CanCyclicBus() override;

  // Quick stop for drives that are still enabled (CanCyclicOptions::stops_drives), then SYNC ends and everything is put
  // back. Throws HostError if a drive does not take it.
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
  // The drive's objects, beside the exchange.
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
  void stop_drives();

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

}  // namespace servodrome::host
