// Drives on a bus that answer, are silent, refuse, or lose their link: every stop reaches the drives that can be
// reached.
#include "studio/drive_bus.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "api/error.hpp"
#include "studio/jobs.hpp"
#include "studio/real_drives.hpp"
#include "studio/task.hpp"

namespace servodrome::studio {
namespace drive_bus_test {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;

// What the drives of a bus have received, and how they answer. Shared by the test and the thread of the bus.
struct Script {
  struct Drive {
    bool is_silent = false;
    bool refuses_controlword = false;
    bool loses_link = false;  // once, at the next write of the controlword
    std::uint16_t controlword = 0x0006;
    std::uint16_t statusword = 0x0231;  // ready to switch on
  };
  std::mutex mutex;
  std::vector<Drive> drives;
  std::vector<std::string> writes;  // "1 6040=2": drive, object, value; also those without an answer
  std::condition_variable changed;
  std::vector<std::string> reads;    // "1 6041", also those without an answer
  std::vector<std::string> limited;  // "1 1008 10 ms": reads and writes with a limited wait
  bool is_held = false;              // accesses wait
  std::uint16_t held_index = 0;      // only accesses to this object wait; 0: all
  bool is_waiting = false;           // an access waits
  int silent_looks = 20;             // timeout of a silent drive, in steps of 5 ms
  bool is_asked_in_silence = false;  // a silent drive is being read
  int aborted = 0;                   // accesses to silent drives that ended early
  int opened = 0;
  std::function<bool()> look;

  template <typename Change>
  void change(const Change& change_it) {
    const std::lock_guard lock(mutex);
    change_it();
    changed.notify_all();
  }
};

class ScriptedObjects final : public master::ObjectClient {
 public:
  ScriptedObjects(Script& script, std::size_t drive) : script_(script), drive_(drive) {}

  std::vector<std::byte> upload(master::ObjectAddress object) override {
    std::unique_lock lock(script_.mutex);
    script_.reads.push_back(fmt::format("{} {:04X}", drive_, object.index));
    note_limit(object.index);
    answer(lock, object.index);
    std::uint32_t value = 0;
    if (object.index == 0x6041) value = state().statusword;
    if (object.index == 0x6040) value = state().controlword;
    const bool is_word =
        object.index == 0x6040 || object.index == 0x6041 || object.index == 0x603F || object.index == 0x6077;
    std::vector<std::byte> bytes(is_word ? 2 : object.index == 0x6061 ? 1 : 4);
    std::memcpy(bytes.data(), &value, bytes.size());
    return bytes;
  }
  void download(master::ObjectAddress object, std::span<const std::byte> data) override {
    std::uint32_t value = 0;
    std::memcpy(&value, data.data(), std::min(data.size(), sizeof value));
    std::unique_lock lock(script_.mutex);
    script_.writes.push_back(fmt::format("{} {:04X}={:X}", drive_, object.index, value));
    note_limit(object.index);
    if (object.index == 0x6040 && std::exchange(state().loses_link, false)) {
      throw master::MasterError("the link is lost", "test", "");
    }
    answer(lock, object.index);
    if (object.index != 0x6040) return;
    if (state().refuses_controlword) throw master::ObjectError("refused", "test", "", false, true);
    state().controlword = static_cast<std::uint16_t>(value);
  }
  master::Time now() const override { return DriveBus::Clock::now().time_since_epoch(); }
  void wait(master::Time span) override { std::this_thread::sleep_for(span); }
  std::uint16_t address() const override { return static_cast<std::uint16_t>(drive_ + 1); }
  std::string where() const override { return "test"; }

