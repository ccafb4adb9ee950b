// The conformance checks against drives on EtherCAT, in virtual time.
#include <deque>
#include <gmock/gmock.h>

#include "catalogue/product.hpp"
#include "ethercat/slave/slave.hpp"
#include "links/ethercat/memory_client.hpp"
#include "tools/conform/conform_rig.hpp"

namespace servodrome::master::conform::test {
namespace conform_ethercat_test {
namespace {

// Modifies frames between master and drive; the callbacks receive the content of each frame.
class FalseClient final : public links::EthercatClient {
 public:
  using Change = std::function<void(std::span<std::uint8_t>)>;

  FalseClient(links::EthercatBus& bus, links::VirtualClock& clock, const Change& to_drive, const Change& from_drive)
      : client_(bus, clock), to_drive_(to_drive), from_drive_(from_drive) {}

  void send(std::span<const std::uint8_t> content) override {
    std::vector<std::uint8_t> changed(content.begin(), content.end());
    if (to_drive_) to_drive_(changed);
    client_.send(changed);
  }
  std::size_t receive(std::span<std::uint8_t> into, Time timeout) override {
    const std::size_t size = client_.receive(into, timeout);
    if (size != 0 && from_drive_) from_drive_(into.first(size));
    return size;
  }
  Time now() const override { return client_.now(); }
  void wait(Time span) override { client_.wait(span); }
  std::string name() const override { return "mem:"; }

 private:
  links::MemoryEthercatClient client_;
  const Change& to_drive_;
  const Change& from_drive_;
};

struct EthercatRig {
  explicit EthercatRig(std::string_view its_product, int start_counts = 0)
      : product(its_product), line(settings_of(line_of(its_product, "ethercat", "", start_counts))) {}

  Report run(RunOptions options = {}) {
    options.departures = catalogue::product_of(product).departures;
    const std::vector<FoundSlave> found = scan_slaves(master);
    EthercatSlave slave(master, found.at(0));
    Subject subject(EthercatAccess{master, found, slave, {.cyclic = {.period = 2ms}}},
                    {.product = &catalogue::product_of(product), .cancelled = cancelled});
    return run_checks(subject, options);
  }

