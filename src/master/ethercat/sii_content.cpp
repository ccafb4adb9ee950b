#include "master/ethercat/sii_content.hpp"

#include "ethercat/bytes.hpp"
#include "ethercat/esc/sii_interface.hpp"

namespace servodrome::master {

using ethercat::load_u16;
using ethercat::load_u32;

namespace {

// Byte addresses of the fixed part (ETG.1000.6 table 16).
constexpr std::size_t alias_at = 0x08;
constexpr std::size_t checksum_at = 0x0E;
constexpr std::size_t identity_at = 0x10;
constexpr std::size_t bootstrap_at = 0x28;
constexpr std::size_t mailbox_at = 0x30;
constexpr std::size_t protocols_at = 0x38;
constexpr std::size_t categories_at = 0x80;

// ETG.1000.6 table 17.
enum Category : std::uint16_t {
  strings = 10,
  general = 30,
  fmmu = 40,
  sync_manager = 41,
  tx_pdo = 50,
  rx_pdo = 51,
  dc = 60,
  end = 0xFFFF
};

using ByteView = std::span<const std::uint8_t>;

MailboxAreas areas(ByteView image, std::size_t at) {
  return {.out = {load_u16(&image[at]), load_u16(&image[at + 2])},
          .in = {load_u16(&image[at + 4]), load_u16(&image[at + 6])}};
}

std::vector<std::string> parse_strings(ByteView data) {
  std::vector<std::string> all;
  if (data.empty()) return all;
  std::size_t at = 1;
  for (unsigned i = 0; i < data[0] && at < data.size(); ++i) {
    const std::size_t length = std::min<std::size_t>(data[at], data.size() - at - 1);
    const ByteView text = data.subspan(at + 1, length);
    all.emplace_back(text.begin(), text.end());
    at += 1 + length;
  }
  return all;
}

class Parser {
 public:
  explicit Parser(SiiContent& content) : content_(content) {}

  void category(std::uint16_t type, ByteView data) {
    switch (type) {
      case general: take_general(data); break;
      case fmmu: content_.fmmus.assign(data.begin(), data.end()); break;
      case sync_manager: take_sync_managers(data); break;
      case tx_pdo: take_pdos(data, content_.tx_pdos); break;
      case rx_pdo: take_pdos(data, content_.rx_pdos); break;
      case dc: take_dc(data); break;
      default: break;
    }
  }

  std::vector<std::string> texts;

 private:
  // Strings are numbered from 1; 0: none.
  std::string text(std::uint8_t number) const {
    return number >= 1 && number <= texts.size() ? texts[number - 1U] : std::string();
  }

  void take_general(ByteView data) {
    if (data.size() < 6) return;
    content_.group = text(data[0]);
    content_.order = text(data[2]);
    content_.name = text(data[3]);
    content_.coe_details = data[5];
  }

  void take_sync_managers(ByteView data) {
    for (; data.size() >= 8; data = data.subspan(8)) {
      content_.sync_managers.push_back({.start = load_u16(data.data()),
                                        .length = load_u16(&data[2]),
                                        .control = data[4],
                                        .activate = data[6],
                                        .type = data[7]});
    }
  }

  void take_pdos(ByteView data, std::vector<Pdo>& pdos) {
    while (data.size() >= 8) {
      Pdo pdo{.index = load_u16(data.data()), .name = text(data[5])};
      if (data[3] != 0xFF) pdo.sync_manager = data[3];
      const std::size_t count = data[2];
      data = data.subspan(8);
      for (std::size_t i = 0; i < count && data.size() >= 8; ++i, data = data.subspan(8)) {
        pdo.entries.push_back({.object = {load_u16(data.data()), data[2]}, .bits = data[5], .name = text(data[3])});
      }
      pdos.push_back(std::move(pdo));
    }
  }

  void take_dc(ByteView data) {
    constexpr std::size_t size = 24;
    for (; data.size() >= size; data = data.subspan(size)) {
      content_.dc_modes.push_back({.name = text(data[18]),
                                   .sync0_cycle_ns = load_u32(data.data()),
                                   .sync0_shift_ns = ethercat::load<std::int32_t>(&data[4]),
                                   .sync1_shift_ns = ethercat::load<std::int32_t>(&data[8]),
                                   .sync1_factor = ethercat::load<std::int16_t>(&data[12]),
                                   .assign_activate = load_u16(&data[14]),
                                   .sync0_factor = ethercat::load<std::int16_t>(&data[16])});
    }
  }

  SiiContent& content_;
};

template <typename Take>
void for_each_category(ByteView image, Take take) {
  for (std::size_t at = categories_at; at + 4 <= image.size();) {
    const std::uint16_t type = load_u16(&image[at]);
    const std::size_t size = 2U * load_u16(&image[at + 2]);
    if (type == end || at + 4 + size > image.size()) return;
    take(type, image.subspan(at + 4, size));
    at += 4 + size;
  }
}

}  // namespace

SiiContent parse_sii(ByteView image) {
  SiiContent content;
  if (image.size() < categories_at) return content;
  content.checksum_right = ethercat::sii_checksum(image.first(14)) == image[checksum_at];
  content.alias = load_u16(&image[alias_at]);
  content.identity = {.vendor_id = load_u32(&image[identity_at]),
                      .product_code = load_u32(&image[identity_at + 4]),
                      .revision_number = load_u32(&image[identity_at + 8]),
                      .serial_number = load_u32(&image[identity_at + 12])};
  content.bootstrap = areas(image, bootstrap_at);
  content.mailbox = areas(image, mailbox_at);
  content.protocols = load_u16(&image[protocols_at]);
  Parser parser(content);
  // Reads the strings first, because they may stand after the categories that refer to them.
  for_each_category(image, [&](std::uint16_t type, ByteView data) {
    if (type == strings) parser.texts = parse_strings(data);
  });
  for_each_category(image, [&](std::uint16_t type, ByteView data) { parser.category(type, data); });
  return content;
}

}  // namespace servodrome::master
