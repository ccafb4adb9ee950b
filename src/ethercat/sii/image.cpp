#include "ethercat/sii/image.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "ethercat/bytes.hpp"
#include "ethercat/esc/sii_interface.hpp"
#include "ethercat/sii/defaults.hpp"

namespace servodrome::ethercat {

using dictionary::Entry;

namespace {

// Word addresses of the fixed part (ETG.1000.6 table 16).
constexpr std::size_t checksum_word = 0x07;
constexpr std::size_t identity_word = 0x08;
constexpr std::size_t mailbox_word = 0x18;
constexpr std::size_t protocols_word = 0x1C;
constexpr std::size_t size_word = 0x3E;
constexpr std::size_t version_word = 0x3F;
constexpr std::size_t categories_word = 0x40;

constexpr std::uint16_t protocol_coe = 0x0004;
constexpr std::uint16_t protocol_foe = 0x0008;

// Categories (ETG.1000.6 table 17).
constexpr std::uint16_t category_strings = 10;
constexpr std::uint16_t category_general = 30;
constexpr std::uint16_t category_fmmu = 40;
constexpr std::uint16_t category_sync_manager = 41;
constexpr std::uint16_t category_tx_pdo = 50;
constexpr std::uint16_t category_rx_pdo = 51;
constexpr std::uint16_t category_dc = 60;
constexpr std::uint16_t category_end = 0xFFFF;

constexpr std::uint16_t fixed_content = 0x0010;  // PDO flag: the mapping cannot be changed (ETG.2010)
constexpr std::uint8_t unassigned = 0xFF;        // sync manager number of a PDO that is not assigned by default

// The strings of an image, numbered from 1, without duplicates.
class Strings {
 public:
  // Returns 0 for an empty string, and if there is no room.
  std::uint8_t number_of(std::string_view text) {
    if (text.empty()) return 0;
    text = text.substr(0, 255);  // the length field has 8 bits
    for (std::size_t i = 0; i < count_; ++i) {
      if (strings_[i] == text) return static_cast<std::uint8_t>(i + 1);
    }
    if (count_ == strings_.size()) {
      overflow_ = true;
      return 0;
    }
    strings_[count_++] = text;
    return static_cast<std::uint8_t>(count_);
  }
  std::span<const std::string_view> all() const { return std::span(strings_).first(count_); }
  bool overflow() const { return overflow_; }

 private:
  std::array<std::string_view, 255> strings_{};
  std::size_t count_ = 0;
  bool overflow_ = false;
};

class Writer {
 public:
  explicit Writer(std::span<std::uint8_t> image) : image_(image) {}

  void u8(unsigned value) {
    if (at_ < image_.size()) image_[at_] = static_cast<std::uint8_t>(value);
    ++at_;
  }
  void u16(unsigned value) { u8(value & 0xFF), u8(value >> 8 & 0xFF); }
  void u32(std::uint32_t value) { u16(value & 0xFFFF), u16(value >> 16); }
  void zeros(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) u8(0);
  }
  void begin(std::uint16_t category) {
    u16(category);
    u16(0);
    start_ = at_;
  }
  void end() {
    if (at_ % 2 != 0) u8(0);
    if (start_ <= image_.size()) store_u16(&image_[start_ - 2], static_cast<unsigned>((at_ - start_) / 2));
  }
  bool nothing() const { return at_ == start_; }
  void drop() { at_ = start_ - 4; }
  void go_to_word(std::size_t word) { at_ = word * 2; }
  std::size_t size() const { return at_; }

