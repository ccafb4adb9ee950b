#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <sstream>

#include "generate.hpp"
#include "machine.hpp"
#include "source_dir.hpp"

// A change that must not change the behaviour leaves these values equal to the last bit: shafts, demands, states and
// frames in the first sequences of a seed. After an intended change of behaviour, write the file again:
// MOTION_FINGERPRINTS=write build/release/tests/motion/motion_tests --source=motion_fingerprints_test
namespace servodrome::motion {
namespace motion_fingerprints_test {
namespace {

constexpr std::uint64_t seed = 2026;
constexpr std::uint64_t sequences = 160;
const std::string file = std::string(SERVODROME_SOURCE_DIR) + "/tests/data/motion/fingerprints";

TEST(MotionFingerprints, AreThoseOfBefore) {
#if defined(__clang__) || !defined(__x86_64__)
  GTEST_SKIP() << "the file is that of GCC on x86-64, whose mathematics differs in the last bits";
#endif
  const std::vector<Variant> list = variants();
  std::string now;
  for (std::uint64_t number = 0; number < sequences; ++number) {
    const Drawn drawn = draw(seed, number, list);
    const Outcome outcome = run(drawn.sequence);
    EXPECT_FALSE(outcome.finding) << number;
    now += fmt::format("{} {} {} {:016x}\n", number, drawn.sequence.axes.front().product, outcome.ticks,
                       outcome.fingerprint);
  }
  const char* order = std::getenv("MOTION_FINGERPRINTS");
  if (order != nullptr && std::string_view(order) == "write") {
    std::ofstream(file) << now;
    GTEST_SKIP() << "written to " << file;
  }
  std::ifstream before(file);
  std::istringstream lines(now);
  for (std::string is; std::getline(lines, is);) {
    std::string was;
    std::getline(before, was);
    EXPECT_EQ(is, was);
  }
}

}  // namespace
}  // namespace motion_fingerprints_test
}  // namespace servodrome::motion
