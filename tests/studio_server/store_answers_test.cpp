// Answers of the bench API about a memory that is damaged or missing: the drive's fault, its refusal, and "stored" only
// if the values return after a power cycle.
#include <filesystem>
#include <fstream>
#include <gmock/gmock.h>
#include <unistd.h>

#include "commissioning_rig.hpp"

namespace servodrome::studio {
namespace store_answers_test {
namespace {

namespace fs = std::filesystem;
using api::Method;
using nlohmann::json;
using testing::HasSubstr;
using namespace std::chrono_literals;

struct Maker {
  std::string_view product;
  std::string_view kept;        // an object that is stored
  std::string_view error_code;  // of a memory that cannot be used
  bool keeps_at_once = false;
};
constexpr auto makers = std::to_array<Maker>({
    {"ismc", "6083/0", "0x5530"},
    {"generic402", "6083/0", "0x5530"},
    {"pronet", "3022/0", "0x5581", true},
    {"ismk", "6083/0", "0x6310"},
    {"generic402-ec", "6083/0", "0x5530"},
    {"ismk-ea", "6083/0", "0x6310"},
    {"jmc_ec", "2008/14", "0x5003", true},
});

struct Folder {
  Folder() {
    std::string pattern = (fs::temp_directory_path() / "store_answers_XXXXXX").string();
    path = ::mkdtemp(pattern.data());
  }
  ~Folder() { fs::remove_all(path); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path path;
};

class StoreAnswers : private Folder, public CommissioningRig, public testing::WithParamInterface<Maker> {
 protected:
  StoreAnswers() : CommissioningRig(line_file((path / "drive.bin").string())) {}
  static std::string line_file(const std::string& store) {
    const bool can = line::find_product(line::all_products(), GetParam().product)->fieldbus == line::Fieldbus::can;
    return fmt::format(
        "clock = \"virtual\"\n[[bus]]\nname = \"bus\"\n{}[[axis]]\nname = \"axis\"\nproduct = \"{}\"\nbus = \"bus\"\n{}"
        "store = \"{}\"\n",
        can ? "" : "type = \"ethercat\"\n", GetParam().product, can ? "node = 1\n" : "", store);
  }
  fs::path store() const { return path / "drive.bin"; }

  void replace_by_copy() {
    fs::copy_file(store(), path / "copy");
    fs::rename(path / "copy", store());
  }

  api::Response write_and_store(int value) {
    json_of(Method::put, fmt::format("axes/axis/objects/{}", GetParam().kept),
            fmt::format(R"({{"value": {}}})", value));
    return ask(Method::post, "axes/axis/parameters/store");
  }
  api::Response load_and_store() {
    return ask(Method::put, "axes/axis/parameters?store=true",
               fmt::format("# servodrome parameters 1\nproduct: {}\n6083:00 u32 77\nend\n", GetParam().product));
  }
  void store_twice() {  // so that both banks hold an image
    for (const int value : {499, 500}) EXPECT_EQ(json::parse(write_and_store(value).body)["stored"], !keeps()) << value;
  }
  bool keeps() const { return GetParam().keeps_at_once; }
  json stored_value() { return value("axis", std::string(GetParam().kept)); }
  void power_cycle() {
    json_of(Method::post, "axes/axis/power", R"({"action": "cycle"})");
    pass(1s);
  }
  void expect_fault() {
    const json view = get("axes/axis");
    EXPECT_EQ(view["state"], "fault");
    EXPECT_EQ(view["faults"][0]["code"], GetParam().error_code) << view["faults"].dump();
  }
  void spoil(const std::function<void(std::vector<char>&, std::size_t)>& how) {
    std::vector<char> bytes(fs::file_size(store()));
    std::ifstream(store(), std::ios::binary).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    how(bytes, bytes.size() / 2);
    std::fstream(store(), std::ios::binary | std::ios::in | std::ios::out)
        .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  // Neither reports that it is stored.
  void expect_nothing_is_stored() {
    for (const auto& answer : {write_and_store(77), load_and_store()}) {
      EXPECT_THAT(answer.body, testing::Not(HasSubstr("\"stored\":true"))) << answer.body;
      if (keeps()) {
        EXPECT_EQ(answer.status, 200U) << answer.body;
        EXPECT_EQ(json::parse(answer.body)["keeps_at_once"], true);
      } else {
        EXPECT_EQ(answer.status, 409U) << answer.body;
        EXPECT_THAT(answer.body, HasSubstr("0606 0000h"));
      }
    }
    pass(100ms);
    if (keeps()) expect_fault();  // such a product stores without a command, and answers no command
  }
};
INSTANTIATE_TEST_SUITE_P(Products, StoreAnswers, testing::ValuesIn(makers), [](const auto& instance) {
  std::string name(instance.param.product);
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST_P(StoreAnswers, OfASoundMemory) {
  store_twice();
  power_cycle();
  EXPECT_EQ(stored_value(), 500);
  EXPECT_EQ(get("axes/axis")["faults"], json::array());
}

// The drive has its fault and its factory values. Values that are stored afterwards return after a power cycle.
TEST_P(StoreAnswers, OfADamagedMemory) {
  const std::function<void(std::vector<char>&, std::size_t)> ways[] = {
      [](auto& bytes, std::size_t bank) { bytes[40] ^= 1, bytes[bank + 40] ^= 1; },
      [](auto& bytes, std::size_t bank) { bytes[0] = 9, bytes[bank] = 9; },  // an unknown version
      [](auto& bytes, std::size_t) { std::fill(bytes.begin(), bytes.end(), 'S'); }};
  for (const auto& way : ways) {
    store_twice();
    spoil(way);
    power_cycle();
    expect_fault();
    EXPECT_NE(stored_value(), 500);
    power_cycle();
    expect_fault();
    EXPECT_EQ(json::parse(write_and_store(321).body)["stored"], !keeps());
    power_cycle();
    EXPECT_EQ(stored_value(), 321);
    EXPECT_EQ(get("axes/axis")["faults"], json::array());
  }
}

TEST_P(StoreAnswers, OfAFileThatWasDeleted) {
  store_twice();
  fs::remove(store());
  expect_nothing_is_stored();
  power_cycle();
  expect_fault();
  expect_nothing_is_stored();
  EXPECT_FALSE(fs::exists(store()));
}

TEST_P(StoreAnswers, OfAFileThatWasReplaced) {
  store_twice();
  replace_by_copy();
  expect_nothing_is_stored();
  power_cycle();
  expect_fault();
}

}  // namespace
}  // namespace store_answers_test
}  // namespace servodrome::studio
