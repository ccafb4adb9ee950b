#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/cyclic/motion_group.hpp"
#include "links/ethercat/memory_client.hpp"
#include "masters.hpp"

namespace servodrome::chaos {
namespace {

using namespace std::chrono_literals;
using master::EthercatSlave;
using master::MasterError;
using master::MotionAxis;

constexpr Time period = 4ms;
constexpr Time between_looks = 40ms;
constexpr Time before_restart = 100ms;

// Operates the segment from its scan until an error.
class Session {
 public:
  Session(World& world, const std::vector<Subject*>& subjects, links::VirtualClock& clock, Random& random)
      : world_(world),
        subjects_(subjects),
        random_(random),
        master_(std::make_unique<links::MemoryEthercatClient>(world.line().ethercat_buses().front()->bus, clock)),
        found_(scan(master_, subjects.size())) {
    for (const master::FoundSlave& one : found_) slaves_.push_back(std::make_unique<EthercatSlave>(master_, one));
    for (const auto& slave : slaves_) {
      members_.push_back(slave.get());
      slave->to_pre_operational();
      master::set_up_cyclic_axis(*slave, {.period = period});
    }
    operation_.emplace(master_, found_, members_, master::OperationOptions{.cyclic = {.period = period}});
    bus_.emplace(master_, *operation_);
    group_.emplace(*bus_);
  }

  void run() {
    while (!world_.stopping) {
      bus_->check();
      for (std::size_t i = 0; i < subjects_.size(); ++i) {
        if (command_axis(*subjects_[i], group_->axis(i), random_)) world_.works(*subjects_[i]);
      }
      group_->wait(between_looks);
    }
  }

  // Brings all axes into operation and moves them by a revolution.
  void finish() {
    group_->reset_faults(10s);
    group_->enable(10s);
    for (Subject* subject : subjects_) world_.works(*subject);
    for (std::size_t i = 0; i < subjects_.size(); ++i) {
      MotionAxis& axis = group_->axis(i);
      const double target = axis.set_point().position + subjects_[i]->variant->position(1.0);
      if (!axis.move_to(target, 0.0, limits_of(*subjects_[i], 5.0, 50.0)))
        world_.finding("the last move was not accepted: " + axis.axis().where());
    }
    if (!group_->wait_until([&] { return group_->all_done(); }, 10s)) world_.finding("the last moves do not end");
  }

 private:
  static std::vector<master::FoundSlave> scan(master::EthercatMaster& master, std::size_t count) {
    std::vector<master::FoundSlave> found = master::scan_slaves(master);
    if (found.size() != count) throw MasterError("slaves are missing", "segment", "connect them");
    return found;
  }
  World& world_;
  const std::vector<Subject*>& subjects_;
  Random& random_;
  master::EthercatMaster master_;
  std::vector<master::FoundSlave> found_;
  std::vector<std::unique_ptr<EthercatSlave>> slaves_;
  std::vector<EthercatSlave*> members_;
  std::optional<master::EthercatOperation> operation_;
  std::optional<master::EthercatCyclicBus> bus_;
  std::optional<master::MotionGroup> group_;
};

}  // namespace

void run_ethercat_master(World& world, links::VirtualClock& clock) {
  Random random(world.options().seed, 200);
  std::vector<Subject*> subjects;
  for (Subject& subject : world.subjects()) {
    if (subject.bus == segment) subjects.push_back(&subject);
  }
  if (subjects.empty()) return;
  std::string last;
  for (int last_attempts = 0; last_attempts < 10;) {
    try {
      Session session(world, subjects, clock, random);
      session.run();
      ++last_attempts;
      session.finish();
      return;
    } catch (const MasterError& error) {
      last = error.what();
      world.count(error);
      ++world.restarts;
    }
    if (world.stopping) ++last_attempts;
    clock.run_until(clock.now() + before_restart);
  }
  world.finding("the last moves failed: " + last);
}

}  // namespace servodrome::chaos
