// Drives from the ESI files in tests/data/described, each with a different structure.
#include "described_support.hpp"
#include "ethercat/esc/esc.hpp"
#include "ethercat/slave/slave.hpp"

namespace servodrome::described {
namespace described_slave_test {
namespace {

using namespace test;

std::string device_of(const std::string& file) { return file == "several_devices.xml" ? "device = \"DUO-1\"" : ""; }

class SlaveRig : public Rig {
 public:
  explicit SlaveRig(const std::string& file)
      : Rig(data_file(file), device_of(file), device_of(file).empty() ? "" : "DUO-1") {}
};

class DescribedSlave : public ::testing::TestWithParam<const char*> {};

TEST_P(DescribedSlave, ServesWhatTheFileDescribes) {
  SlaveRig rig(GetParam());
  EXPECT_TRUE(rig.ethercat);
  const describe::EsiDevice& esi = rig.blueprint().ethercat->described;
  EXPECT_EQ(rig.read(0x1018, 1), *esi.device.vendor_id);
  EXPECT_EQ(rig.read(0x1018, 2), *esi.device.product_code);
  EXPECT_EQ(rig.read(0x1018, 3), *esi.device.revision_number);
  for (const describe::FileEntry& described : esi.device.entries) {
    const dictionary::Entry* entry = rig.objects().find(described.index, described.sub);
    ASSERT_NE(entry, nullptr) << fmt::format("{:04X}:{:02X}", described.index, described.sub);
    EXPECT_EQ(entry->type, described.type) << fmt::format("{:04X}:{:02X}", described.index, described.sub);
    EXPECT_EQ(entry->access, described.access) << fmt::format("{:04X}:{:02X}", described.index, described.sub);
  }
  EXPECT_EQ(rig.read(0x1C12, 0), 1);
  EXPECT_EQ(rig.read(0x1C12, 1), 0x1600);
  EXPECT_EQ(rig.read(0x1C13, 1), 0x1A00);
  EXPECT_EQ(rig.read(0x1600, 1), 0x60400010);
  EXPECT_EQ(rig.read(0x1A00, 1), 0x60410010);
}

TEST_P(DescribedSlave, HomesAndMoves) {
  SlaveRig rig(GetParam());
  rig.home(35);
  const std::int64_t from = rig.axis().plant().position_counts();
  const auto turn = static_cast<double>(rig.counts());
  rig.move(2 * static_cast<std::int64_t>(rig.counts()));
  EXPECT_NEAR(static_cast<double>(rig.axis().plant().position_counts() - from), 2 * turn, turn / 500);
}

INSTANTIATE_TEST_SUITE_P(Files, DescribedSlave,
                         ::testing::Values("dictionary_defaults.xml", "several_devices.xml", "process_data_only.xml",
                                           "slots_and_modules.xml"),
                         [](const auto& file) {
                           const std::string name = file.param;
                           return name.substr(0, name.find('.'));
                         });

TEST(DictionaryDefaults, AreTheBytesOfTheFile) {
  SlaveRig rig("dictionary_defaults.xml");
  EXPECT_EQ(rig.read(0x6081), 40000);
  EXPECT_EQ(rig.read(0x6099, 2), 5000);
  EXPECT_EQ(rig.counts(), 65536U);
  EXPECT_EQ(rig.blueprint().device.vendor_name, "Ger\xC3\xA4te A");
  const ethercat::Profile& profile = rig.blueprint().ethercat->profile;
  EXPECT_EQ(profile.mailbox_out.start, 0x1000);
  EXPECT_EQ(profile.mailbox_out.greatest_length, 128);
  EXPECT_EQ(profile.mailbox_in.start, 0x1400);
  EXPECT_EQ(profile.outputs_start, 0x1800);
  EXPECT_EQ(profile.inputs_start, 0x1C00);
  ASSERT_EQ(rig.blueprint().ethercat->dc_modes.size(), 2U);
  EXPECT_EQ(rig.blueprint().ethercat->dc_modes[1].assign_activate, 0x0300);
}

TEST(SeveralDevices, NewestRevisionOfTheOneThatIsAskedFor) {
  SlaveRig rig("several_devices.xml");
  EXPECT_EQ(rig.read(0x1018, 3), 2);
  EXPECT_EQ(rig.read(0x1018, 1), 40977);
  // Enumerations have the type of their base, padding is not an object, and the names select the values.
  EXPECT_EQ(rig.read(0x2200, 1), 1);
  EXPECT_EQ(rig.read(0x2200, 3), 1);
  EXPECT_EQ(rig.objects().find(0x2200, 2), nullptr);
  EXPECT_EQ(rig.objects().find(0x2200, 3)->type, dictionary::Type::unsigned8);
  EXPECT_EQ(rig.read(0x2201), -5);
  EXPECT_EQ(rig.write(0x2201, 0, 101), AbortCode::value_too_high);
  EXPECT_EQ(rig.write(0x2201, 0, -21), AbortCode::value_too_low);
  // A gap in the mapping, and a PDO that the assigned one excludes.
  EXPECT_EQ(rig.read(0x1600, 3), 8);
  EXPECT_EQ(rig.read(0x1600, 0), 4);
  EXPECT_EQ(rig.read(0x1601, 0), 2);
  // Also selected by product code.
  EXPECT_EQ(line::describe_product(data_file("several_devices.xml"), "0x302")->blueprint->device.product_name, "Trio");
  EXPECT_EQ(line::describe_product(data_file("several_devices.xml"), "Trio")->blueprint->device.product_code, 0x302U);
}

TEST(SeveralDevices, ListsThemWhenNoneIsNamed) {
  try {
    line::describe_product(data_file("several_devices.xml"), "");
    FAIL();
  } catch (const describe::DeviceFileError& error) {
    EXPECT_NE(std::string(error.what()).find("DUO-1 (#x00000301), TRIO-1 (#x00000302)"), std::string::npos)
        << error.what();
  }
}

TEST(ProcessDataOnly, HasTheReferenceDrivesObjects) {
  SlaveRig rig("process_data_only.xml");
  EXPECT_NE(rig.objects().find(0x6085, 0), nullptr);
  EXPECT_NE(rig.objects().find(0x3210, 1), nullptr);
  EXPECT_EQ(rig.read(0x1A00, 0), 5);
  EXPECT_EQ(rig.write(0x1600, 0, 0), AbortCode::read_only);  // fixed
  EXPECT_EQ(rig.blueprint().ethercat->sii.name, std::string("Micro 24/5"));
}

TEST(SlotsAndModules, FirstSlotHasItsDefaultModule) {
  SlaveRig rig("slots_and_modules.xml");
  EXPECT_EQ(rig.read(0x1600, 2), 0x607A0020);
  EXPECT_EQ(rig.read(0x1600, 0), 3);
  EXPECT_EQ(rig.read(0x6081), 40000);
}

}  // namespace
}  // namespace described_slave_test
}  // namespace servodrome::described