  std::string_view product;
  std::function<bool()> cancelled{};
  FalseClient::Change to_drive;
  FalseClient::Change from_drive;
  line::Line line;
  EthercatMaster master{std::make_unique<FalseClient>(line.ethercat_buses()[0]->bus, line, to_drive, from_drive)};
};

class EthercatDrives : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Products, EthercatDrives, testing::Values("generic402-ec", "ismk-ea", "jmc_ec"));

TEST_P(EthercatDrives, DepartWhereTheirManualsSay) {
  EthercatRig rig(GetParam());
  Report report = rig.run();
  // The position value of a JMC cannot be restored.
  const catalogue::HomeOffset& offset = catalogue::product_of(GetParam()).dialect.home_offset;
  if (offset.travels && !offset.stays_with_1) {
    std::erase_if(report.problems, [](const std::string& problem) {
      return problem.find("homing changed the position value") != std::string::npos;
    });
  }
  expect_departures_only(report);
}

// Without 6007h an axis continues its last command if this program is killed.
TEST(ConformEthercat, TheDriveReactsToMissingCyclesInChecksThatMoveTheAxis) {
  EthercatRig rig("ismk-ea");
  dictionary::Dictionary& objects = rig.line.axes()[0]->device().dictionary();
  std::set<std::int64_t> options_in_motion;
  rig.from_drive = [&](std::span<std::uint8_t>) {
    if ((objects.number(0x6041, 0) & 0x6F) == 0x27) options_in_motion.insert(objects.number(0x6007, 0));
  };
  const Report report = rig.run({.only = {"pv.halt", "pp.acknowledge"}});
  EXPECT_EQ(text_of(report, {Verdict::fail, Verdict::skipped}), "");
  EXPECT_THAT(options_in_motion, testing::ElementsAre(1));
  EXPECT_EQ(objects.number(0x6007, 0), 0);
}

// Method 35 of a JMC sets the position to 0 and ignores 607Ch (Chart 42, HM 2.35).
TEST(ConformEthercat, APositionValueThatCannotBeRestoredIsReported) {
  EthercatRig rig("jmc_ec", 1'000'000);
  const Report report = rig.run({.only = {"homing.attained"}});
  ASSERT_EQ(report.problems.size(), 1U);
  EXPECT_THAT(report.problems[0], testing::HasSubstr("changed the position value by -"));
}

// ---- Planted defects ----

// Parses the datagrams of a frame's content (ETG.1000.4 clause 5.4).
struct Seen {
  std::uint8_t command;
  std::uint16_t offset;  // ADO
  std::span<std::uint8_t> data;
  std::span<std::uint8_t> counter;
};
void each_datagram(std::span<std::uint8_t> content, const std::function<void(const Seen&)>& action) {
  constexpr std::size_t head = 10;
  for (std::size_t at = 2; at + head + 2 <= content.size();) {
    const unsigned length = ethercat::load_u16(&content[at + 6]);
    const std::size_t size = length & 0x7FF;
    if (at + head + size + 2 > content.size()) return;
    action({content[at], ethercat::load_u16(&content[at + 4]), content.subspan(at + head, size),
            content.subspan(at + head + size, 2)});
    at += head + size + 2;
    if ((length & 0x8000) == 0) return;
  }
}

using Change = std::function<void(const Seen&)>;

constexpr std::uint8_t fprd = 4;
constexpr std::uint8_t fpwr = 5;
constexpr std::uint8_t lrw = 12;

// Replaces an AL status code by another.
Change status_code(unsigned from, unsigned to) {
  return [=](const Seen& seen) {
    if (seen.command != fprd || seen.offset != 0x0130 || seen.data.size() < 6) return;
    if (ethercat::load_u16(&seen.data[4]) == from) ethercat::store_u16(&seen.data[4], to);
  };
}
// Replaces a 32-bit number in a mail by another.
Change in_mail(std::uint32_t from, std::uint32_t to) {
  return [=](const Seen& seen) {
    if (seen.command != fprd || seen.offset < 0x1000) return;
    for (std::size_t at = 0; at + 4 <= seen.data.size(); ++at) {
      if (ethercat::load_u32(&seen.data[at]) == from) ethercat::store_u32(&seen.data[at], to);
    }
  };
}
// The inputs of the reference drive follow its 14 bytes of outputs and start with the statusword.
constexpr std::size_t statusword_at = 14;
Change statusword(std::function<unsigned(unsigned)> change) {
  return [change = std::move(change)](const Seen& seen) {
    if (seen.command != lrw || seen.data.size() < statusword_at + 2) return;
    ethercat::store_u16(&seen.data[statusword_at], change(ethercat::load_u16(&seen.data[statusword_at])));
  };
}
Change controlword(std::function<unsigned(unsigned)> change) {
  return [change = std::move(change)](const Seen& seen) {
    if (seen.command == lrw) ethercat::store_u16(seen.data.data(), change(ethercat::load_u16(seen.data.data())));
  };
}

// Modifies a target in the outputs; offsets for the mappings 1600h and 1A00h.
Change targets(std::size_t at, std::function<std::int32_t(std::int32_t)> change) {
  return [at, change = std::move(change)](const Seen& seen) {
    if (seen.command != lrw || (seen.data[0] & 0x0F) != 0x0F) return;
    const auto target = static_cast<std::int32_t>(ethercat::load_u32(&seen.data[at]));
    ethercat::store_u32(&seen.data[at], static_cast<std::uint32_t>(change(target)));
  };
}
constexpr std::size_t target_position_at = 2;
constexpr std::size_t target_velocity_at = 6;
constexpr std::size_t target_torque_at = 10;
constexpr std::size_t mode_at = 12;
constexpr std::size_t mode_display_at = 26;

// Modifies an FoE mail with this operation, after the mailbox header.
Change foe_mail(std::uint8_t operation, std::function<void(std::span<std::uint8_t>)> change) {
  return [operation, change = std::move(change)](const Seen& seen) {
    if (seen.command != fprd || seen.offset < 0x1000 || seen.data.size() < 12) return;
    const bool is_foe = (seen.data[5] & 0x0F) == 4 && seen.data[6] == operation;
    if (is_foe) change(seen.data.subspan(6));
  };
}
// Replaces an error by an acknowledgement.
Change foe_error_hidden() {
  return foe_mail(5, [](std::span<std::uint8_t> mail) { mail[0] = 4; });
}

// In the first try of the check the slave leaves OP, and its end cannot restore 6007h. The second try can.
TEST(ConformEthercat, ARepeatedCheckReportsOnlyWhatItLeaves) {
  for (const bool is_for_ever : {false, true}) {
    EthercatRig rig("ismk-ea");
    dictionary::Dictionary& objects = rig.line.axes()[0]->device().dictionary();
    int lost = 0;
    int refused = 0;
    rig.to_drive = [&](std::span<std::uint8_t> content) {
      if (lost == 0 && (objects.number(0x6041, 0) & 0x6F) == 0x27) {
        ++lost;
        rig.line.axes()[0]->device().ethercat_slave()->fall_back(ethercat::AlState::safe_operational,
                                                                 ethercat::AlStatusCode{0x001B}, rig.line.now());
      }
      each_datagram(content, [&](const Seen& seen) {
        if (seen.command != fpwr || seen.offset < 0x1000 || seen.data.size() < 16) return;
        const bool restores = (seen.data[8] & 0xE0) == 0x20 && ethercat::load_u16(&seen.data[9]) == 0x6007 &&
                              ethercat::load_u16(&seen.data[12]) == 0;
        if (!restores || (refused != 0 && !is_for_ever)) return;
        ++refused;
        ethercat::store_u16(&seen.data[9], 0x5FFF);
      });
    };
    const Report report = rig.run({.only = {"pv.halt"}});
    EXPECT_EQ(lost, 1);
    EXPECT_GT(refused, 0);
    EXPECT_EQ(report.count(Verdict::pass), 1U) << text_of(report, {Verdict::fail, Verdict::skipped});
    EXPECT_EQ(objects.number(0x6007, 0), is_for_ever ? 1 : 0);
    const auto stays = testing::HasSubstr("6007h = 1 stays");
    EXPECT_THAT(report.problems, is_for_ever ? testing::Matcher<std::vector<std::string>>(testing::ElementsAre(stays))
                                             : testing::IsEmpty());
  }
}

// The working counters of process data are wrong while the slave stays in OP and its mailbox works.
TEST(ConformEthercat, AGapOfTheProcessDataDoesNotEndTheRun) {
  for (const int cycles : {20, 50, 100'000}) {
    EthercatRig rig("ismk-ea");
    const dictionary::Dictionary& objects = rig.line.axes()[0]->device().dictionary();
    bool is_gap = false;
    int left = cycles;
    rig.from_drive = [&](std::span<std::uint8_t> content) {
      is_gap = is_gap || (objects.number(0x6041, 0) & 0x6F) == 0x27;
      each_datagram(content, [&](const Seen& seen) {
        if (!is_gap || seen.command != lrw || left == 0) return;
        --left;
        seen.counter[0] = 0;
      });
    };
    const Report report = rig.run({.only = {"pv.halt"}});
    EXPECT_TRUE(is_gap);
    EXPECT_EQ(report.count(Verdict::fail), 1U) << cycles;
    EXPECT_TRUE(report.at_rest) << cycles;
    EXPECT_THAT(report.problems, testing::IsEmpty()) << cycles;
    EXPECT_EQ(objects.number(0x6041, 0) & 0x4F, 0x40) << cycles;
    EXPECT_EQ(objects.number(0x6007, 0), 0) << cycles;
  }
}

struct Defect {
  const char* name;
  const char* check;
  Change to_drive;
  Change from_drive;
};

const std::vector<Defect> defects{
    {"a forbidden change has another status code", "al.illegal-init-safeop", {}, status_code(0x0011, 0x0001)},
    {"an unknown state has another status code", "al.unknown-state", {}, status_code(0x0012, 0x0011)},
    {"a wrong mailbox has another status code", "al.mailbox-configuration", {}, status_code(0x0016, 0x0017)},
    {"wrong outputs have another status code", "al.output-configuration", {}, status_code(0x001D, 0x001E)},
    {"the watchdog has another status code", "al.watchdog", {}, status_code(0x001B, 0x001A)},
    {"errors are not indicated",
     "al.illegal-preop-op",
     {},
     [](const Seen& seen) {
       if (seen.command == fprd && seen.offset == 0x0130) seen.data[0] &= 0xEF;
     }},
    {"a read-only register counts a write",
     "al.working-counter",
     {},
     [](const Seen& seen) {
       if (seen.command == fpwr && seen.offset == 0x0130) seen.counter[0] = 1;
     }},
    {"process data count too little",
     "al.process-data-counter",
     {},
     [count = 0](const Seen& seen) mutable {
       if (seen.command == lrw && ++count % 7 == 0) seen.counter[0] = 2;
     }},
    {"an unknown protocol has another error", "mailbox.unsupported-protocol", {}, in_mail(0x00020001, 0x00010001)},
    {"the abort code of an absent object is another", "abort.no-object", {}, in_mail(0x06020000, 0x08000000)},
    {"the abort code of a constant is another", "coe.read-only", {}, in_mail(0x06010002, 0x06010000)},
    {"the abort code of an unknown command is another",
     "mailbox.unknown-sdo-command",
     {},
     in_mail(0x05040001, 0x08000000)},
    {"set-points are never acknowledged", "pp.acknowledge", {}, statusword([](unsigned word) {
       return word & ~0x1000U;
     })},
    {"target reached comes too early", "pp.not-reached-under-way", {}, statusword([](unsigned word) {
       return word | 0x0400U;
     })},
    {"the voltage bit is missing", "power.voltage-enabled", {}, statusword([](unsigned word) {
       return word & ~0x10U;
     })},
    {"halt is ignored", "pp.halt", controlword([](unsigned word) { return word & ~0x100U; }), {}},
    {"a fault cannot be reset", "fault.reset", controlword([](unsigned word) { return word & ~0x80U; }), {}},
    {"targets are said to be followed without power", "csp.follows", {}, statusword([](unsigned word) {
       return word | 0x1000U;
     })},
    {"the position is late",
     "csp.tracks",
     targets(target_position_at,
             [before = std::deque<std::int32_t>()](std::int32_t target) mutable {
               before.push_back(target);
               if (before.size() > 200) before.pop_front();
               return before.front();
             }),
     {}},
    {"halt is ignored in cyclic position", "csp.halt", controlword([](unsigned word) { return word & ~0x100U; }), {}},
    {"half the velocity",
     "csv.tracks",
     targets(target_velocity_at, [](std::int32_t target) { return target / 2; }),
     {}},
    {"cyclic velocity is not left", "csv.leave",
     [](const Seen& seen) {
       if (seen.command == lrw && seen.data[mode_at] == 1) seen.data[mode_at] = 9;
     },
     [](const Seen& seen) {
       if (seen.command == lrw && seen.data[mode_display_at] == 9 && seen.data[mode_at] != 9)
         seen.data[mode_display_at] = 1;
     }},
    {"an unknown file has another error", "foe.unknown-file", {}, in_mail(0x8001, 0x8000)},
    {"a wrong packet number has another error", "foe.packet-number", {}, in_mail(0x8005, 0x8004)},
    {"packets are numbered from 2", "foe.read", {}, foe_mail(3, [](std::span<std::uint8_t> mail) { ++mail[2]; })},
    {"packets without a transfer are taken", "foe.stray-packet", {}, foe_error_hidden()},
    {"any operation is taken", "foe.unknown-operation", {}, foe_error_hidden()},
    {"there is torque with a target of 0",
     "cst.at-rest",
     [](const Seen& seen) {
       if (seen.command == lrw) ethercat::store_u16(&seen.data[target_torque_at], 100);
     },
     {}},
};

class EthercatDefects : public testing::TestWithParam<std::size_t> {};
INSTANTIATE_TEST_SUITE_P(Planted, EthercatDefects, testing::Range(std::size_t{0}, defects.size()));

TEST_P(EthercatDefects, IsFound) {
  const Defect& defect = defects[GetParam()];
  EthercatRig rig("generic402-ec");
  const RunOptions options{.only = {defect.check}};
  const Report sound = rig.run(options);
  ASSERT_EQ(sound.count(Verdict::pass), 1U) << text_of(sound, {Verdict::fail, Verdict::skipped});
  if (defect.to_drive) rig.to_drive = [&](std::span<std::uint8_t> content) { each_datagram(content, defect.to_drive); };
  if (defect.from_drive) {
    rig.from_drive = [&](std::span<std::uint8_t> content) { each_datagram(content, defect.from_drive); };
  }
  const Report report = rig.run(options);
  EXPECT_THAT(failed(report), testing::ElementsAre(defect.check)) << defect.name << "\n"
                                                                  << text_of(report, {Verdict::pass, Verdict::skipped});
}

// The checks map interpolated position, since it is in no PDO by default; the mapping must be restored.
TEST(ConformEthercat, TheProcessDataAreAsBefore) {
  EthercatRig rig("generic402-ec");
  const auto mapped = [&] {
    const std::vector<FoundSlave> found = scan_slaves(rig.master);
    EthercatSlave slave(rig.master, found.at(0));
    const ProcessData data = read_process_data(slave);
    EXPECT_EQ(data.outputs.size(), 1U);
    EXPECT_EQ(data.inputs.size(), 1U);
    return std::pair(data.outputs.at(0).entries, data.inputs.at(0).entries);
  };
  const auto before = mapped();
  const Report report = rig.run({.only = {"ip"}});
  EXPECT_EQ(report.count(Verdict::pass), report.outcomes.size()) << text_of(report, {Verdict::fail, Verdict::skipped});
  EXPECT_EQ(mapped(), before);
}

TEST(ConformEthercat, ACancelledCheckLeavesTheDriveAsBefore) {
  cancel_each_check<EthercatRig>("generic402-ec", buses::ethercat,
                                 {0x6060, 0x607A, 0x60FF, 0x6071, 0x60B1, 0x60B2, 0x60B8, 0x60C1, 0x60FE});
}

TEST(ConformEthercat, SafeNeverMoves) {
  EthercatRig rig("generic402-ec");
  const auto start = rig.line.axes()[0]->plant().position_counts();
  const Report report = rig.run({.safe = true});
  EXPECT_EQ(report.count(Verdict::fail), 0U);
  EXPECT_GT(report.count(Verdict::pass), 40U);
  EXPECT_EQ(rig.line.axes()[0]->plant().position_counts(), start);
}

}  // namespace
}  // namespace conform_ethercat_test
}  // namespace servodrome::master::conform::test
