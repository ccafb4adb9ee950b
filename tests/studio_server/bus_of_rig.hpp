#pragma once

#include <thread>

#include "axis/axis_rig.hpp"
#include "studio/drive_bus.hpp"

namespace servodrome::studio {

// The virtual drives of a rig as an open CAN bus; their time advances while the bus waits.
class BusOfRig : public OpenBus {
 public:
  // real_time: a wait also lasts as long in real time, so that a bus with a thread of its own leaves time to others.
  enum class Pace : std::uint8_t { virtual_time, real_time };
  BusOfRig(master::test::AxisRig& rig, Pace pace) : rig_(rig), pace_(pace) {}

  std::vector<master::ObjectClient*> drives() override {
    std::vector<master::ObjectClient*> drives;
    for (const auto& client : rig_.clients) drives.push_back(client.get());
    return drives;
  }
  void back(std::size_t) override {}
  void release(std::size_t) override {}
  void wait(master::Time span) override {
    rig_.objects().wait(span);
    if (pace_ == Pace::real_time) std::this_thread::sleep_for(span);
  }
  void while_waiting(std::function<bool()>) override {}
  Cyclic open_cyclic(std::size_t, const master::CanDrive&) override {
    throw master::MasterError("there are no process data", "mem:", "");
  }
  std::unique_ptr<master::CanCyclicBus> record(const std::vector<master::CanDrive>& drives, master::Time period,
                                               const std::function<void()>& between) override {
    return std::make_unique<master::CanCyclicBus>(*rig_.can, drives,
                                                  master::CanCyclicOptions{.period = period,
                                                                           .tolerated_losses = 100,
                                                                           .waits_whole_period = true,
                                                                           .stops_drives = false,
                                                                           .ends_when_lost = true,
                                                                           .between = between});
  }
  void to_pre_operational(std::size_t drive) override {
    master::Master(*rig_.can).command(master::NmtCommand::enter_pre_operational, static_cast<std::uint8_t>(drive + 1));
  }
  void configure(std::size_t drive, const Action& action, const Action&) override { action(*drives()[drive]); }
  void show_process_data(const Registers&) override {}
  std::vector<Found> scan() override { return {}; }
  std::optional<Watch> watch_of(std::size_t) override { return std::nullopt; }

 protected:
  master::test::AxisRig& rig_;

 private:
  Pace pace_;
};

}  // namespace servodrome::studio
