#include "slave_rig.hpp"

// File access over EtherCAT (ETG.1000.6 clause 5.8).
namespace servodrome::ethercat::test {
namespace ethercat_foe_test {
namespace {

struct MemoryFiles final : FoeFiles {
  FoeError open(std::string_view name, std::uint32_t password, bool writes) override {
    if (name != "parameters.bin") return FoeError::not_found;
    if (password != 0x1234) return FoeError::no_rights;
    if (writes) received.clear();
    complete = false;
    return FoeError::none;
  }
  FoeError read(std::uint32_t position, std::span<std::uint8_t> into, std::size_t& count) override {
    count = std::min(into.size(), content.size() - position);
    std::copy_n(content.begin() + position, count, into.begin());
    return FoeError::none;
  }
  FoeError write(std::uint32_t position, std::span<const std::uint8_t> data, bool last) override {
    if (position + data.size() > 1000) return FoeError::disk_full;
    EXPECT_EQ(position, received.size());
    received.insert(received.end(), data.begin(), data.end());
    complete = last;
    return FoeError::none;
  }
  std::string_view reason() const override { return why; }

  Bytes content, received;
  std::string why;
  bool complete = false;
};

class Foe : public SlaveRig {
 protected:
  static constexpr std::size_t packet = mailbox_size - 12;

  void SetUp() override {
    slave.set_files(&files);
    to_pre_operational();
  }
  Bytes foe(unsigned operation, std::uint32_t value, const Bytes& data = {}) {
    post(4, join({{static_cast<std::uint8_t>(operation), 0}, bytes_of(value), data}));
    const Bytes mail = fetch();
    if (mail.empty()) return {};
    EXPECT_EQ(mail[5] & 0x0F, 4);
    return {mail.begin() + 6, mail.end()};
  }
  static Bytes name(const char* text) { return Bytes(text, text + std::strlen(text)); }
  static Bytes error(FoeError code) { return join({{5, 0}, bytes_of(static_cast<std::uint32_t>(code))}); }

  MemoryFiles files;
};

TEST_F(Foe, ReadOfEveryLength) {
  for (const std::size_t length : {std::size_t{0}, std::size_t{1}, packet - 1, packet, packet + 1, 5 * packet}) {
    files.content = counting(length, 9);
    Bytes answer = foe(1, 0x1234, name("parameters.bin"));
    Bytes all;
    for (std::uint32_t number = 1;; ++number) {
      ASSERT_GE(answer.size(), 6U);
      ASSERT_EQ(answer[0], 3);
      ASSERT_EQ(load_u32(&answer[2]), number);
      all.insert(all.end(), answer.begin() + 6, answer.end());
      const bool last = answer.size() < packet + 6;
      answer = foe(4, number);
      if (last) break;
    }
    EXPECT_TRUE(answer.empty());
    EXPECT_EQ(all, files.content);
  }
}

TEST_F(Foe, WriteOfEveryLength) {
  for (const std::size_t length : {std::size_t{0}, std::size_t{1}, packet - 1, packet, packet + 1, 5 * packet}) {
    const Bytes content = counting(length, 5);
    ASSERT_EQ(foe(2, 0x1234, name("parameters.bin")), (Bytes{4, 0, 0, 0, 0, 0}));
    std::size_t at = 0;
    for (std::uint32_t number = 1;; ++number) {
      const std::size_t count = std::min(packet, length - at);
      const auto from = content.begin() + static_cast<std::ptrdiff_t>(at);
      EXPECT_FALSE(files.complete);
      ASSERT_EQ(foe(3, number, Bytes(from, from + static_cast<std::ptrdiff_t>(count))),
                join({{4, 0}, bytes_of(number)}));
      at += count;
      if (count < packet) break;
    }
    EXPECT_TRUE(files.complete);
    EXPECT_EQ(files.received, content);
  }
}

TEST_F(Foe, Errors) {
  EXPECT_EQ(foe(1, 0x1234, name("nothing")), error(FoeError::not_found));
  EXPECT_EQ(foe(2, 0, name("parameters.bin")), error(FoeError::no_rights));
  EXPECT_EQ(foe(3, 1, Bytes(3)), error(FoeError::illegal));
  EXPECT_EQ(foe(4, 1), error(FoeError::illegal));
  EXPECT_EQ(foe(9, 1), error(FoeError::illegal));
  foe(2, 0x1234, name("parameters.bin"));
  EXPECT_EQ(foe(3, 2, Bytes(3)), error(FoeError::packet_number_wrong));
  EXPECT_EQ(foe(3, 1, Bytes(3)), error(FoeError::illegal));  // the transfer is over
  foe(2, 0x1234, name("parameters.bin"));
  for (std::uint32_t number = 1; number <= 8; ++number) foe(3, number, Bytes(packet));
  EXPECT_EQ(foe(3, 9, Bytes(packet)), error(FoeError::disk_full));
  files.content = counting(500);
  foe(1, 0x1234, name("parameters.bin"));
  EXPECT_EQ(foe(4, 2), error(FoeError::packet_number_wrong));
  foe(1, 0x1234, name("parameters.bin"));
  EXPECT_TRUE(foe(5, 0x8000).empty());  // the master aborts
  EXPECT_EQ(foe(4, 1), error(FoeError::illegal));
  post(4, {1, 0, 0});
  EXPECT_EQ(load_u16(&fetch()[8]), static_cast<unsigned>(MailboxError::size_too_short));
}

// The error text is cut to the room in the mailbox. Tested: one byte less than the room, exactly the room, and longer
// texts.
TEST_F(Foe, ReasonsOfEveryLength) {
  for (const std::size_t length : {std::size_t{0}, std::size_t{1}, packet - 1, packet, packet + 1, 4 * packet}) {
    std::string text(length, 'x');
    if (!text.empty()) text.back() = 'y';
    files.why = text;
    const Bytes answer = foe(1, 0x1234, name("nothing"));
    ASSERT_GE(answer.size(), 6U) << length;
    EXPECT_EQ(Bytes(answer.begin(), answer.begin() + 6), error(FoeError::not_found));
    EXPECT_EQ(std::string(answer.begin() + 6, answer.end()), text.substr(0, packet)) << length;
  }
}

TEST_F(Foe, NotOfferedWithoutFiles) {
  slave.set_files(nullptr);
  post(4, join({{1, 0}, bytes_of(0U), name("parameters.bin")}));
  EXPECT_EQ(load_u16(&fetch()[8]), static_cast<unsigned>(MailboxError::unsupported_protocol));
}

}  // namespace
}  // namespace ethercat_foe_test
}  // namespace servodrome::ethercat::test
