// Drives from the descriptions in tests/data/described, each with a different structure.
#include <array>

#include "described_support.hpp"
#include "dictionary/store.hpp"
#include "drive/drive.hpp"
#include "links/can/memory_port.hpp"

namespace servodrome::described {
namespace described_drive_test {
namespace {

using namespace test;
using dictionary::Access;
using dictionary::Entry;

class Described : public ::testing::TestWithParam<const char*> {};

TEST_P(Described, ServesWhatTheFileDescribes) {
  Rig rig(data_file(GetParam()));
  const describe::DeviceFile& device = rig.blueprint().device;
  ASSERT_GT(device.entries.size(), 20U);
  std::size_t numbers = 0;
  for (const describe::FileEntry& described : device.entries) {
    const Entry* entry = rig.objects().find(described.index, described.sub);
    ASSERT_NE(entry, nullptr) << fmt::format("{:04X}:{:02X}", described.index, described.sub);
    EXPECT_EQ(entry->type, described.type) << entry->name;
    EXPECT_EQ(entry->access, described.access) << entry->name;
    const bool is_live = entry->owner == dictionary::Owner::drive && !entry->writable();
    const bool is_mapping_count = described.sub == 0 && described.index >= 0x1600 && described.index < 0x1C00;
    const bool is_number = described.line != 0 && described.default_value && entry->fixed_size() && entry->readable();
    // CapitalAccess tests the zeros.
    if (!is_number || is_live || is_mapping_count || *described.default_value == 0) continue;
    EXPECT_EQ(rig.read(described.index, described.sub),
              *described.default_value + (described.default_adds_node_id ? 1 : 0))
        << fmt::format("{:04X}:{:02X} {}", described.index, described.sub, entry->name);
    ++numbers;
  }
  EXPECT_EQ(rig.objects().table().size(), device.entries.size());
  EXPECT_GT(numbers, 20U);
}

TEST_P(Described, RefusesWhatTheTableRefuses) {
  Rig rig(data_file(GetParam()));
  EXPECT_EQ(rig.write(0x6041, 0, 0), AbortCode::read_only);
  EXPECT_EQ(rig.write(0x5FFF, 0, 0), AbortCode::object_does_not_exist);
  EXPECT_EQ(rig.write(0x1018, 9, 0), AbortCode::sub_index_does_not_exist);
  EXPECT_EQ(rig.write(0x6060, 0, 11), AbortCode::value_invalid);
  for (const Entry& entry : rig.objects().table()) {
    dictionary::ReadValue value;
    EXPECT_EQ(rig.objects().read(entry, value), entry.readable() ? AbortCode::none : AbortCode::write_only);
    if (!entry.has_range || !entry.writable() || entry.maximum == dictionary::maximum_of(entry.type)) continue;
    const AbortCode abort = rig.write(entry.index, entry.sub, entry.maximum + 1);
    EXPECT_EQ(abort, AbortCode::value_too_high) << fmt::format("{:04X}:{:02X}", entry.index, entry.sub);
  }
}

TEST_P(Described, HomesAndMoves) {
  Rig rig(data_file(GetParam()));
  rig.home(35);
  EXPECT_EQ(rig.read(0x6064), rig.read(0x607C) * -1);
  const std::int64_t revolution = rig.counts();
  const std::int64_t from = rig.axis().plant().position_counts();
  rig.move(2 * revolution);
  EXPECT_NEAR(static_cast<double>(rig.read(0x6064)), static_cast<double>(2 * revolution),
              static_cast<double>(revolution) / 500);
  // The shaft itself has turned twice.
  EXPECT_NEAR(static_cast<double>(rig.axis().plant().position_counts() - from), 2.0 * static_cast<double>(revolution),
              static_cast<double>(revolution) / 500);
  EXPECT_EQ(rig.read(0x6041) & 0x08, 0);
}

class Stored : public ::testing::TestWithParam<const char*> {};

TEST_P(Stored, OutlivesThePower) {
  Rig rig(data_file(GetParam()));
  const std::int64_t factory = rig.read(0x6081);
  ASSERT_EQ(rig.write(0x6081, 0, factory + 7), AbortCode::none);
  const auto restart = [&rig] {
    rig.axis().power_off(rig.line().now());
    rig.pass(10ms);
    rig.axis().power_on(rig.line().now());
    rig.pass(50ms);
  };
  restart();
  EXPECT_EQ(rig.read(0x6081), factory);
  ASSERT_EQ(rig.write(0x6081, 0, factory + 7), AbortCode::none);
  EXPECT_EQ(rig.write(0x1010, 1, 1), AbortCode::cannot_transfer_or_store);
  ASSERT_EQ(rig.write(0x1010, 1, dictionary::save_signature), AbortCode::none);
  restart();
  EXPECT_EQ(rig.read(0x6081), factory + 7);
  ASSERT_EQ(rig.write(0x1011, 1, dictionary::load_signature), AbortCode::none);
  restart();
  EXPECT_EQ(rig.read(0x6081), factory);
}

INSTANTIATE_TEST_SUITE_P(Files, Stored, ::testing::Values("mapping_counts.dcf", "capital_access.eds"));

INSTANTIATE_TEST_SUITE_P(Files, Described,
                         ::testing::Values("mapping_counts.dcf", "device_commissioning.dcf", "capital_access.eds",
                                           "compact_arrays.eds"),
                         [](const auto& file) {
                           const std::string name = file.param;
                           return name.substr(0, name.find('.'));
                         });

// ---- Special features of each description ----

TEST(MappingCounts, AreThoseOfTheMappedObjects) {
  Rig rig(data_file("mapping_counts.dcf"));
  EXPECT_EQ(rig.read(0x1600, 0), 1);
  EXPECT_EQ(rig.read(0x1600, 1), 0x60400010);
  EXPECT_EQ(rig.read(0x1602, 0), 2);
  EXPECT_EQ(rig.read(0x1602, 1), 0x607A0020);
  EXPECT_EQ(rig.read(0x1400, 1), 0x201);
  EXPECT_EQ(rig.counts(), 4096U);
  // 60E3h has -5, and 6502h has modes of the maker: the drive does not have them, and a note says so.
  const auto& absent = rig.blueprint().not_simulated;
  const auto says = [&absent](const std::string& text) {
    return std::any_of(absent.begin(), absent.end(), [&](const std::string& one) { return one.find(text) == 0; });
  };
  EXPECT_TRUE(says("homing methods -5"));
  EXPECT_TRUE(says("modes of operation -1"));
  EXPECT_EQ(rig.read(0x6502), 0x000103AD);
  EXPECT_EQ(rig.write(0x6060, 0, -1), AbortCode::value_invalid);
  EXPECT_EQ(rig.write(0x6098, 0, 3), AbortCode::value_invalid);  // not in 60E3h
}

TEST(MappingCounts, PdosAreThoseOfTheFile) {
  Rig rig(data_file("mapping_counts.dcf"));
  links::MemoryPort master(rig.line().buses()[0]->bus);
  const auto send = [&](std::uint32_t id, std::initializer_list<std::uint8_t> data) {
    canopen::Frame frame;
    frame.id = id;
    frame.length = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), frame.data.begin());
    ASSERT_TRUE(master.send(frame, rig.line().now()));
    rig.pass(5ms);
  };
  send(0x000, {1, 1});
  send(0x401, {0x10, 0x20, 0, 0, 0x30, 0, 0, 0});  // 1602h: 607Ah and 60FFh
  EXPECT_EQ(rig.read(0x607A), 0x2010);
  EXPECT_EQ(rig.read(0x60FF), 0x30);
  send(0x201, {6, 0});
  EXPECT_EQ(rig.read(0x6041) & 0x6F, 0x21);
}

TEST(DeviceCommissioning, ValuesOfTheDeviceGoBeforeDefaults) {
  Rig rig(data_file("device_commissioning.dcf"));
  EXPECT_EQ(rig.read(0x1400, 2), 1);
  EXPECT_EQ(rig.read(0x1018, 1), 0xA002);
  EXPECT_EQ(rig.read(0x1200, 1), 0x601);
  EXPECT_EQ(rig.read(0x1800, 1), 0x181);
}

TEST(CapitalAccess, ZerosThatWouldHoldTheAxisAreNoValues) {
  Rig rig(data_file("capital_access.eds"));
  EXPECT_EQ(rig.read(0x6072), 3000);
  EXPECT_EQ(rig.read(0x6091, 1), 1);
  EXPECT_GT(rig.read(0x6083), 0);
  EXPECT_EQ(rig.read(0x6092, 1), 1);  // as in the file
  EXPECT_FALSE(rig.blueprint().notes.empty());
  EXPECT_EQ(rig.read(0x1403, 1), 0x80000501);
}

// 6065h has 16 bits there and 32 in the drive.
TEST(CapitalAccess, ObjectsOfAnotherSizeReachTheDrive) {
  Rig rig(data_file("capital_access.eds"));
  EXPECT_EQ(rig.read(0x6065), 60000);
  ASSERT_EQ(rig.write(0x6065, 0, 5), AbortCode::none);
  EXPECT_EQ(rig.read(0x6065), 5);
  rig.enable(3);
  ASSERT_EQ(rig.write(0x60FF, 0, 10), AbortCode::none);
  rig.enable(1);
  // The window is 5 increments. A start that lasts longer than the timeout is a following error.
  rig.set(0x6083, 20'000'000);
  rig.set(0x6084, 20'000'000);
  rig.set(0x6081, 4'000'000);
  rig.set(0x607A, 500'000);
  rig.set(0x6040, 0x1F);
  EXPECT_TRUE(rig.wait_for(0x08, 3s)) << "no fault";
  EXPECT_EQ(rig.read(0x603F), 0x8611);
}

TEST(CapitalAccess, StringsAreKeptToo) {
  Rig rig(data_file("capital_access.eds"));
  const auto text = [&rig](std::uint16_t index) {
    dictionary::ReadValue value;
    EXPECT_EQ(rig.objects().read(*rig.objects().find(index, 0), value), AbortCode::none);
    return std::string(reinterpret_cast<const char*>(value.bytes.data()), value.bytes.size());
  };
  EXPECT_EQ(text(0x1008), "EU-11");
  EXPECT_EQ(text(0x2002), "abc");
  const std::string other = "another";
  ASSERT_EQ(rig.objects().write(*rig.objects().find(0x2002, 0), std::as_bytes(std::span(other))), AbortCode::none);
  EXPECT_EQ(text(0x2002), other);
}

TEST(CompactArrays, HaveTheirPartsNamesAndValues) {
  Rig rig(data_file("compact_arrays.eds"));
  EXPECT_EQ(rig.read(0x2100, 0), 3);
  EXPECT_EQ(rig.read(0x2100, 1), 100);
  EXPECT_EQ(rig.read(0x2100, 2), -250);
  EXPECT_STREQ(rig.objects().find(0x2100, 2)->name, "Peak");
  EXPECT_EQ(rig.read(0x2101, 1), 077);
  EXPECT_EQ(rig.read(0x608F, 1), 10000);
  EXPECT_EQ(rig.read(0x608F, 2), 1);
  EXPECT_EQ(rig.read(0x1018, 4), 77);
  EXPECT_EQ(rig.blueprint().device.vendor_name, "Struktur D, Z\xC3\xBCrich");
  EXPECT_TRUE(rig.blueprint().can.lss);
}

}  // namespace
}  // namespace described_drive_test
}  // namespace servodrome::described