 private:
  void set_wait_limit(std::optional<master::Time> longest) override { limit_ = longest; }
  void note_limit(std::uint16_t index) {
    if (limit_) script_.limited.push_back(fmt::format("{} {:04X} {} ms", drive_, index, *limit_ / 1ms));
  }
  Script::Drive& state() { return script_.drives[drive_]; }
  void answer(std::unique_lock<std::mutex>& lock, std::uint16_t index) {
    if (script_.held_index == 0 || script_.held_index == index) {
      script_.is_waiting = true;
      script_.changed.notify_all();
      script_.changed.wait(lock, [this] { return !script_.is_held; });
      script_.is_waiting = false;
    }
    // A silent drive takes its timeout, unless the access is aborted.
    for (int i = 0; state().is_silent && i < script_.silent_looks; ++i) {
      script_.is_asked_in_silence = true;
      if (script_.look) {
        const auto look = script_.look;
        lock.unlock();
        const bool is_to_end = look();
        lock.lock();
        if (is_to_end) {
          ++script_.aborted;
          script_.is_asked_in_silence = false;
          throw master::MasterError("interrupted", "test", "");
        }
      }
      script_.changed.wait_for(lock, 5ms);
    }
    script_.is_asked_in_silence = false;
    if (state().is_silent) throw master::ObjectError("no answer", "test", "", false, false);
  }

  Script& script_;
  std::size_t drive_;
  std::optional<master::Time> limit_{};
};

class ScriptedBus final : public OpenBus {
 public:
  explicit ScriptedBus(Script& script) : script_(script) {
    const std::lock_guard lock(script_.mutex);
    ++script_.opened;
    for (std::size_t i = 0; i < script_.drives.size(); ++i) {
      objects_.push_back(std::make_unique<ScriptedObjects>(script_, i));
    }
  }
  std::vector<master::ObjectClient*> drives() override {
    std::vector<master::ObjectClient*> drives;
    for (const auto& objects : objects_) drives.push_back(objects.get());
    return drives;
  }
  void back(std::size_t drive) override { note("back", drive); }
  void release(std::size_t drive) override { note("release", drive); }
  void wait(master::Time span) override { std::this_thread::sleep_for(span); }
  void while_waiting(std::function<bool()> look) override {
    const std::lock_guard lock(script_.mutex);
    script_.look = std::move(look);
  }
  Cyclic open_cyclic(std::size_t, const master::CanDrive&) override {
    throw master::MasterError("there are no process data", "test", "");
  }
  void configure(std::size_t, const Action&, const Action&) override {}
  void show_process_data(const Registers&) override {}
  std::vector<Found> scan() override { return {}; }
  std::optional<Watch> watch_of(std::size_t) override { return std::nullopt; }

 private:
  void note(const char* what, std::size_t drive) {
    const std::lock_guard lock(script_.mutex);
    script_.writes.push_back(fmt::format("{} {}", drive, what));
  }

