// A drive that cannot use its memory raises the corresponding fault. It must never run with factory values as if no
// values were stored.
#include <filesystem>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <random>
#include <unistd.h>

#include "drive/drive.hpp"
#include "support.hpp"

namespace servodrome::line {
namespace store_damage_test {
namespace {

namespace fs = std::filesystem;
using namespace test;
using dictionary::AbortCode;

struct Maker {
  std::string_view product;
  std::uint16_t save_index;  // the object that stores when `save_value` is written
  std::uint8_t save_sub;
  std::uint32_t save_value;
  std::uint16_t value_index;  // a stored object
  std::uint8_t value_sub;
  std::uint16_t error_code;  // if the memory cannot be used
  bool ethercat = false;
};

constexpr std::uint32_t save_signature = 0x65766173;

constexpr auto makers = std::to_array<Maker>({
    {"ismc", 0x1010, 1, save_signature, 0x6083, 0, 0x5530},
    {"generic402", 0x1010, 1, save_signature, 0x6083, 0, 0x5530},
    {"pronet", 0x3022, 0, 500, 0x3022, 0, 0x5581},  // ch. 3.5; stored immediately
    {"ismk", 0x2FF0, 1, 1, 0x6083, 0, 0x6310},      // Table 9-24; Table 10-5, 800.0
    {"generic402-ec", 0x1010, 1, save_signature, 0x6083, 0, 0x5530, true},
    {"ismk-ea", 0x2FF0, 1, 1, 0x6083, 0, 0x6310, true},
    {"jmc_ec", 0x2008, 20, 500, 0x2008, 20, 0x5003, true},  // AL.051, ch. 9.1; stored immediately
});

class StoreDamage : public testing::TestWithParam<Maker> {
 protected:
  StoreDamage() {
    std::string pattern = (fs::temp_directory_path() / "store_damage_XXXXXX").string();
    folder = ::mkdtemp(pattern.data());
    path = (folder / "drive.bin").string();
  }
  ~StoreDamage() override { fs::remove_all(folder); }
  StoreDamage(const StoreDamage&) = delete;
  StoreDamage& operator=(const StoreDamage&) = delete;

  struct Drive {
    Drive(const Maker& maker, const std::string& path)
        : of(maker),
          line(settings_of(
              fmt::format("clock = \"virtual\"\n[[bus]]\nname = \"bus\"\n{}[[axis]]\nname = \"axis\"\nproduct = "
                          "\"{}\"\nstore = \"{}\"\n",
                          maker.ethercat ? "type = \"ethercat\"\n" : "", maker.product, path))) {
      run();
    }
    void run() { line.run_until(line.now() + 20ms); }
    Axis& axis() { return *line.axes()[0]; }
    std::int64_t get(std::uint16_t index, std::uint8_t sub = 0) {
      return axis().device().dictionary().number(index, sub);
    }
    AbortCode set(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
      return axis().device().dictionary().set_number(index, sub, value);
    }
    AbortCode save() { return set(of.save_index, of.save_sub, of.save_value); }
    void power_cycle() {
      axis().power_off(line.now());
      run();
      axis().power_on(line.now());
      run();
    }
    bool in_fault() { return axis().device().drive().state() == drive::PowerState::fault; }
    void expect_fault(std::string_view what) {
      EXPECT_TRUE(in_fault()) << what;
      EXPECT_EQ(get(0x603F), of.error_code) << what;
    }
    // If values are stored immediately, there is no answer to a save command: a fault reports the error.
    void expect_not_saved() {
      if (of.save_index != of.value_index) {
        EXPECT_EQ(save(), AbortCode::hardware_error);
      } else {
        EXPECT_EQ(save(), AbortCode::none);
        run();
        expect_fault("kept at once");
      }
    }

    Maker of;
    Line line;
  };

  // Stores twice, so that both banks of the file hold an image.
  void store_twice() {
    Drive drive(GetParam(), path);
    EXPECT_FALSE(drive.in_fault());
    for (const int value : {499, 500}) {
      ASSERT_EQ(drive.set(GetParam().value_index, GetParam().value_sub, value), AbortCode::none);
      ASSERT_EQ(drive.save(), AbortCode::none);
    }
  }
  std::vector<char> content() const {
    std::vector<char> bytes(fs::file_size(path));
    std::ifstream(path, std::ios::binary).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return bytes;
  }
  void put(const std::vector<char>& bytes) const {
    std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }

