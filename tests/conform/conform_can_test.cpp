// The checks against drives on CAN, in virtual time: the reference drive is clean, the makers' drives depart where
// their manuals say so, and drives with planted defects are found.
#include <gmock/gmock.h>

#include "conform/conform_rig.hpp"

namespace servodrome::host::conform::test {
namespace {

// Falsifies frames between master and drive.
class FalseClient final : public links::CanClient {
 public:
  using Change = std::function<bool(Frame&)>;  // false: the frame is lost

  FalseClient(links::CanBus& bus, links::VirtualClock& clock, const Change& to_drive, const Change& from_drive)
      : client_(bus, clock), to_drive_(to_drive), from_drive_(from_drive) {}

  void send(const Frame& frame) override {
    Frame changed = frame;
    if (!to_drive_ || to_drive_(changed)) client_.send(changed);
  }
  std::optional<Frame> receive(links::Time timeout) override {
    auto frame = client_.receive(timeout);
    if (frame && from_drive_ && !from_drive_(*frame)) return std::nullopt;
    return frame;
  }

 private:
  links::MemoryCanClient client_;
  const Change& to_drive_;
  const Change& from_drive_;
};

struct CanRig {
  explicit CanRig(std::string_view its_product)
      : product(its_product), line(settings_of(line_of(its_product, "can", "node = 5"))) {
    bus.run_for(200ms);
  }

  Report run(RunOptions options = {}) {
    options.product = product;
    Subject subject(CanAccess{bus, sdo}, {.dialect = dialect_of(product)});
    return run_checks(subject, options);
  }

  std::string_view product;
  FalseClient::Change to_drive;
  FalseClient::Change from_drive;
  line::Line line;
  Bus bus{std::make_unique<FalseClient>(line.buses()[0]->bus, line, to_drive, from_drive), "mem:", &line};
  SdoClient sdo{bus, 5};
};

TEST(ConformCan, TheReferenceDriveIsClean) {
  CanRig rig("generic402");
  const Report report = rig.run();
  EXPECT_EQ(text_of(report, {Verdict::fail, Verdict::departure}), "");
  if (std::getenv("CONFORM_SHOW") != nullptr) fmt::print("{}", text_of(report, {Verdict::pass, Verdict::skipped}));
}

class Makers : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Products, Makers, testing::Values("ismc", "pronet", "ismk"));

TEST_P(Makers, DepartWhereTheirManualsSay) {
  CanRig rig(GetParam());
  const Report report = rig.run();
  EXPECT_EQ(text_of(report, {Verdict::fail}), "");
  if (std::getenv("CONFORM_SHOW") != nullptr) fmt::print("{}", text_of(report, {Verdict::departure, Verdict::skipped}));
}

}  // namespace
}  // namespace servodrome::host::conform::test
