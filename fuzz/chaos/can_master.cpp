#include <algorithm>
#include <deque>

#include "axis/axis402.hpp"
#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/motion_group.hpp"
#include "catalogue/product.hpp"
#include "links/can/client.hpp"
#include "master/canopen/sdo_client.hpp"
#include "masters.hpp"

namespace servodrome::chaos {
namespace {

using namespace std::chrono_literals;
using master::Axis402;
using master::MasterError;
using master::MotionProfile;
using master::OperationMode;
using master::PowerState;

constexpr Time answer_timeout = 40ms;
constexpr Time motion_timeout = 3s;
constexpr std::uint16_t target_reached = 1U << 10;

class Station {
 public:
  Station(World& world, master::Bus& bus, Subject& subject, Random& random)
      : world_(world),
        subject_(subject),
        random_(random),
        objects_(bus, subject.axis->device().node_id(), {.timeout = answer_timeout, .retries = 2}),
        axis_(objects_, {.state_timeout = 1s, .product = &catalogue::product_of(subject.variant->product->name)}) {}

  // Does one step towards operation, or gives one command.
  void visit() {
    try {
      const master::AxisStatus status = axis_.status();
      if (status.state() == PowerState::fault) axis_.reset_fault();
      if (status.state() != PowerState::operation_enabled) axis_.enable();
      if (status.mode == static_cast<std::int8_t>(OperationMode::profile_velocity)) axis_.stop();
      if (status.state() == PowerState::operation_enabled && (status.statusword & target_reached) == 0 && moves_) {
        if (world_.line().now() < moves_until_) return;  // a move is in progress
        axis_.stop();
      }
      command();
      world_.works(subject_);
    } catch (const MasterError& error) {
      world_.count(error);
      moves_ = false;
    }
  }

  // Disables the axis, so that a group can use it.
  bool release() {
    try {
      if (axis_.state() == PowerState::fault) axis_.reset_fault();
      axis_.stop();
      axis_.disable();
      moves_ = false;
      return true;
    } catch (const MasterError& error) {
      world_.count(error);
      return false;
    }
  }
  Subject& subject() { return subject_; }

  // Brings the axis into operation and moves it by a revolution.
  void finish() {
    for (int attempt = 0; attempt < 3; ++attempt) {
      try {
        if (axis_.state() == PowerState::fault) axis_.reset_fault();
        axis_.enable();
        axis_.move_by(position(1.0), profile(5.0, 50.0), 10s);
        return;
      } catch (const MasterError& error) {
        last_ = error.what();
      }
    }
    world_.finding("the last move failed: " + last_);
  }

 private:
  std::int32_t position(double revolutions) const {
    return static_cast<std::int32_t>(subject_.variant->position(revolutions));
  }
  MotionProfile profile(double velocity_rps, double acceleration_rps2) const {
    const auto acceleration = static_cast<std::uint32_t>(subject_.variant->acceleration(acceleration_rps2));
    return {static_cast<std::uint32_t>(subject_.variant->velocity(velocity_rps)), acceleration, acceleration};
  }
  double speed_rps() { return 1.0 + random_.unit() * 0.4 * subject_.variant->max_speed_rpm / 60.0; }

  void command() {
    moves_ = false;
    const std::int64_t choice = random_.below(100);
    if (choice < 70) {
      const double revolutions = 8.0 * random_.unit() - 4.0;
      axis_.set_mode(OperationMode::profile_position);
      axis_.start_move_by(position(revolutions), profile(speed_rps(), 20.0 + 180.0 * random_.unit()));
      moves_ = true;
      moves_until_ = world_.line().now() + motion_timeout + 4s;
      ++subject_.record.moves;
    } else if (choice < 80) {
      const double velocity = (random_.chance(50) ? 1.0 : -1.0) * speed_rps();
      axis_.run_at(static_cast<std::int32_t>(subject_.variant->velocity(velocity)), profile(speed_rps(), 100.0),
                   motion_timeout);
      ++subject_.record.moves;
    } else if (choice < 87) {
      axis_.stop();
    } else if (choice < 94) {
      axis_.quick_stop();
    } else {
      axis_.disable();
    }
  }

  World& world_;
  Subject& subject_;
  Random& random_;
  master::SdoClient objects_;
  Axis402 axis_;
  bool moves_ = false;
  Time moves_until_{};
  std::string last_;
};

// Exchanges process data with a few drives by SYNC for some seconds. PDOs are mapped by SDO and restored at the end. If
// a drive is lost, the group ends.
class Group {
 public:
  static constexpr std::size_t most = 4;

  Group(World& world, master::Bus& bus, std::deque<Station>& stations, Random& random)
      : world_(world), bus_(bus), stations_(stations), random_(random) {}

  void run() {
    std::vector<Subject*> members = choose();
    if (members.empty()) return;
    ++world_.groups;
    std::vector<master::CanDrive> drives;
    for (Subject* member : members) drives.push_back(drive_of(*member));
    try {
      master::CanCyclicBus cyclic(bus_, drives, {.period = period, .sdo = {.timeout = answer_timeout, .retries = 2}});
      master::MotionGroup axes(cyclic);
      for (const Time end = bus_.now() + duration; bus_.now() < end && !world_.stopping;) {
        cyclic.check();
        for (std::size_t i = 0; i < members.size(); ++i) {
          if (command_axis(*members[i], axes.axis(i), random_)) world_.works(*members[i]);
        }
        axes.wait(4 * period);
      }
      cyclic.close();
    } catch (const MasterError& error) {
      world_.count(error);
    }
  }

 private:
  static constexpr Time period = 4ms;  // the longest period of ismc
  static constexpr Time duration = 6s;

  std::vector<Subject*> choose() {
    std::vector<Subject*> members;
    for (std::size_t tries = 0; tries < 2 * most && members.size() < most; ++tries) {
      Station& station =
          stations_[static_cast<std::size_t>(random_.below(static_cast<std::int64_t>(stations_.size())))];
      Subject& subject = station.subject();
      const bool has_mode = subject.variant->has(drive::Mode::cyclic_sync_position);
      if (!has_mode || std::find(members.begin(), members.end(), &subject) != members.end()) continue;
      if (station.release()) members.push_back(&subject);
    }
    return members;
  }
  static master::CanDrive drive_of(const Subject& subject) {
    master::CanDrive drive = master::synchronous_position_drive(subject.axis->device().node_id());
    for (const catalogue::CycleObject& object :
         catalogue::product_of(subject.variant->product->name).dialect.cycle_objects) {
      drive.values.push_back({object.object, object.value_of(period), object.bytes});
    }
    return drive;
  }

  World& world_;
  master::Bus& bus_;
  std::deque<Station>& stations_;
  Random& random_;
};

}  // namespace

void run_can_master(World& world, std::size_t number, links::VirtualClock& clock) {
  master::Bus bus(std::make_unique<links::MemoryCanClient>(world.line().buses()[number]->bus, clock), "mem:", &clock);
  Random random(world.options().seed, 100 + number);
  std::deque<Station> stations;
  for (Subject& subject : world.subjects()) {
    if (subject.bus == number) stations.emplace_back(world, bus, subject, random);
  }
  if (stations.empty()) return;
  bus.run_for(100ms);
  while (!world.stopping) {
    for (Station& station : stations) {
      station.visit();
      if (world.stopping) break;
    }
    if (number % 2 == 1 && !world.stopping) Group(world, bus, stations, random).run();
    bus.run_for(5ms);
  }
  for (Station& station : stations) station.finish();
}

}  // namespace servodrome::chaos
