#include "ethercat/slave/entry_description.hpp"
#include "slave_rig.hpp"

// Mailbox and CoE (ETG.1000.4 clause 5.6, ETG.1000.6 clause 5.6).
namespace servodrome::ethercat::test {
namespace ethercat_coe_test {
namespace {

class Mail : public SlaveRig {
 protected:
  void SetUp() override { to_pre_operational(); }
};

TEST_F(Mail, HeaderByteForByte) {
  post(3, {0x00, 0x20, 0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0}, 1);
  EXPECT_EQ(fetch(),
            (Bytes{0x0A, 0x00, 0x00, 0x00, 0x00, 0x13, 0x00, 0x30, 0x43, 0x00, 0x10, 0x00, 0x92, 0x01, 0x02, 0x00}));
  EXPECT_TRUE(fetch().empty());
}

TEST_F(Mail, CountersRunFrom1To7) {
  for (unsigned i = 0; i < 9; ++i) {
    post(3, {0x00, 0x20, 0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0});
    EXPECT_EQ(fetch()[5] >> 4, static_cast<int>(i % 7 + 1));
  }
}

TEST_F(Mail, TheSameCounterIsTheSameMessage) {
  const Bytes write_5 = join({words({0x2000}), head(0x2B, 0x2006, 0), {5, 0, 0, 0}});
  post(3, write_5, 3);
  EXPECT_FALSE(fetch().empty());
  objects.ranged = 0;
  post(3, write_5, 3);
  EXPECT_TRUE(fetch().empty());
  EXPECT_EQ(objects.ranged, 0);
  post(3, write_5, 0);  // 0: no counters
  EXPECT_FALSE(fetch().empty());
  post(3, write_5, 0);
  EXPECT_FALSE(fetch().empty());
  EXPECT_EQ(objects.ranged, 5);
}

TEST_F(Mail, RequestsWaitUntilTheAnswerIsRead) {
  post(3, join({words({0x2000}), head(0x2B, 0x2006, 0), {1, 0, 0, 0}}));
  post(3, join({words({0x2000}), head(0x2B, 0x2006, 0), {2, 0, 0, 0}}));
  EXPECT_EQ(objects.ranged, 1);
  EXPECT_FALSE(fetch().empty());
  EXPECT_EQ(objects.ranged, 2);
  EXPECT_FALSE(fetch().empty());
}

TEST_F(Mail, RepeatOfWhatWasReadLast) {
  post(3, {0x00, 0x20, 0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0});
  const Bytes first = fetch();
  write(0x080E, {0x03});
  EXPECT_EQ(line.get<std::uint8_t>(0, 0x080F), 0x02);
  EXPECT_EQ(fetch(), first);
  // If a newer one waits, the lost one is returned first.
  post(3, {0x00, 0x20, 0x40, 0x18, 0x10, 0x01, 0, 0, 0, 0});
  write(0x080E, {0x01});
  EXPECT_EQ(fetch(), first);
  const Bytes second = fetch();
  EXPECT_EQ(load_u32(&second[12]), 0x66668888U);
  EXPECT_TRUE(fetch().empty());
  write(0x080E, {0x03});
  EXPECT_EQ(fetch(), second);
}

TEST_F(Mail, ErrorReplies) {
  struct Case {
    const char* name;
    unsigned type;
    Bytes content;
    MailboxError error;
  };
  const Case cases[] = {
      {"EoE", 2, Bytes(10), MailboxError::unsupported_protocol},
      {"type 9", 9, Bytes(10), MailboxError::unsupported_protocol},
      {"empty", 3, {}, MailboxError::invalid_size},
      {"one byte", 3, {0}, MailboxError::size_too_short},
      {"short SDO", 3, {0x00, 0x20, 0x40, 0x00, 0x10, 0x00}, MailboxError::size_too_short},
      {"short information", 3, {0x00, 0x80, 0x01}, MailboxError::size_too_short},
      {"CoE service 9", 3, {0x00, 0x90, 0, 0, 0, 0, 0, 0, 0, 0}, MailboxError::service_not_supported},
  };
  for (const Case& one : cases) {
    post(one.type, one.content);
    const Bytes mail = fetch();
    ASSERT_EQ(mail.size(), 10U) << one.name;
    EXPECT_EQ(mail[5] & 0x0F, 0) << one.name;
    EXPECT_EQ(load_u16(&mail[6]), 1) << one.name;
    EXPECT_EQ(load_u16(&mail[8]), static_cast<unsigned>(one.error)) << one.name;
  }
  // A length beyond the mailbox.
  Bytes mail(mailbox_size);
  store_u16(mail.data(), mailbox_size);
  mail[5] = 0x03;
  write(0x1000, mail);
  EXPECT_EQ(load_u16(&fetch()[8]), static_cast<unsigned>(MailboxError::invalid_size));
}

TEST_F(Mail, EmergenciesWaitForTheMaster) {
  slave.emergency(0x3210, 0x05, {1, 2, 3, 4, 5});
  slave.emergency(0x0000, 0x00, {});
  EXPECT_EQ(fetch(), (Bytes{10, 0, 0, 0, 0, 0x13, 0x00, 0x10, 0x10, 0x32, 0x05, 1, 2, 3, 4, 5}));
  EXPECT_EQ(fetch(), (Bytes{10, 0, 0, 0, 0, 0x23, 0x00, 0x10, 0x00, 0x00, 0x00, 0, 0, 0, 0, 0}));
  EXPECT_TRUE(fetch().empty());
}

// As for a fault that is reset by SDO: first the answer, then the emergency.
TEST_F(Mail, AnEmergencyOfADownloadFollowsItsAnswer) {
  events.on_write = [this] { slave.emergency(0x0000, 0x00, {}); };
  post(3, {0x00, 0x20, 0x2B, 0x07, 0x20, 0x00, 0x34, 0x12, 0x00, 0x00});
  const Bytes answer = fetch();
  ASSERT_EQ(answer.size(), 16U);
  EXPECT_EQ(answer[7], 0x30);  // SDO response
  EXPECT_EQ(answer[8], 0x60);
  const Bytes emergency = fetch();
  ASSERT_EQ(emergency.size(), 16U);
  EXPECT_EQ(emergency[7], 0x10);
  EXPECT_TRUE(fetch().empty());
}

TEST_F(Mail, NoEmergencyWithoutAMailbox) {
  request(1);
  slave.emergency(0x3210, 0x05, {});
  to_pre_operational();
  EXPECT_TRUE(fetch().empty());
}

// ---- SDO ----

class Sdo : public Mail {};

TEST_F(Sdo, BytesOfEachService) {
  struct Case {
    const char* name;
    Bytes request, answer;
  };
  objects.wide = 0x1122334455667788;
  const Case cases[] = {
      {"upload u32", {0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0}, {0x43, 0x00, 0x10, 0x00, 0x92, 0x01, 0x02, 0x00}},
      {"upload u8", {0x40, 0x18, 0x10, 0x00, 0, 0, 0, 0}, {0x4F, 0x18, 0x10, 0x00, 0x04, 0, 0, 0}},
      {"upload u16", {0x40, 0xF1, 0x10, 0x02, 0, 0, 0, 0}, {0x4B, 0xF1, 0x10, 0x02, 0x04, 0, 0, 0}},
      {"upload u64",
       {0x40, 0x03, 0x20, 0x00, 0, 0, 0, 0},
       {0x41, 0x03, 0x20, 0x00, 8, 0, 0, 0, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11}},
      {"download i16", {0x2B, 0x06, 0x20, 0x00, 0x9C, 0xFF, 0, 0}, {0x60, 0x06, 0x20, 0x00, 0, 0, 0, 0}},
      {"download without size", {0x22, 0x06, 0x20, 0x00, 0x10, 0x00, 0, 0}, {0x60, 0x06, 0x20, 0x00, 0, 0, 0, 0}},
      {"download normal", {0x21, 0x06, 0x20, 0x00, 2, 0, 0, 0, 0x11, 0x00}, {0x60, 0x06, 0x20, 0x00, 0, 0, 0, 0}},
      {"unknown service", {0xE0, 0x06, 0x20, 0x05, 0, 0, 0, 0}, {0x80, 0x06, 0x20, 0x05, 0x01, 0x00, 0x04, 0x05}},
      {"too high", {0x2B, 0x06, 0x20, 0x00, 101, 0, 0, 0}, {0x80, 0x06, 0x20, 0x00, 0x31, 0x00, 0x09, 0x06}},
      {"too low", {0x2B, 0x06, 0x20, 0x00, 0x9B, 0xFF, 0, 0}, {0x80, 0x06, 0x20, 0x00, 0x32, 0x00, 0x09, 0x06}},
      {"too long", {0x23, 0x06, 0x20, 0x00, 1, 0, 0, 0}, {0x80, 0x06, 0x20, 0x00, 0x12, 0x00, 0x07, 0x06}},
      {"too short", {0x2F, 0x06, 0x20, 0x00, 1, 0, 0, 0}, {0x80, 0x06, 0x20, 0x00, 0x13, 0x00, 0x07, 0x06}},
      {"read only", {0x23, 0x00, 0x10, 0x00, 1, 0, 0, 0}, {0x80, 0x00, 0x10, 0x00, 0x02, 0x00, 0x01, 0x06}},
      {"write only", {0x40, 0x05, 0x20, 0x00, 0, 0, 0, 0}, {0x80, 0x05, 0x20, 0x00, 0x01, 0x00, 0x01, 0x06}},
      {"no object", {0x40, 0x99, 0x20, 0x00, 0, 0, 0, 0}, {0x80, 0x99, 0x20, 0x00, 0x00, 0x00, 0x02, 0x06}},
      {"no sub-index", {0x40, 0x18, 0x10, 0x05, 0, 0, 0, 0}, {0x80, 0x18, 0x10, 0x05, 0x11, 0x00, 0x09, 0x06}},
      {"no such command", {0xA0, 0x18, 0x10, 0x05, 0, 0, 0, 0}, {0x80, 0x18, 0x10, 0x05, 0x01, 0x00, 0x04, 0x05}},
      {"owner refuses", {0x2B, 0x07, 0x20, 0x00, 0xEE, 0, 0, 0}, {0x80, 0x07, 0x20, 0x00, 0x30, 0x00, 0x09, 0x06}},
  };
  for (const Case& one : cases) {
    EXPECT_EQ(sdo(one.request), one.answer) << one.name;
    EXPECT_EQ(answered_service, one.answer[0] == 0x80 ? 2U : 3U) << one.name;
  }
  EXPECT_EQ(objects.ranged, 0x11);
}

TEST_F(Sdo, SegmentedUploadOfEveryLength) {
  for (const std::uint32_t length : {0U, 1U, 4U, 5U, 112U, 113U, 119U, 120U, 231U, 232U, 239U, 1000U, 3000U}) {
    objects.big.length = length;
    for (std::uint32_t i = 0; i < length; ++i) objects.big.bytes[i] = static_cast<char>(i * 7 + i / 256);
    const Bytes value = upload(0x2002, 0);
    ASSERT_EQ(value.size(), length);
    EXPECT_TRUE(std::equal(value.begin(), value.end(), objects.big.bytes.begin(),
                           [](std::uint8_t a, char b) { return a == static_cast<std::uint8_t>(b); }));
    const unsigned rest = length > 112 ? length - 112 : 0;  // 128 - 6 - 2 - 8; then 128 - 6 - 2 - 1 each
    EXPECT_EQ(length > 4 ? segments : 0U, (rest + 118) / 119) << length;
  }
}

TEST_F(Sdo, SegmentedDownloadOfEveryLength) {
  for (const std::size_t length : {1U, 112U, 113U, 114U, 119U, 120U, 230U, 1000U, 3000U}) {
    const Bytes value = counting(length, 3);
    const std::size_t first = std::min<std::size_t>(length, 112);
    Bytes answer = sdo(join({head(0x21, 0x2002, 0), bytes_of(static_cast<std::uint32_t>(length)),
                             Bytes(value.begin(), value.begin() + static_cast<std::ptrdiff_t>(first))}));
    ASSERT_EQ(answer, (Bytes{0x60, 0x02, 0x20, 0, 0, 0, 0, 0}));
    unsigned toggle = 0;
    for (std::size_t at = first; at < length; toggle ^= 0x10U) {
      const std::size_t count = std::min<std::size_t>(length - at, 119);
      const std::size_t unused = count < 7 ? 7 - count : 0;
      const bool last = at + count == length;
      Bytes segment{static_cast<std::uint8_t>(toggle | unused << 1 | (last ? 1U : 0U))};
      segment.insert(segment.end(), value.begin() + static_cast<std::ptrdiff_t>(at),
                     value.begin() + static_cast<std::ptrdiff_t>(at + count));
      segment.resize(segment.size() + unused);
      answer = sdo(segment);
      ASSERT_EQ(answer, (Bytes{static_cast<std::uint8_t>(0x20 | toggle), 0, 0, 0, 0, 0, 0, 0}));
      at += count;
    }
    ASSERT_EQ(objects.big.length, length);
    EXPECT_EQ(upload(0x2002, 0), value);
  }
}

TEST_F(Sdo, SegmentsOutOfStep) {
  EXPECT_EQ(code_of(sdo({0x60, 0, 0, 0, 0, 0, 0, 0})), AbortCode::command_specifier_unknown);
  EXPECT_EQ(code_of(sdo({0x00, 0, 0, 0, 0, 0, 0, 0})), AbortCode::command_specifier_unknown);
  objects.big.length = 500;
  sdo({0x40, 0x02, 0x20, 0, 0, 0, 0, 0});
  EXPECT_EQ(code_of(sdo({0x70, 0, 0, 0, 0, 0, 0, 0})), AbortCode::toggle_bit_not_alternated);
  EXPECT_EQ(code_of(sdo({0x60, 0, 0, 0, 0, 0, 0, 0})), AbortCode::command_specifier_unknown);  // the transfer is over
  // More data than announced, and less.
  sdo(join({head(0x21, 0x2002, 0), bytes_of(120U), counting(112)}));
  EXPECT_EQ(code_of(sdo(join({Bytes{0x01}, counting(20)}))), AbortCode::length_too_high);
  sdo(join({head(0x21, 0x2002, 0), bytes_of(120U), counting(112)}));
  EXPECT_EQ(code_of(sdo(join({Bytes{0x01}, counting(7)}))), AbortCode::length_too_low);
  // Data too long for the object are refused immediately.
  EXPECT_EQ(code_of(sdo(join({head(0x21, 0x2002, 0), bytes_of(3001U), counting(112)}))), AbortCode::length_too_high);
  // A request for something else ends a transfer.
  sdo(join({head(0x21, 0x2002, 0), bytes_of(120U), counting(112)}));
  EXPECT_EQ(download(0x1C32, 1, 1, 2), AbortCode::none);
  EXPECT_EQ(code_of(sdo(join({Bytes{0x01}, counting(8)}))), AbortCode::command_specifier_unknown);
  // An abort ends a transfer without an answer.
  sdo({0x40, 0x02, 0x20, 0, 0, 0, 0, 0});
  EXPECT_TRUE(sdo({0x80, 0x02, 0x20, 0, 0, 0, 0, 0}).empty());
  EXPECT_EQ(code_of(sdo({0x60, 0, 0, 0, 0, 0, 0, 0})), AbortCode::command_specifier_unknown);
}

TEST_F(Sdo, CompleteAccessUpload) {
  EXPECT_EQ(upload(0x1018, 0, true),
            (Bytes{4, 0, 0x88, 0x88, 0x66, 0x66, 0x34, 0x12, 0, 0, 0x02, 0, 0x01, 0, 0, 0, 0, 0}));
  EXPECT_EQ(upload(0x1018, 1, true), (Bytes{0x88, 0x88, 0x66, 0x66, 0x34, 0x12, 0, 0, 0x02, 0, 0x01, 0, 0, 0, 0, 0}));
  EXPECT_EQ(upload(0x1C00, 0, true), (Bytes{4, 0, 1, 2, 3, 4}));
  // The number of entries comes from sub-index 0.
  EXPECT_EQ(upload(0x1C12, 0, true), (Bytes{1, 0, 0x00, 0x16}));
  // BOOLEANs are bits.
  objects.bits = {true, false, true, false, false, false, false, true, false, true};
  objects.after_bits = 0xABCD;
  EXPECT_EQ(upload(0x2011, 1, true), (Bytes{0x85, 0x02, 0xCD, 0xAB}));
  AbortCode code{};
  upload(0x1018, 2, true, &code);
  EXPECT_EQ(code, AbortCode::unsupported_access);
  upload(0x2006, 0, true, &code);
  EXPECT_EQ(code, AbortCode::complete_access_not_supported);
  // More than a mailbox: all entries of a full mapping.
  objects.communication.tx_mapping[0].count = 12;
  EXPECT_EQ(upload(0x1A00, 0, true).size(), 2U + 12 * 4);
}

TEST_F(Sdo, CompleteAccessDownload) {
  const auto down = [this](std::uint16_t index, unsigned sub, const Bytes& data) {
    return code_of(sdo(join({head(0x31, index, sub), bytes_of(static_cast<std::uint32_t>(data.size())), data})));
  };
  EXPECT_EQ(down(0x2010, 1, {1, 0, 2, 0, 3, 0}), AbortCode::none);
  EXPECT_EQ(objects.record16, (std::array<std::uint16_t, 3>{1, 2, 3}));
  EXPECT_EQ(down(0x2010, 0, {3, 0, 4, 0, 5, 0, 6, 0}), AbortCode::none);
  EXPECT_EQ(objects.record16, (std::array<std::uint16_t, 3>{4, 5, 6}));
  EXPECT_EQ(down(0x2010, 0, {3, 0, 4, 0, 5, 0}), AbortCode::length_too_low);
  EXPECT_EQ(down(0x2010, 1, {1, 0, 2, 0, 3, 0, 4, 0}), AbortCode::length_too_high);
  EXPECT_EQ(down(0x2011, 1, {0x03, 0x02, 0x34, 0x12}), AbortCode::none);
  EXPECT_TRUE(objects.bits[0] && objects.bits[1] && objects.bits[9] && !objects.bits[2]);
  EXPECT_EQ(objects.after_bits, 0x1234);
  // An assignment in one transfer, although its entries can only be written while sub-index 0 is 0.
  EXPECT_EQ(down(0x1C12, 0, words({2, 0x1600, 0x1601})), AbortCode::none);
  EXPECT_EQ(objects.communication.rx_assignment.count, 2);
  EXPECT_EQ(objects.communication.rx_assignment.pdo[1], 0x1601);
  EXPECT_EQ(down(0x1600, 0, join({words({1}), bytes_of(0x60400010U)})), AbortCode::none);
  EXPECT_EQ(objects.communication.rx_mapping[0].count, 1);
  EXPECT_EQ(down(0x1018, 1, Bytes(16)), AbortCode::read_only);
}

TEST_F(Sdo, AlwaysASingleAnswerPerRequest) {
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(upload(0x1008, 0).size(), 31U);
    EXPECT_TRUE(fetch().empty());
  }
}

// ---- PDO configuration ----

TEST_F(Sdo, MappingOnlyWithSubIndex0At0) {
  EXPECT_EQ(download(0x1600, 1, 0x60400010, 4), AbortCode::sub_index_0_not_zero);
  EXPECT_EQ(download(0x1600, 0, 0, 1), AbortCode::none);
  EXPECT_EQ(download(0x1600, 1, 0x60400010, 4), AbortCode::none);
  EXPECT_EQ(download(0x1600, 2, 0x60410010, 4), AbortCode::not_mappable);  // an input
  EXPECT_EQ(download(0x1600, 2, 0x60400020, 4), AbortCode::not_mappable);  // another length
  EXPECT_EQ(download(0x1600, 2, 0x60990010, 4), AbortCode::object_does_not_exist);
  EXPECT_EQ(download(0x1600, 2, 0x60400110, 4), AbortCode::sub_index_does_not_exist);
  EXPECT_EQ(download(0x1600, 2, 0x00000008, 4), AbortCode::none);  // a gap
  EXPECT_EQ(download(0x1600, 3, 0x607A0020, 4), AbortCode::none);
  EXPECT_EQ(download(0x1600, 0, 13, 1), AbortCode::value_too_high);
  EXPECT_EQ(download(0x1600, 0, 3, 1), AbortCode::none);
  EXPECT_EQ(download(0x1C12, 1, 0x1601, 2), AbortCode::sub_index_0_not_zero);
  EXPECT_EQ(download(0x1C12, 0, 0, 1), AbortCode::none);
  EXPECT_EQ(download(0x1C12, 1, 0x1A00, 2), AbortCode::value_invalid);
  EXPECT_EQ(download(0x1C12, 1, 0x1604, 2), AbortCode::value_invalid);
  EXPECT_EQ(download(0x1C12, 0, 2, 1), AbortCode::value_invalid);  // its second entry is empty
  EXPECT_EQ(download(0x1C12, 0, 1, 1), AbortCode::none);
}

// A PDO that is assigned twice is refused, because it is not defined which of the two would count.
TEST_F(Sdo, APdoIsAssignedOnce) {
  for (const auto& [index, first] :
       std::to_array<std::pair<std::uint16_t, std::uint16_t>>({{0x1C12, 0x1600}, {0x1C13, 0x1A00}})) {
    EXPECT_EQ(download(index, 0, 0, 1), AbortCode::none);
    EXPECT_EQ(download(index, 1, first, 2), AbortCode::none);
    EXPECT_EQ(download(index, 2, first + 1U, 2), AbortCode::none);
    EXPECT_EQ(download(index, 3, first, 2), AbortCode::none);  // allowed, because the master may change the others next
    EXPECT_EQ(download(index, 0, 3, 1), AbortCode::parameter_incompatible);
    EXPECT_EQ(download(index, 0, 2, 1), AbortCode::none);
    const Bytes whole = words({2, first, first});  // in one transfer
    EXPECT_EQ(code_of(sdo(join({head(0x31, index, 0), bytes_of(static_cast<std::uint32_t>(whole.size())), whole}))),
              AbortCode::parameter_incompatible);
  }
  // An assignment that was stored in this way.
  objects.communication.rx_assignment.count = 2;
  objects.communication.rx_assignment.pdo[0] = objects.communication.rx_assignment.pdo[1] = 0x1600;
  set_process_data(7, 7);
  EXPECT_EQ(request(4), (std::pair{0x12U, AlStatusCode::invalid_output_mapping}));
}

TEST_F(Sdo, MappingOnlyInPreOperational) {
  set_process_data(7, 7);
  ASSERT_EQ(request(4), good(4));
  EXPECT_EQ(download(0x1600, 0, 0, 1), AbortCode::device_state);
  EXPECT_EQ(download(0x1C13, 0, 0, 1), AbortCode::device_state);
  EXPECT_EQ(download(0x1C32, 1, 0, 2), AbortCode::device_state);
}

TEST_F(Sdo, SynchronisationParameters) {
  EXPECT_EQ(upload(0x1C32, 4), (Bytes{0x27, 0x00}));  // SYNC0, delayed by a local timer
  EXPECT_EQ(upload(0x1C33, 5), bytes_of(125'000U));
  EXPECT_EQ(download(0x1C32, 1, 1, 2), AbortCode::none);
  EXPECT_EQ(download(0x1C33, 1, 0x22, 2), AbortCode::none);
  EXPECT_EQ(download(0x1C32, 1, 3, 2), AbortCode::value_invalid);  // SYNC1 is not supported
  EXPECT_EQ(download(0x1C32, 1, 0x22, 2), AbortCode::value_invalid);
}

// ---- SDO information ----

class Information : public Mail {
 protected:
  // Opcode, then what follows the information header.
  Bytes ask(unsigned opcode, const Bytes& data) {
    return coe(8, join({{static_cast<std::uint8_t>(opcode), 0, 0, 0}, data}));
  }
};

TEST_F(Information, ListsInFragments) {
  Bytes answer = ask(1, words({0}));
  ASSERT_EQ(answer.size(), 4U + 12U);
  std::vector<std::uint16_t> counts;
  for (std::size_t i = 6; i < 16; i += 2) counts.push_back(load_u16(&answer[i]));
  std::vector<std::uint16_t> all, rx, tx, saved;
  for (const dictionary::Entry& entry : device_table) {
    const auto note = [&entry](std::vector<std::uint16_t>& list) {
      if (list.empty() || list.back() != entry.index) list.push_back(entry.index);
    };
    note(all);
    if ((static_cast<unsigned>(entry.pdo) & 1) != 0) note(rx);
    if ((static_cast<unsigned>(entry.pdo) & 2) != 0) note(tx);
    if (entry.saved) note(saved);
  }
  EXPECT_EQ(counts, (std::vector<std::uint16_t>{
                        static_cast<std::uint16_t>(all.size()), static_cast<std::uint16_t>(rx.size()),
                        static_cast<std::uint16_t>(tx.size()), static_cast<std::uint16_t>(saved.size()), 0}));
  // 34 bytes: 28 behind the header, 22 for indices.
  request(1);
  set_mailbox_anew(34);
  request(2);
  for (const auto& [list, expected] : {std::pair{1U, all}, {2U, rx}, {3U, tx}, {4U, saved}}) {
    answer = ask(1, words({list}));
    std::vector<std::uint16_t> indices;
    unsigned left = load_u16(&answer[2]);
    EXPECT_EQ(left, (expected.size() + 1 + 10) / 11 - 1);
    EXPECT_EQ(load_u16(&answer[4]), list);
    std::size_t from = 6;
    while (true) {
      EXPECT_EQ(answer[0], left != 0 ? 0x82 : 0x02);
      for (std::size_t i = from; i + 1 < answer.size(); i += 2) indices.push_back(load_u16(&answer[i]));
      if (left == 0) break;
      const Bytes mail = fetch();
      ASSERT_GT(mail.size(), 8U);
      answer.assign(mail.begin() + 8, mail.end());
      from = 4;
      EXPECT_EQ(load_u16(&answer[2]), --left);
    }
    EXPECT_EQ(indices, expected) << list;
    EXPECT_TRUE(fetch().empty());
  }
}

TEST_F(Information, ObjectDescriptions) {
  const auto text = [](const char* words) { return Bytes(words, words + std::strlen(words)); };
  EXPECT_EQ(ask(3, words({0x1000})), join({{4, 0, 0, 0, 0x00, 0x10, 0x07, 0x00, 0, 7}, text("Device type")}));
  EXPECT_EQ(ask(3, words({0x1018})), join({{4, 0, 0, 0, 0x18, 0x10, 0x23, 0x00, 4, 9}, text("Identity object")}));
  EXPECT_EQ(ask(3, words({0x1C12})),
            join({{4, 0, 0, 0, 0x12, 0x1C, 0x06, 0x00, 4, 8}, text("Sync manager 2 PDO assignment")}));
  EXPECT_EQ(ask(3, words({0x1599})), (Bytes{7, 0, 0, 0, 0x00, 0x00, 0x02, 0x06}));
}

TEST_F(Information, EntryDescriptions) {
  const auto text = [](const char* words) { return Bytes(words, words + std::strlen(words)); };
  // rpm, default 7, -100..100; INTEGER16, 16 bits, all access, both PDOs.
  EXPECT_EQ(ask(5, {0x06, 0x20, 0, 0x78}), join({{6, 0, 0, 0, 0x06, 0x20, 0, 0x78, 0x03, 0, 16, 0, 0xFF, 0x00},
                                                 {0x00, 0x47, 0xB4, 0x00},
                                                 {7, 0},
                                                 {0x9C, 0xFF},
                                                 {100, 0},
                                                 text("Ranged")}));
  EXPECT_EQ(ask(5, {0x06, 0x20, 0, 0x00}),
            join({{6, 0, 0, 0, 0x06, 0x20, 0, 0x00, 0x03, 0, 16, 0, 0xFF, 0x00}, text("Ranged")}));
  // BOOLEAN: 1 bit; a mapping: written in Pre-Operational only; a string: its length.
  EXPECT_EQ(ask(5, {0x20, 0x20, 0, 0}),
            join({{6, 0, 0, 0, 0x20, 0x20, 0, 0, 0x01, 0, 1, 0, 0x7F, 0x00}, text("Flag out")}));
  EXPECT_EQ(ask(5, {0x00, 0x16, 1, 0}),
            join({{6, 0, 0, 0, 0x00, 0x16, 1, 0, 0x07, 0, 32, 0, 0x0F, 0x00}, text("Mapped object 1")}));
  EXPECT_EQ(ask(5, {0x18, 0x10, 0, 0}),
            join({{6, 0, 0, 0, 0x18, 0x10, 0, 0, 0x05, 0, 8, 0, 0x07, 0x00}, text("SubIndex 000")}));
  EXPECT_EQ(ask(5, {0x08, 0x10, 0, 0})[10], 31 * 8 & 0xFF);
  EXPECT_EQ(ask(5, {0x18, 0x10, 9, 0}), (Bytes{7, 0, 0, 0, 0x11, 0x00, 0x09, 0x06}));
  EXPECT_EQ(ask(9, {0x18, 0x10, 9, 0}), (Bytes{7, 0, 0, 0, 0x01, 0x00, 0x04, 0x05}));
  EXPECT_EQ(ask(5, {0x18, 0x10}), (Bytes{7, 0, 0, 0, 0x13, 0x00, 0x07, 0x06}));
}

// A sub-index of a record without an entry has an empty description, like in other slaves. A sub-index above the
// highest one does not exist.
TEST_F(Information, GapsOfRecords) {
  EXPECT_EQ(ask(5, {0x32, 0x1C, 0x0E, 0x78}), (Bytes{6, 0, 0, 0, 0x32, 0x1C, 0x0E, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(ask(5, {0x32, 0x1C, 0x1F, 0}), (Bytes{6, 0, 0, 0, 0x32, 0x1C, 0x1F, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(ask(5, {0x32, 0x1C, 0x20, 0})[8], 0x01) << "sync error, BOOLEAN";
  EXPECT_EQ(ask(5, {0x32, 0x1C, 0x21, 0}), (Bytes{7, 0, 0, 0, 0x11, 0x00, 0x09, 0x06}));
  EXPECT_EQ(ask(5, {0x31, 0x1C, 0x01, 0}), (Bytes{7, 0, 0, 0, 0x00, 0x00, 0x02, 0x06})) << "no object";
  // Reading it is still refused.
  AbortCode code{};
  upload(0x1C32, 0x0E, false, &code);
  EXPECT_EQ(code, AbortCode::sub_index_does_not_exist);
}

// 10F1h and one entry of the record 2010h.
TEST_F(Information, StartUpParameters) {
  static constexpr StartUpParameter start_up[] = {{"PS", 0x10F1, 2, 10, ""}, {"PS", 0x2010, 3, 1, ""}};
  profile.start_up = start_up;
  EXPECT_EQ(load_u16(&ask(1, words({0}))[14]), 2);
  EXPECT_EQ(ask(1, words({5})), join({{2, 0, 0, 0}, words({5, 0x10F1, 0x2010})}));
  const auto access = [this](std::uint8_t sub) { return load_u16(&ask(5, {0x10, 0x20, sub, 0})[12]); };
  EXPECT_EQ(access(3), 0x023F);
  EXPECT_EQ(access(2), 0x003F);
}

TEST_F(Information, KindOfSynchronisationIsWrittenInPreOperationalOnly) {
  EXPECT_EQ(load_u16(&ask(5, {0x32, 0x1C, 1, 0})[12]), 0x000F);
  EXPECT_EQ(load_u16(&ask(5, {0x32, 0x1C, 2, 0})[12]), 0x003F);
}

TEST(Units, Codes) {
  EXPECT_EQ(unit_code("rpm"), 0x00B44700U);
  EXPECT_EQ(unit_code("ms"), 0xFD030000U);
  EXPECT_EQ(unit_code("100 us"), 0xFC030000U);
  EXPECT_EQ(unit_code("0.1%"), 0xFD000000U);
  EXPECT_EQ(unit_code("degC"), 0x002D0000U);
  EXPECT_EQ(unit_code("mNm"), 0xFD560000U);
  EXPECT_EQ(unit_code("furlong"), 0U);
  EXPECT_EQ(unit_code(""), 0U);
}

TEST_F(Information, EveryEntryFitsTheSmallestMailbox) {
  request(1);
  set_mailbox_anew(34);
  request(2);
  for (const dictionary::Entry& entry : device_table) {
    const Bytes answer =
        ask(5, {static_cast<std::uint8_t>(entry.index), static_cast<std::uint8_t>(entry.index >> 8), entry.sub, 0x78});
    ASSERT_GE(answer.size(), 14U);
    EXPECT_LE(answer.size(), 26U);
  }
  // Default, minimum and maximum of an UNSIGNED32 fill the mailbox completely; there is no room for the name.
  const Bytes answer = ask(5, {0x00, 0x16, 1, 0x70});
  EXPECT_EQ(answer.size(), 26U);
  EXPECT_EQ(answer[7], 0x70);
}

}  // namespace
}  // namespace ethercat_coe_test
}  // namespace servodrome::ethercat::test