  fs::path folder;
  std::string path;
};

INSTANTIATE_TEST_SUITE_P(Products, StoreDamage, testing::ValuesIn(makers), [](const auto& instance) {
  std::string name(instance.param.product);
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST_P(StoreDamage, WhatWasStoredComesBackAndNothingStoredIsNoFault) {
  store_twice();
  Drive drive(GetParam(), path);
  EXPECT_FALSE(drive.in_fault());
  EXPECT_EQ(drive.get(GetParam().value_index, GetParam().value_sub), 500);
}

TEST_P(StoreDamage, BothBanksDamagedInEveryWay) {
  store_twice();
  const std::vector<char> good = content();
  const std::size_t bank = good.size() / 2;
  struct Way {
    const char* name;
    std::function<void(std::vector<char>&)> spoil;
  };
  std::mt19937 random(25);
  const std::array ways{
      Way{"a bit of each bank", [&](auto& bytes) { bytes[40] ^= 1, bytes[bank + 40] ^= 1; }},
      Way{"an unknown version", [&](auto& bytes) { bytes[0] = 9, bytes[bank] = 9; }},
      Way{"no mark", [&](auto& bytes) { bytes[16] ^= 0x20, bytes[bank + 16] ^= 0x20; }},
      Way{"headers of zeros",
          [&](auto& bytes) {
            std::fill_n(bytes.begin(), 20, '\0');
            std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(bank), 20, '\0');
          }},
      Way{"random bytes",
          [&](auto& bytes) { std::generate(bytes.begin(), bytes.end(), [&] { return static_cast<char>(random()); }); }},
      Way{"text", [&](auto& bytes) { std::fill(bytes.begin(), bytes.end(), 'S'); }},
  };
  for (const Way& way : ways) {
    std::vector<char> bytes = good;
    way.spoil(bytes);
    put(bytes);
    {
      Drive drive(GetParam(), path);
      drive.expect_fault(way.name);
      drive.power_cycle();
      drive.expect_fault(way.name);
      // A new save repairs the memory.
      ASSERT_EQ(drive.save(), AbortCode::none) << way.name;
      drive.power_cycle();
      EXPECT_FALSE(drive.in_fault()) << way.name;
    }
  }
}

TEST_P(StoreDamage, AnErasedMemoryHoldsNothing) {
  for (const char fill : {'\0', '\xFF'}) {
    put(std::vector<char>(32 * 1024, fill));
    EXPECT_FALSE(Drive(GetParam(), path).in_fault());
  }
}

TEST_P(StoreDamage, AnotherProductsFile) {
  store_twice();
  for (const Maker& other : makers) {
    if (other.product == GetParam().product) continue;
    const std::vector<char> mine = content();
    Drive(other, path).expect_fault(other.product);
    EXPECT_EQ(content(), mine) << "it is not touched";
  }
}

TEST_P(StoreDamage, AFileThatIsDeletedWhileTheDriveRuns) {
  store_twice();
  Drive drive(GetParam(), path);
  ASSERT_FALSE(drive.in_fault());
  fs::remove(path);
  drive.expect_not_saved();
  drive.power_cycle();
  drive.expect_fault("the memory does not answer");
}

TEST_P(StoreDamage, AFileThatIsReplacedWhileTheDriveRuns) {
  store_twice();
  Drive drive(GetParam(), path);
  const std::vector<char> bytes = content();
  fs::rename(path, path + ".old");
  put(bytes);
  drive.expect_not_saved();
  drive.power_cycle();
  drive.expect_fault("the memory is another file");
}

// A reset over the bus reads the memory like a power-on.
TEST_P(StoreDamage, AResetOfTheNodeReadsTheDamageToo) {
  if (GetParam().ethercat) return;  // EtherCAT has no reset that reloads
  store_twice();
  Drive drive(GetParam(), path);
  std::vector<char> bytes = content();
  bytes[40] ^= 1, bytes[bytes.size() / 2 + 40] ^= 1;
  {
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  links::MemoryPort master(drive.line.buses()[0]->bus);
  ASSERT_TRUE(master.send(nmt(0x81, 0), drive.line.now()));
  drive.run();
  drive.expect_fault("reset node");
}

// 1011h on a damaged memory clears it, which does not count as a fault.
TEST_P(StoreDamage, RestoringTheFactoryValuesEndsTheDamage) {
  if (GetParam().save_index != 0x1010) return;  // has no 1011h
  store_twice();
  put(std::vector<char>(32 * 1024, 'S'));
  Drive drive(GetParam(), path);
  drive.expect_fault("damaged");
  ASSERT_EQ(drive.set(0x1011, 1, 0x64616F6C), AbortCode::none);
  drive.power_cycle();
  EXPECT_FALSE(drive.in_fault());
}

}  // namespace
}  // namespace store_damage_test
}  // namespace servodrome::line
