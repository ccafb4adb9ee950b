#include <map>
#include <string>

#include "ethercat/sii/image.hpp"
#include "slave_rig.hpp"

// The slave information memory, read by a parser that shares no code with the writer (ETG.1000.6 clause 5.4).
namespace servodrome::ethercat::test {
namespace ethercat_sii_test {
namespace {

constexpr DcMode dc_modes[] = {{"Synchron", "SM-Synchron"}, {"DC", "DC-Synchron", 0, 250'000, 0, 1, 0x0300, 1}};

SiiDescription device_description() {
  SiiDescription description;
  description.vendor_id = 0x66668888;
  description.product_code = 0x1234;
  description.revision_number = 0x00010002;
  description.serial_number = 77;
  description.station_alias = 0x0042;
  description.sync_pulse_length = 100;
  description.group = "Drives";
  description.order = "SD-EC";
  description.name = "Servodrome EtherCAT test device";
  description.current_ma = -120;
  description.dc_modes = dc_modes;
  return description;
}

struct Category {
  unsigned type;
  Bytes data;
};

struct Parsed {
  std::vector<Category> categories;
  std::vector<std::string> strings{""};
  std::size_t end = 0;

  explicit Parsed(const Bytes& image) {
    std::size_t at = 128;
    while (load_u16(&image[at]) != 0xFFFF) {
      const std::size_t size = load_u16(&image[at + 2]) * 2U;
      const auto from = image.begin() + static_cast<std::ptrdiff_t>(at) + 4;
      categories.push_back({load_u16(&image[at]), Bytes(from, from + static_cast<std::ptrdiff_t>(size))});
      at += 4 + size;
    }
    end = at + 2;
    const Bytes& text = of(10);
    std::size_t place = 1;
    for (unsigned i = 0; i < text[0]; ++i) {
      strings.emplace_back(text.begin() + static_cast<std::ptrdiff_t>(place) + 1,
                           text.begin() + static_cast<std::ptrdiff_t>(place) + 1 + text[place]);
      place += 1U + text[place];
    }
    EXPECT_LE(text.size() - place, 1U);  // padding to a word
  }
  const Bytes& of(unsigned type) const {
    static const Bytes none;
    for (const Category& category : categories) {
      if (category.type == type) return category.data;
    }
    return none;
  }
};

class Image : public testing::Test {
 protected:
  Profile profile;
  Bytes image = Bytes(2048);
  std::size_t used = write_sii_image(device_description(), profile, device_table, image);
};

TEST_F(Image, FixedPart) {
  ASSERT_GT(used, 128U);
  const auto word = [this](std::size_t n) { return load_u16(&image[2 * n]); };
  EXPECT_EQ(word(0), 0x0E08);
  EXPECT_EQ(word(2), 100);
  EXPECT_EQ(word(4), 0x0042);
  EXPECT_EQ(image[14], sii_checksum(std::span(image).first(14)));
  EXPECT_EQ(load_u32(&image[16]), 0x66668888U);
  EXPECT_EQ(load_u32(&image[20]), 0x1234U);
  EXPECT_EQ(load_u32(&image[24]), 0x00010002U);
  EXPECT_EQ(load_u32(&image[28]), 77U);
  EXPECT_EQ(load<std::uint64_t>(&image[40]), 0U);  // no bootstrap
  EXPECT_EQ(Bytes(image.begin() + 48, image.begin() + 58), words({0x1000, 256, 0x1100, 256, 4}));
  EXPECT_EQ(word(0x3E), 15);  // 16 KiBit
  EXPECT_EQ(word(0x3F), 1);
  for (std::size_t i = used; i < image.size(); ++i) ASSERT_EQ(image[i], 0xFF);
}

TEST_F(Image, CategoriesInTheirOrder) {
  const Parsed parsed(image);
  std::vector<unsigned> types;
  for (const Category& category : parsed.categories) types.push_back(category.type);
  EXPECT_EQ(types, (std::vector<unsigned>{10, 30, 40, 41, 50, 51, 60}));
  EXPECT_EQ(parsed.end, used);
  // No string occurs twice, and every string is used.
  std::map<std::string, int> seen;
  for (const std::string& text : parsed.strings) EXPECT_EQ(++seen[text], 1) << text;
}

TEST_F(Image, General) {
  const Parsed parsed(image);
  const Bytes& general = parsed.of(30);
  ASSERT_EQ(general.size(), 32U);
  EXPECT_EQ(parsed.strings[general[0]], "Drives");
  EXPECT_EQ(parsed.strings[general[2]], "SD-EC");
  EXPECT_EQ(parsed.strings[1], "SD-EC");
  EXPECT_EQ(parsed.strings[general[3]], "Servodrome EtherCAT test device");
  EXPECT_EQ(general[5], 0x2F);
  EXPECT_EQ(static_cast<std::int16_t>(load_u16(&general[12])), -120);
  EXPECT_EQ(load_u16(&general[16]), 0x0011);
}

TEST_F(Image, ATextIsCutWhereItsLengthEnds) {
  const std::string name(300, 'x');
  SiiDescription description = device_description();
  description.name = name.c_str();
  Bytes large(4096);
  ASSERT_GT(write_sii_image(description, profile, device_table, large), 0U);
  const Parsed parsed(large);
  const unsigned number = parsed.of(30)[3];
  ASSERT_LT(number, parsed.strings.size());
  EXPECT_EQ(parsed.strings[number], std::string(255, 'x'));
}

TEST_F(Image, FmmusAndSyncManagers) {
  const Parsed parsed(image);
  EXPECT_EQ(parsed.of(40), (Bytes{1, 2, 3, 0}));
  EXPECT_EQ(parsed.of(41), (Bytes{0x00, 0x10, 0x00, 0x01, 0x26, 0, 1, 1, 0x00, 0x11, 0x00, 0x01, 0x22, 0, 1, 2,
                                  0x00, 0x12, 0x07, 0x00, 0x64, 0, 1, 3, 0x00, 0x15, 0x07, 0x00, 0x20, 0, 1, 4}));
}

TEST_F(Image, Pdos) {
  const Parsed parsed(image);
  for (const bool outputs : {true, false}) {
    const Bytes& pdos = parsed.of(outputs ? 51 : 50);
    std::size_t at = 0;
    for (std::uint16_t i = 0; i < 4; ++i) {
      ASSERT_LE(at + 8, pdos.size());
      const auto index = static_cast<std::uint16_t>((outputs ? 0x1600 : 0x1A00) + i);
      EXPECT_EQ(load_u16(&pdos[at]), index);
      EXPECT_EQ(pdos[at + 3], i == 0 ? outputs ? 2 : 3 : 0xFF);
      EXPECT_EQ(parsed.strings[pdos[at + 5]], (outputs ? "RxPDO " : "TxPDO ") + std::to_string(i + 1) + " mapping");
      const unsigned count = pdos[at + 2];
      EXPECT_EQ(count, i == 0 ? 3U : 0U);
      at += 8;
      for (unsigned k = 1; k <= count; ++k, at += 8) {
        // The defaults of the dictionary.
        DeviceObjects objects;
        dictionary::Dictionary dictionary(device_table, std::as_writable_bytes(std::span(&objects, 1)));
        dictionary.load_defaults(dictionary::Area::all, 0);
        const auto mapping = static_cast<std::uint32_t>(dictionary.number(index, static_cast<std::uint8_t>(k)));
        const dictionary::Entry* object = dictionary.find(static_cast<std::uint16_t>(mapping >> 16), 0);
        EXPECT_EQ(load_u16(&pdos[at]), mapping >> 16);
        EXPECT_EQ(pdos[at + 2], mapping >> 8 & 0xFF);
        EXPECT_EQ(parsed.strings[pdos[at + 3]], object->name);
        EXPECT_EQ(pdos[at + 4], static_cast<unsigned>(object->type));
        EXPECT_EQ(pdos[at + 5], mapping & 0xFF);
      }
    }
    EXPECT_EQ(at, pdos.size());
  }
}

TEST_F(Image, DcModes) {
  const Parsed parsed(image);
  const Bytes& dc = parsed.of(60);
  ASSERT_EQ(dc.size(), 48U);
  EXPECT_EQ(load_u32(&dc[28]), 250'000U);
  EXPECT_EQ(load_u16(&dc[36]), 1);
  EXPECT_EQ(load_u16(&dc[38]), 0x0300);
  EXPECT_EQ(load_u16(&dc[40]), 1);
  EXPECT_EQ(parsed.strings[dc[42]], "DC");
  EXPECT_EQ(parsed.strings[dc[19]], "SM-Synchron");
}

TEST_F(Image, TooSmallAnImage) {
  for (std::size_t size = 0; size < used; size += 64) {
    Bytes small(size);
    EXPECT_EQ(write_sii_image(device_description(), profile, device_table, small), 0U) << size;
  }
  Bytes exact(used);
  EXPECT_EQ(write_sii_image(device_description(), profile, device_table, exact), used);
}

TEST_F(Image, BootstrapMailbox) {
  profile.bootstrap = true;
  profile.bootstrap_out = {0x1000, 64, 1024};
  profile.bootstrap_in = {0x1400, 64, 512};
  write_sii_image(device_description(), profile, device_table, image);
  EXPECT_EQ(Bytes(image.begin() + 40, image.begin() + 48), words({0x1000, 1024, 0x1400, 512}));
}

TEST_F(Image, FileAccess) {
  profile.file_access = true;
  write_sii_image(device_description(), profile, device_table, image);
  EXPECT_EQ(load_u16(&image[2 * 0x1C]), 0x000C);
  EXPECT_EQ(Parsed(image).of(30)[6], 1);
}

// Through the registers, as a master reads it.
TEST_F(Image, ReadThroughTheController) {
  Esc esc(image, {.read = Time{0}, .write = Time{0}});
  Segment::Slave slaves[]{{.esc = &esc}};
  Segment segment(slaves);
  const Time now{1};
  esc.power_on(now);
  EXPECT_EQ(esc.read_register<std::uint16_t>(reg::station_alias, now), 0x0042);
  for (std::uint32_t word = 0; word < image.size() / 2; word += 4) {
    std::array<std::uint8_t, max_frame> memory;
    FrameWriter writer = FrameWriter::ethernet(memory);
    const auto command = writer.add(Command::apwr, 0, address_of(0, reg::sii_control), 6);
    command[1] = 1;
    store_u32(&command[2], word);
    const auto data = writer.add(Command::aprd, 0, address_of(0, reg::sii_data), 8);
    segment.process(writer.bytes(), now);
    ASSERT_EQ(Bytes(data.begin(), data.end()), Bytes(image.begin() + word * 2, image.begin() + word * 2 + 8));
  }
}

}  // namespace
}  // namespace ethercat_sii_test
}  // namespace servodrome::ethercat::test