  Script& script_;
  std::vector<std::unique_ptr<ScriptedObjects>> objects_;
};

class DriveBusTest : public testing::Test {
 protected:
  void open(std::size_t count) {
    script_.drives.resize(count);
    BusPlan plan{.link = "test", .type = "can"};
    for (std::size_t i = 0; i < count; ++i) {
      plan.drives.push_back({std::string(1, static_cast<char>('a' + i)), "generic402", static_cast<unsigned>(i + 1)});
    }
    plan.open = [this](const links::Heard&) { return std::make_unique<ScriptedBus>(script_); };
    std::vector<BusPlan> plans;
    plans.push_back(std::move(plan));
    drives_ = std::make_unique<RealDrives>(std::move(plans));
    drives_->set_wait([](master::Time) { std::this_thread::sleep_for(1ms); });
    until([this] {
      const auto states = drives_->buses()[0]->state().drives;
      return std::all_of(states.begin(), states.end(), [](const auto& drive) { return !drive.problem; });
    });
  }
  ~DriveBusTest() override {
    script_.change([this] {
      script_.is_held = false;
      for (Script::Drive& drive : script_.drives) drive.is_silent = false;
    });
  }
  template <typename Condition>
  void until(const Condition& condition) {
    for (int i = 0; i < 60'000 && !condition(); ++i) std::this_thread::sleep_for(1ms);
    ASSERT_TRUE(condition()) << problem();
  }
  void silence(std::size_t drive) {
    script_.change([&] { script_.drives[drive].is_silent = true; });
    until([&] { return drives_->buses()[0]->state().drives[drive].problem.has_value(); });
  }
  std::string problem() {
    if (!drives_) return "no drives";
    const auto state = drives_->buses()[0]->state();
    std::string all = state.problem ? state.problem->what : "";
    for (const auto& drive : state.drives) all += "; " + (drive.problem ? drive.problem->what : "");
    return all;
  }
  std::vector<std::string> writes() {
    const std::lock_guard lock(script_.mutex);
    return script_.writes;
  }
  std::size_t count(const std::string& write) {
    const auto all = writes();
    return static_cast<std::size_t>(std::count(all.begin(), all.end(), write));
  }
  std::unique_ptr<master::ObjectClient> objects(const std::string& axis) { return drives_->open(*drives_->find(axis)); }

  Script script_;
  std::unique_ptr<RealDrives> drives_;
};

TEST_F(DriveBusTest, AStopReachesADriveThatHasJustBeenEnabled) {
  open(1);
  for (int i = 0; i < 20; ++i) {
    script_.change([this] { script_.drives[0].controlword = 0x0006; });
    until([this] { return drives_->buses()[0]->state().drives[0].controlword == 0x0006; });
    objects("a")->write<std::uint16_t>(0x6040, 0, 0x000F);
    const std::size_t before = count("0 6040=2");
    drives_->stop_all();
    ASSERT_EQ(count("0 6040=2"), before + 1);
  }
}

TEST_F(DriveBusTest, ALimitOfTheWaitReachesTheBusAndEndsWithTheAccess) {
  open(2);
  const auto drive = objects("b");
  {
    const master::LimitedWait limited(*drive, 10ms);
    drive->read<std::uint32_t>(0x1000);
    drive->write<std::uint32_t>(0x6081, 0, 5);
    drive->write<std::uint32_t>(0x1010, 1, 0x65766173);
    objects("b")->read<std::uint32_t>(0x1001);
  }
  drive->read<std::uint32_t>(0x1002);
  const std::lock_guard lock(script_.mutex);
  // The value before a write is read for the list of changes.
  EXPECT_THAT(script_.limited,
              ElementsAre("1 1000 10 ms", "1 6081 10 ms", "1 6081 10 ms", "1 1010 10 ms", "1 1010 10 ms"));
}

TEST_F(DriveBusTest, AStopReachesADriveThatWaitsForItsBrake) {
  open(1);
  script_.change([this] {
    script_.drives[0].controlword = 0x000F;
    script_.drives[0].statusword = 0x0233;  // switched on
  });
  until([this] { return drives_->buses()[0]->state().drives[0].controlword == 0x000F; });
  drives_->stop_all();
  EXPECT_EQ(count("0 6040=2"), 1U);
}

// STOP leaves out a drive whose state was read just before; on a loaded machine the reading may be older.
TEST_F(DriveBusTest, ADriveWithoutTorqueKeepsItsState) {
  open(1);
  until([this] {
    const std::size_t before = writes().size();
    drives_->stop_all();
    return writes().size() == before;
  });
}

TEST_F(DriveBusTest, ASilentDriveIsStoppedAfterItsNeighbours) {
  open(3);
  script_.change([this] {
    for (Script::Drive& drive : script_.drives) drive.controlword = 0x000F;
  });
  silence(1);
  std::thread stop([this] { drives_->stop_all(); });
  until([this] { return count("1 6040=2") == 1; });
  auto first = writes();
  std::erase_if(first, [](const std::string& write) { return write.find("6040=2") == std::string::npos; });
  EXPECT_THAT(first, ElementsAre("0 6040=2", "2 6040=2", "1 6040=2"));
  script_.change([this] { script_.drives[1].is_silent = false; });
  stop.join();
}

TEST_F(DriveBusTest, TheReadingOfASilentDriveGivesWayToAStop) {
  open(2);
  script_.change([this] { script_.drives[0].controlword = 0x000F; });
  until([this] { return drives_->buses()[0]->state().drives[0].controlword == 0x000F; });
  silence(1);
  script_.change([this] { script_.silent_looks = 10'000; });
  until([this] {
    const std::lock_guard lock(script_.mutex);
    return script_.is_asked_in_silence;  // it is read again
  });
  std::thread stop([this] { drives_->stop_all(); });
  until([this] { return count("0 6040=2") == 1; });
  {
    const std::lock_guard lock(script_.mutex);
    EXPECT_GE(script_.aborted, 1);
  }
  script_.change([this] { script_.drives[1].is_silent = false; });
  stop.join();
  until([this] { return !drives_->buses()[0]->state().drives[1].problem; });
  EXPECT_FALSE(drives_->buses()[0]->state().problem) << "the bus was not lost";
}

TEST_F(DriveBusTest, AQuickStopStaysDueUntilTheDriveHasAnswered) {
  open(1);
  silence(0);
  script_.change([this] { script_.drives[0].loses_link = true; });
  drives_->buses()[0]->stop_when_back(0);
  until([this] { return drives_->buses()[0]->state().losses == 1; });
  script_.change([this] { script_.drives[0].is_silent = false; });
  until([this] { return !drives_->buses()[0]->state().drives[0].problem; });
  EXPECT_EQ(count("0 6040=2"), 2U) << "before the loss and after it";
  std::this_thread::sleep_for(200ms);
  EXPECT_EQ(count("0 6040=2"), 2U);
}

TEST_F(DriveBusTest, ADriveStoresWithoutTheSupervision) {
  open(2);
  script_.change([this] { script_.writes.clear(); });
  objects("b")->write<std::uint32_t>(0x1010, 1, 0x65766173);
  EXPECT_THAT(writes(), ElementsAre("1 release", "1 1010=65766173", "1 back"));
}

TEST_F(DriveBusTest, ADriveThatRefusesTheQuickStopIsServed) {
  open(1);
  silence(0);
  script_.change([this] { script_.drives[0].refuses_controlword = true; });
  drives_->buses()[0]->stop_when_back(0);
  script_.change([this] { script_.drives[0].is_silent = false; });
  until([this] { return !drives_->buses()[0]->state().drives[0].problem; });
}

TEST_F(DriveBusTest, AStopOfAnIdleDriveRefusesTheCommandsThatWait) {
  open(1);
  std::this_thread::sleep_for(150ms);  // the state is known: the drive has no torque
  script_.change([this] { script_.is_held = true; });
  until([this] {
    const std::lock_guard lock(script_.mutex);
    return script_.is_waiting;
  });
  const auto enable = std::make_shared<Access>();
  enable->object = {0x6040, 0};
  enable->writes = true;
  enable->bytes = {std::byte{0x0F}, std::byte{0}};
  drives_->buses()[0]->submit(enable);
  std::thread stop([this] { drives_->stop_all(); });
  until([&] { return enable->done.load(); });
  script_.change([this] { script_.is_held = false; });
  stop.join();
  EXPECT_TRUE(enable->error);
  EXPECT_EQ(count("0 6040=F"), 0U);
}

TEST_F(DriveBusTest, AReadingThatWaitsGivesWayToAStop) {
  open(2);
  script_.change([this] { script_.drives[0].controlword = 0x000F; });
  until([this] { return drives_->buses()[0]->state().drives[0].controlword == 0x000F; });
  script_.change([this] {
    script_.silent_looks = 10'000;
    script_.drives[1].is_silent = true;
  });
  const auto reading = std::make_shared<Access>();
  reading->drive = 1;
  reading->object = {0x6083, 0};
  drives_->buses()[0]->submit(reading);
  std::thread stop([this] { drives_->stop_all(); });
  until([this] { return count("0 6040=2") == 1; });
  script_.change([this] { script_.drives[1].is_silent = false; });
  stop.join();
  until([&] { return reading->done.load(); });
  EXPECT_FALSE(reading->error) << "it was read after the stop";
}

// A write is not aborted, because its answer may be lost only. The time-out is far longer than the test.
TEST_F(DriveBusTest, AWriteToASilentDriveDelaysNoOtherDrive) {
  open(4);
  script_.change([this] {
    for (Script::Drive& drive : script_.drives) drive.controlword = 0x000F;
  });
  until([this] {
    const auto states = drives_->buses()[0]->state().drives;
    return std::all_of(states.begin(), states.end(), [](const auto& drive) { return drive.controlword == 0x000F; });
  });
  script_.change([this] {
    script_.silent_looks = 100'000;
    script_.drives[1].is_silent = script_.drives[2].is_silent = true;
  });
  std::vector<std::shared_ptr<Access>> to_silent;
  for (const std::size_t drive : {1U, 2U, 1U, 2U}) {
    to_silent.push_back(std::make_shared<Access>());
    to_silent.back()->drive = drive;
    to_silent.back()->object = {0x6083, 0};
    to_silent.back()->writes = true;
    to_silent.back()->bytes.resize(4);
    drives_->buses()[0]->submit(to_silent.back());
  }
  const auto d = objects("d");
  d->write<std::uint32_t>(0x6081, 0, 5);
  EXPECT_EQ(d->read<std::uint16_t>(0x6041), 0x0231);
  EXPECT_EQ(count("3 6081=5"), 1U);
  std::thread stop([this] { drives_->stop_all(); });
  until([this] { return count("0 6040=2") == 1 && count("3 6040=2") == 1; });
  EXPECT_EQ(count("1 6040=2") + count("2 6040=2"), 0U) << "one transfer at a time with a drive";
  for (const auto& each : to_silent) EXPECT_FALSE(each->done);
  script_.change([this] { script_.drives[1].is_silent = script_.drives[2].is_silent = false; });
  stop.join();
  for (const auto& each : to_silent) until([&] { return each->done.load(); });
  until([this] { return count("1 6040=2") == 1 && count("2 6040=2") == 1; });
  EXPECT_FALSE(drives_->buses()[0]->state().problem);
}

TEST_F(DriveBusTest, AStopRefusesTheCommandsThatWait) {
  open(2);
  script_.change([this] {
    script_.drives[0].controlword = 0x000F;
    script_.is_held = true;
  });
  until([this] {
    const std::lock_guard lock(script_.mutex);
    return script_.is_waiting;
  });
  const auto access = [](std::size_t drive, std::uint16_t index, bool writes) {
    const auto made = std::make_shared<Access>();
    made->drive = drive;
    made->object = {index, 0};
    made->writes = writes;
    made->bytes.assign(writes ? 2 : 0, std::byte{0x0F});
    return made;
  };
  const std::vector waiting{access(0, 0x6040, true), access(0, 0x60FF, true), access(0, 0x6041, false),
                            access(0, 0x6083, true), access(1, 0x60FF, true)};
  DriveBus& bus = *drives_->buses()[0];
  for (const auto& each : waiting) bus.submit(each);
  const auto stop = access(0, 0x6040, true);
  stop->bytes = {std::byte{2}, std::byte{0}};
  stop->urgent = true;
  bus.submit(stop);
  script_.change([this] { script_.is_held = false; });
  for (const auto& each : waiting) until([&] { return each->done.load(); });
  EXPECT_TRUE(waiting[0]->error);
  EXPECT_TRUE(waiting[1]->error);
  EXPECT_FALSE(waiting[2]->error);
  EXPECT_FALSE(waiting[3]->error);
  EXPECT_FALSE(waiting[4]->error) << "another drive";
  EXPECT_EQ(writes().front(), "0 6040=2");
}

// Each access to a silent drive takes its whole timeout, so one read is tried for all that wait.
TEST_F(DriveBusTest, AReadWithoutAnAnswerRefusesTheReadsThatWait) {
  open(2);
  script_.change([this] {
    script_.is_held = true;
    script_.held_index = 0x6083;  // polls go on
  });
  const auto access = [](std::size_t drive, bool writes) {
    const auto made = std::make_shared<Access>();
    made->drive = drive;
    made->object = {0x6083, 0};
    made->writes = writes;
    made->bytes.assign(writes ? 4 : 0, std::byte{1});
    return made;
  };
  DriveBus& bus = *drives_->buses()[0];
  const auto first = access(0, false);
  bus.submit(first);
  until([this] {
    const std::lock_guard lock(script_.mutex);
    return script_.is_waiting;
  });
  const std::vector refused{access(0, false), access(0, false), access(0, false)};
  const auto write = access(0, true);
  const auto neighbour = access(1, false);
  bus.submit(refused[0]);
  bus.submit(write);
  bus.submit(refused[1]);
  bus.submit(neighbour);
  bus.submit(refused[2]);
  EXPECT_FALSE(bus.state().drives[0].problem);
  script_.change([this] {
    script_.drives[0].is_silent = true;
    script_.is_held = false;
  });
  until([&] { return first->done.load(); });
  EXPECT_TRUE(bus.state().drives[0].problem) << "before the poll";
  for (const auto& each : refused) EXPECT_TRUE(each->done);
  until([&] { return write->done && neighbour->done; });
  const auto what = [](const Access& failed) -> std::string {
    try {
      if (failed.error) std::rethrow_exception(failed.error);
    } catch (const master::ObjectError& error) {
      return error.answered() ? "answered" : error.happened();
    }
    return {};
  };
  EXPECT_EQ(what(*first), "no answer");
  for (const auto& each : refused) EXPECT_EQ(what(*each), "no answer");
  EXPECT_EQ(what(*write), "no answer");
  EXPECT_FALSE(neighbour->error);
  EXPECT_EQ(count("0 6083=1010101"), 1U) << "the write was tried";
  {
    const std::lock_guard lock(script_.mutex);
    EXPECT_EQ(std::count(script_.reads.begin(), script_.reads.end(), "0 6083"), 1);
    EXPECT_EQ(std::count(script_.reads.begin(), script_.reads.end(), "1 6083"), 1);
  }
  script_.change([this] { script_.drives[0].is_silent = false; });
  until([&] { return !bus.state().drives[0].problem; });
}

TEST_F(DriveBusTest, AStopOfASilentDriveIsGivenWhenItAnswers) {
  open(1);
  Jobs jobs(*drives_);
  silence(0);
  EXPECT_THROW(jobs.begin("a", R"({"do": "velocity", "velocity": 1, "units": "revolutions"})"), api::ApiError);
  EXPECT_THROW(jobs.begin("a", R"({"do": "stop", "after": "x"})"), api::ApiError);
  script_.change([this] { script_.drives[0].is_silent = false; });
  until([this] { return !drives_->buses()[0]->state().drives[0].problem; });
  EXPECT_EQ(count("0 6040=2"), 0U);
  const Job& earlier = jobs.begin("a", R"({"do": "velocity", "velocity": 1})");
  silence(0);
  EXPECT_THROW(jobs.begin("a", R"({"do": "stop", "units": "revolutions"})"), api::ApiError);
  EXPECT_TRUE(earlier.cancelled);
  script_.change([this] { script_.drives[0].is_silent = false; });
  until([this] { return !drives_->buses()[0]->state().drives[0].problem; });
  EXPECT_GE(count("0 6040=2"), 1U) << "an attempt during the silence counts, too";
}

// A task that is being ended restores an object: the bus carries the write out, although the task does not wait for it.
TEST_F(DriveBusTest, ATaskThatIsEndedRestoresWhatItHasChanged) {
  open(1);
  struct Restore {
    master::ObjectClient& objects;
    ~Restore() {
      try {
        objects.write<std::uint32_t>(0x6083, 0, 0x1234);
      } catch (...) {
        ADD_FAILURE() << "the write was not accepted";
      }
    }
  };
  Task task([this, &task] {
    const auto its = drives_->open("a", [&task](master::Time) { task.pause(); });
    const Restore restore{*its};
    for (;;) its->upload({0x6041, 0});
  });
  for (int i = 0; i < 20; ++i) task.resume();
  task.end();
  until([this] { return count("0 6083=1234") == 1; });
}

}  // namespace
}  // namespace drive_bus_test
}  // namespace servodrome::studio