 private:
  std::span<std::uint8_t> image_;
  std::size_t at_ = 0;
  std::size_t start_ = 0;
};

void put_pdos(Writer& writer, const Defaults& defaults, std::uint16_t category, Strings& strings) {
  const PdoDirection& direction = category == category_rx_pdo ? rx_pdos : tx_pdos;
  writer.begin(category);
  for (const Entry& entry : defaults.table) {
    if (!direction.has(entry)) continue;
    const auto count = static_cast<unsigned>(entry.default_value);
    writer.u16(entry.index);
    writer.u8(count);
    writer.u8(defaults.assigned(direction.assignment, entry.index) ? direction.sync_manager : unassigned);
    writer.u8(0);  // no synchronisation of its own
    writer.u8(strings.number_of(entry.name));
    writer.u16(entry.writable() ? 0U : fixed_content);
    for (unsigned sub = 1; sub <= count; ++sub) {
      const Mapped mapped(defaults.value(entry.index, sub));
      const Entry* object = defaults.find(mapped.index, mapped.sub);
      writer.u16(mapped.index);
      writer.u8(mapped.sub);
      writer.u8(object == nullptr ? 0U : strings.number_of(object->name));
      writer.u8(object == nullptr ? 0U : static_cast<unsigned>(mapped_type(*object, mapped.bits)));
      writer.u8(mapped.bits);
      writer.u16(0);
    }
  }
  if (writer.nothing()) {
    writer.drop();
  } else {
    writer.end();
  }
}

void put_general(Writer& writer, const SiiDescription& description, const Profile& profile, Strings& strings) {
  writer.begin(category_general);
  writer.u8(strings.number_of(description.group));
  writer.u8(0);  // no image
  writer.u8(strings.number_of(description.order));
  writer.u8(strings.number_of(description.name));
  writer.u8(0);
  // CoE: SDO, SDO information, PDO assignment and configuration, complete access.
  writer.u8(0x0F | (profile.complete_access ? 0x20U : 0U));
  writer.u8(profile.file_access ? 1U : 0U);
  writer.zeros(4);  // no EoE, SoE; DS402 channels and class are obsolete
  writer.u8(0x08);  // identification by AL status code
  writer.u16(static_cast<std::uint16_t>(description.current_ma));
  writer.zeros(2);
  writer.u16(0x0011);  // ports 0 and 1: MII
  writer.zeros(14);
  writer.end();
}

void put_sync_managers(Writer& writer, const Profile& profile, const Defaults& defaults) {
  writer.begin(category_sync_manager);
  for (const SyncManagerChannel& channel : sync_manager_channels(profile, defaults)) {
    writer.u16(channel.start);
    writer.u16(channel.default_length);
    writer.u8(channel.control);
    writer.u8(0);
    writer.u8(channel.enabled ? 1U : 0U);
    writer.u8(channel.type);
  }
  writer.end();
}

void put_dc(Writer& writer, std::span<const DcMode> modes, Strings& strings) {
  if (modes.empty()) return;
  writer.begin(category_dc);
  for (const DcMode& mode : modes) {
    writer.u32(mode.sync0_cycle_ns);
    writer.u32(mode.sync0_shift_ns);
    writer.u32(mode.sync1_shift_ns);
    writer.u16(static_cast<std::uint16_t>(mode.sync1_factor));
    writer.u16(mode.assign_activate);
    writer.u16(static_cast<std::uint16_t>(mode.sync0_factor));
    writer.u8(strings.number_of(mode.name));
    writer.u8(strings.number_of(mode.description));
    writer.zeros(4);
  }
  writer.end();
}

// Writes all categories except the strings. The strings come first in the image but are complete only after this pass.
void put_categories(Writer& writer, const SiiDescription& description, const Profile& profile, const Defaults& defaults,
                    Strings& strings) {
  strings.number_of(description.order);  // masters show string 1 as the slave's name
  put_general(writer, description, profile, strings);
  writer.begin(category_fmmu);
  writer.u8(1);  // outputs
  writer.u8(2);  // inputs
  writer.u8(3);  // state of the mailbox
  writer.u8(0);
  writer.end();
  put_sync_managers(writer, profile, defaults);
  put_pdos(writer, defaults, category_tx_pdo, strings);
  put_pdos(writer, defaults, category_rx_pdo, strings);
  put_dc(writer, description.dc_modes, strings);
  writer.u16(category_end);
}

}  // namespace

std::size_t write_sii_image(const SiiDescription& description, const Profile& profile,
                            std::span<const dictionary::Entry> table, std::span<std::uint8_t> image) {
  std::fill(image.begin(), image.end(), std::uint8_t{0xFF});
  if (image.size() < categories_word * 2) return 0;
  const Defaults defaults{table};
  Strings strings;
  Writer nowhere{{}};
  put_categories(nowhere, description, profile, defaults, strings);

  std::fill_n(image.begin(), categories_word * 2, std::uint8_t{0});
  Writer writer(image);
  writer.u16(description.pdi_control);
  writer.u16(description.pdi_configuration);
  writer.u16(description.sync_pulse_length);
  writer.u16(0);
  writer.u16(description.station_alias);
  writer.go_to_word(identity_word);
  for (const std::uint32_t value :
       {description.vendor_id, description.product_code, description.revision_number, description.serial_number}) {
    writer.u32(value);
  }
  const auto areas = [&writer](const AreaRule& out, const AreaRule& in) {
    for (const AreaRule& area : {out, in}) writer.u16(area.start), writer.u16(area.greatest_length);
  };
  if (profile.bootstrap) {
    writer.go_to_word(sii_bootstrap_byte / 2);
    areas(profile.bootstrap_out, profile.bootstrap_in);
  }
  writer.go_to_word(mailbox_word);
  areas(profile.mailbox_out, profile.mailbox_in);
  writer.go_to_word(protocols_word);
  writer.u16(protocol_coe | (profile.file_access ? protocol_foe : 0U));
  writer.go_to_word(size_word);
  writer.u16(static_cast<unsigned>(image.size() / 128 - 1));  // in KiBit, minus one
  writer.go_to_word(version_word);
  writer.u16(1);
  image[checksum_word * 2] = sii_checksum(image.first(sii_config_bytes));

  writer.begin(category_strings);
  writer.u8(static_cast<unsigned>(strings.all().size()));
  for (const std::string_view text : strings.all()) {
    writer.u8(static_cast<unsigned>(text.size()));
    for (const char c : text) writer.u8(static_cast<std::uint8_t>(c));
  }
  writer.end();
  put_categories(writer, description, profile, defaults, strings);
  return writer.size() <= image.size() && !strings.overflow() ? writer.size() : 0;
}

}  // namespace servodrome::ethercat
