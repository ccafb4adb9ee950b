// Mailbox services: SDO, SDO information, emergencies, files.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "ethercat_line.hpp"
#include "master/ethercat/coe_objects.hpp"

namespace servodrome::master::test {
namespace ethercat_master_coe_test {
namespace {

using dictionary::AbortCode;
using testing::HasSubstr;

std::vector<std::byte> counting(std::size_t size) {
  std::vector<std::byte> bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::byte>(i * 7 + 1);
  return bytes;
}

class CoeTest : public testing::Test {
 protected:
  CoeTest() { slave.to_pre_operational(); }
  AbortCode code_of(const std::function<void()>& call) {
    try {
      call();
    } catch (const CoeError& error) {
      return error.code();
    }
    return AbortCode::none;
  }

  EthercatLine line;
  EthercatSlave& slave = *line.open()[0];
  EthercatDevice& device = line.device(0);
};

TEST_F(CoeTest, SdosOfEverySize) {
  slave.coe().write<std::int16_t>(0x2006, 0, -42);
  EXPECT_EQ(device.objects.ranged, -42);
  EXPECT_EQ(slave.coe().read<std::int16_t>(0x2006), -42);
  slave.coe().write<std::uint64_t>(0x2003, 0, 0x1122334455667788);  // normal transfer
  EXPECT_EQ(slave.coe().read<std::uint64_t>(0x2003), 0x1122334455667788U);
  // Around the sizes at which a transfer becomes normal or segmented, or has a segment of less than 7 bytes.
  for (const std::size_t size :
       {1U, 4U, 5U, 239U, 240U, 241U, 242U, 246U, 247U, 248U, 249U, 486U, 487U, 488U, 2999U, 3000U}) {
    slave.coe().download({0x2002, 0}, counting(size));
    EXPECT_EQ(slave.coe().upload({0x2002, 0}), counting(size)) << size;
  }
  EXPECT_EQ(slave.coe().upload({0x1008, 0}).size(), std::string_view("Servodrome EtherCAT test device").size());
}

// Mails without a counter, the next one as soon as the master has read one.
struct Storm final : ethercat::SlaveInterposer {
  Dispatch sends(Mail& mail) override {
    mail.mailbox[5] &= 0x0F;
    return {Sending::pass, 1'000'000};
  }
};

TEST_F(CoeTest, EmergenciesWithoutEndDoNotKeepARequestFromItsTimeout) {
  Storm storm;
  device.slave.interpose(&storm);
  device.slave.emergency(0x3210, 0x05, {});
  const Time begun = line.now;
  EXPECT_EQ(code_of([&] { slave.coe().read<std::uint32_t>(0x1000); }), AbortCode::protocol_timed_out);
  EXPECT_LT(line.now - begun, 3s);
  EXPECT_EQ(slave.mailbox().emergencies().size(), 64U);
  device.slave.interpose(nullptr);
}

TEST_F(CoeTest, OnlyAnUploadWithoutAnAnswerIsRepeated) {
  struct Loss final : ethercat::SlaveInterposer {
    Dispatch sends(Mail&) override {
      if (answers == 0) return {};
      --answers;
      return {Sending::withhold};
    }
    unsigned answers = 0;
  } loss;
  device.slave.interpose(&loss);
  device.objects.ranged = 42;
  loss.answers = 1;
  EXPECT_EQ(slave.coe().read<std::int16_t>(0x2006), 42);
  loss.answers = 1;
  EXPECT_EQ(slave.coe().upload({0x1008, 0}).size(), std::string_view("Servodrome EtherCAT test device").size());
  loss.answers = 2;
  EXPECT_EQ(code_of([&] { slave.coe().read<std::int16_t>(0x2006); }), AbortCode::protocol_timed_out);
  loss.answers = 1;
  EXPECT_EQ(code_of([&] { slave.coe().write<std::int16_t>(0x2006, 0, 7); }), AbortCode::protocol_timed_out);
  EXPECT_EQ(device.objects.ranged, 7);
  device.slave.interpose(nullptr);
}

// The answer to a request that was given up arrives in the next upload of the same object.
TEST_F(CoeTest, ALateAnswerIsNotTakenForTheNextOne) {
  struct Late final : ethercat::SlaveInterposer {
    Dispatch sends(Mail&) override { return {holds ? Sending::hold : Sending::pass}; }
    bool holds = true;
  } late;
  device.slave.interpose(&late);
  device.objects.ranged = 42;
  slave.coe().limit_wait(1s);  // without a repetition, because the slave reads no mail while it holds its answer
  EXPECT_EQ(code_of([&] { slave.coe().read<std::int16_t>(0x2006); }), AbortCode::protocol_timed_out);
  device.objects.ranged = 43;
  late.holds = false;
  const Time begun = line.now;
  line.delay_back = [&] {
    if (line.now - begun > 100ms) device.slave.release_mail();
    return Time{};
  };
  EXPECT_EQ(slave.coe().read<std::int16_t>(0x2006), 43);
  line.delay_back = [] { return Time{}; };
  device.slave.interpose(nullptr);
}

TEST_F(CoeTest, TheWaitForAnAnswerCanBeLimited) {
  struct Silence final : ethercat::SlaveInterposer {
    Dispatch sends(Mail&) override { return {Sending::withhold}; }
  } silence;
  device.slave.interpose(&silence);
  slave.coe().limit_wait(50ms);
  const Time begun = line.now;
  EXPECT_EQ(code_of([&] { slave.coe().read<std::int16_t>(0x2006); }), AbortCode::protocol_timed_out);
  EXPECT_LT(line.now - begun, 60ms);
  device.slave.interpose(nullptr);
}

TEST_F(CoeTest, CompleteAccess) {
  std::vector<std::byte> record{std::byte{3}, std::byte{0}};
  for (const unsigned value : {0x1111U, 0x2222U, 0x3333U}) {
    record.push_back(static_cast<std::byte>(value));
    record.push_back(static_cast<std::byte>(value >> 8));
  }
  slave.coe().download_complete(0x2010, record);
  EXPECT_EQ(device.objects.record16, (std::array<std::uint16_t, 3>{0x1111, 0x2222, 0x3333}));
  EXPECT_EQ(slave.coe().upload_complete(0x2010), record);
  EXPECT_EQ(slave.coe().upload_complete(0x2010, false), std::vector<std::byte>(record.begin() + 2, record.end()));
  EXPECT_EQ(code_of([&] { slave.coe().upload_complete(0x6041); }), AbortCode::complete_access_not_supported);
}

TEST_F(CoeTest, AbortsCarryObjectCodeAndWords) {
  EXPECT_EQ(code_of([&] { slave.coe().upload({0x5555, 0}); }), AbortCode::object_does_not_exist);
  EXPECT_EQ(code_of([&] { slave.coe().upload({0x1018, 9}); }), AbortCode::sub_index_does_not_exist);
  EXPECT_EQ(code_of([&] { slave.coe().write<std::uint16_t>(0x6041, 0, 1); }), AbortCode::read_only);
  EXPECT_EQ(code_of([&] { slave.coe().write<std::int16_t>(0x2006, 0, 101); }), AbortCode::value_too_high);
  EXPECT_EQ(code_of([&] { slave.coe().download({0x2002, 0}, counting(3001)); }), AbortCode::length_too_high);
  EXPECT_THAT(problem_of([&] { slave.coe().write<std::int16_t>(0x2006, 0, 101); }),
              HasSubstr("mem:, slave 1001h, 2006:00: write refused: "));
  CoeObjects objects(slave);
  EXPECT_EQ(objects.read_if_present<std::uint16_t>(0x5555), std::nullopt);
  EXPECT_EQ(objects.read_text(0x1008), "Servodrome EtherCAT test device");
  EXPECT_EQ(objects.address(), 1U);
}

TEST_F(CoeTest, EveryListIsWhole) {
  const auto lengths = slave.coe().list_lengths();
  const auto all = slave.coe().list(ObjectList::all);
  std::vector<std::uint16_t> expected;
  for (const dictionary::Entry& entry : ethercat::test::device_table) {
    if (expected.empty() || expected.back() != entry.index) expected.push_back(entry.index);
  }
  EXPECT_EQ(all, expected);
  EXPECT_EQ(lengths[0], all.size());
  EXPECT_EQ(slave.coe().list(ObjectList::rx_pdo).size(), lengths[1]);
  EXPECT_EQ(slave.coe().list(ObjectList::tx_pdo).size(), lengths[2]);
  EXPECT_EQ(slave.coe().list(ObjectList::stored), std::vector<std::uint16_t>{0x2003});
}

// The last information of the slave comes again and again, and says that more follows.
TEST_F(CoeTest, InformationWithoutEndIsGivenUp) {
  struct Endless final : ethercat::SlaveInterposer {
    Dispatch sends(Mail& mail) override {
      mail.mailbox[5] &= 0x0F;  // no counter
      mail.mailbox[10] = 1;     // one more fragment
      return {Sending::pass, 1'000'000};
    }
  } endless;
  device.slave.interpose(&endless);
  EXPECT_EQ(code_of([&] { slave.coe().list(ObjectList::all); }), AbortCode::out_of_memory);
  device.slave.interpose(nullptr);
}

TEST_F(CoeTest, ASegmentWithoutDataThatIsNotTheLastIsRefused) {
  struct Empty final : ethercat::SlaveInterposer {
    Dispatch sends(Mail& mail) override {
      constexpr std::size_t command = ethercat::mailbox_header_size + ethercat::coe_header_size;
      const bool is_segment = mail.mailbox[command] >> 5 == 0;
      if (is_segment) ethercat::store_u16(mail.mailbox.data(), ethercat::coe_header_size + 1);
      return {};
    }
  } empty;
  slave.coe().download({0x2002, 0}, counting(3000));
  device.slave.interpose(&empty);
  const unsigned before = line.frames;
  EXPECT_EQ(code_of([&] { slave.coe().upload({0x2002, 0}); }), AbortCode::length_mismatch);
  EXPECT_LT(line.frames - before, 30U);
  device.slave.interpose(nullptr);
}

TEST_F(CoeTest, DescriptionsOfObjectsAndEntries) {
  const ObjectDescription object = slave.coe().describe(0x1018);
  EXPECT_EQ(object.name, "Identity object");
  EXPECT_EQ(object.type, 0x0023);
  EXPECT_EQ(object.highest_sub, 4);
  EXPECT_EQ(object.code, 9);
  const EntryDescription entry = slave.coe().describe(ObjectAddress{0x2006, 0});
  EXPECT_EQ(entry.name, "Ranged");
  EXPECT_EQ(entry.type, 0x0003);
  EXPECT_EQ(entry.bits, 16);
  EXPECT_EQ(entry.unit, 0x00B44700U);
  EXPECT_EQ(entry.default_value, (std::vector<std::uint8_t>{7, 0}));
  EXPECT_EQ(entry.minimum, (std::vector<std::uint8_t>{0x9C, 0xFF}));
  EXPECT_EQ(entry.maximum, (std::vector<std::uint8_t>{100, 0}));
  EXPECT_EQ(entry.access, entry_access::read | entry_access::write | entry_access::rx_pdo | entry_access::tx_pdo);
  EXPECT_EQ(code_of([&] { slave.coe().describe(0x5555); }), AbortCode::object_does_not_exist);
  EXPECT_EQ(code_of([&] { slave.coe().describe(ObjectAddress{0x1018, 9}); }), AbortCode::sub_index_does_not_exist);
}

TEST_F(CoeTest, ADescriptionOfAnotherObjectIsNoAnswer) {
  struct Other final : ethercat::SlaveInterposer {
    Dispatch sends(Mail& mail) override {
      ++mail.mailbox[place];
      return {};
    }
    std::size_t place = 12;  // index
  } other;
  slave.coe().set_timeout(20ms);
  device.slave.interpose(&other);
  EXPECT_THAT(problem_of([&] { slave.coe().describe(0x1018); }), HasSubstr("no answer in its mailbox"));
  EXPECT_THAT(problem_of([&] { slave.coe().describe(ObjectAddress{0x1018, 1}); }), HasSubstr("no answer"));
  other.place = 14;  // sub-index
  EXPECT_THAT(problem_of([&] { slave.coe().describe(ObjectAddress{0x1018, 1}); }), HasSubstr("no answer"));
  device.slave.interpose(nullptr);
}

TEST_F(CoeTest, EmergenciesBetweenAnswersAreKept) {
  device.slave.emergency(0x3210, 0x05, {1, 2, 3, 4, 5});
  EXPECT_EQ(slave.coe().read<std::int16_t>(0x2006), 7);
  ASSERT_EQ(slave.mailbox().emergencies().size(), 1U);
  EXPECT_EQ(text_of(slave.mailbox().emergencies()[0]),
            "EMCY 3210h DC link over-voltage, error register 05h, vendor 01 02 03 04 05");
  device.slave.emergency(0x0000, 0x00, {});
  CoeObjects objects(slave);
  ASSERT_TRUE(objects.latest_emergency().has_value());
  EXPECT_EQ(objects.latest_emergency()->code, 0);
}

// Each frame may be lost in either direction. A repeated request must act once, and no answer may be matched to another
// request.
TEST(CoeOverABadCable, LostFramesDoNotShow) {
  EthercatLine line({.master = {.timeout = 5ms, .retries = 20}});
  EthercatSlave& slave = *line.open()[0];
  slave.to_pre_operational();
  std::uint32_t seed = 3;
  const auto lost = [&seed] {
    seed = seed * 1664525U + 1013904223U;
    return seed >> 24 < 26;  // one in ten
  };
  slave.coe();
  line.lost_out = lost;
  line.lost_back = lost;
  for (int i = 0; i < 60; ++i) {
    const auto value = static_cast<std::int16_t>(i - 30);
    slave.coe().write<std::int16_t>(0x2006, 0, value);
    ASSERT_EQ(slave.coe().read<std::int16_t>(0x2006), value);
    const std::size_t size = 100 + 25U * static_cast<std::size_t>(i);
    slave.coe().download({0x2002, 0}, counting(size));
    ASSERT_EQ(slave.coe().upload({0x2002, 0}), counting(size));
  }
  EXPECT_GT(line.master->lost_frames(), 100U);
}

// The mailbox may still contain an earlier request when a frame is lost, so a full mailbox does not show that the new
// request has arrived.
TEST_F(CoeTest, ALostRequestIsSentAgainBehindAnEarlierOne) {
  struct Busy final : ethercat::SlaveInterposer {
    Receipt receives(std::span<std::uint8_t>) override { return is_busy ? Receipt::keep : Receipt::serve; }
    bool is_busy = true;
  } busy;
  slave.coe().write<std::int16_t>(0x2006, 0, 7);
  device.slave.interpose(&busy);
  MailboxClient& mailbox = slave.mailbox();
  const std::array<std::uint8_t, 10> earlier{0x00, 0x20, 0x40, 0x00, 0x10, 0x00};  // reads 1000h
  const std::array<std::uint8_t, 10> request{0x00, 0x20, 0x40, 0x06, 0x20, 0x00};  // reads 2006h
  mailbox.send(MailboxType::coe, earlier, 100ms);
  bool is_first = true;
  const Time end = line.now + 50ms;
  line.lost_out = [&] {
    if (line.now >= end && std::exchange(busy.is_busy, false)) device.slave.release_mail();
    return std::exchange(is_first, false);
  };
  mailbox.send(MailboxType::coe, request, 1s);
  const auto answer = mailbox.receive(MailboxType::coe, 200ms, [](const Mail& mail) { return mail[3] == 0x06; });
  ASSERT_TRUE(answer.has_value());
  EXPECT_EQ((*answer)[6], 7);
  device.slave.interpose(nullptr);
}

TEST_F(CoeTest, AnotherProgramGoesOnWithTheMailboxAsItIs) {
  slave.coe().write<std::int16_t>(0x2006, 0, 5);
  for (int i = 0; i < 9; ++i) {
    // Each iteration uses a new client, whose mailbox counter the slave does not know.
    EthercatSlave again(*line.master, line.found[0]);
    EXPECT_EQ(again.coe().read<std::int16_t>(0x2006), 5);
    EXPECT_EQ(again.coe().read<std::int16_t>(0x2006), 5);
  }
  EXPECT_EQ(device.events.changes.size(), 1U);  // to PREOP, once
}

TEST_F(CoeTest, NoAnswerSaysSo) {
  slave.coe();
  line.segment->set_powered(0, false, line.now);
  EXPECT_THAT(problem_of([&] { slave.coe().upload({0x1000, 0}); }), HasSubstr("frames do not come back"));
}

// Another master takes the slave from INIT to PREOP before the mailbox is set up.
TEST(EthercatMailbox, ASlaveThatLeavesInitByItselfIsRefused) {
  class Leaving final : public links::EthercatClient {
   public:
    void send(std::span<const std::uint8_t> content) override {
      frame_.assign(content.begin(), content.end());
      ethercat::Frame parsed;
      ethercat::parse_payload(frame_, parsed);
      for (ethercat::Datagram& datagram : parsed.datagrams()) {
        datagram.set_working_counter(1);
        if (datagram.offset() == ethercat::reg::al_status) datagram.data()[0] = ++reads_ == 3 ? 1 : 2;
      }
    }
    std::size_t receive(std::span<std::uint8_t> into, Time) override {
      std::copy(frame_.begin(), frame_.end(), into.begin());
      return std::exchange(frame_, {}).size();
    }
    Time now() const override { return Time{}; }
    void wait(Time) override {}
    std::string name() const override { return "mem:"; }

   private:
    std::vector<std::uint8_t> frame_;
    unsigned reads_ = 0;
  };
  EthercatMaster master(std::make_unique<Leaving>());
  FoundSlave found;
  found.station = first_station;
  found.sii.mailbox = {.out = {0x1000, 128}, .in = {0x1080, 128}};
  EthercatSlave slave(master, found);
  EXPECT_THAT(problem_of([&] { slave.mailbox(); }), HasSubstr("it has left INIT"));
}

// The lengths of its information memory, which may be damaged.
TEST(EthercatMailbox, AnImpossibleLengthIsRefused) {
  EthercatLine line;
  const std::vector<FoundSlave> found = scan_slaves(*line.master);
  for (const unsigned length : {1U, 5U, 15U, 1487U, 65535U}) {
    for (const bool is_out : {true, false}) {
      FoundSlave damaged = found[0];
      for (MailboxAreas* areas : {&damaged.sii.mailbox, &damaged.sii.bootstrap}) {
        *areas = found[0].sii.mailbox;
        (is_out ? areas->out : areas->in).length = static_cast<std::uint16_t>(length);
      }
      EthercatSlave slave(*line.master, damaged);
      const std::string lengths =
          fmt::format("mailboxes of {} and {} bytes", damaged.sii.mailbox.out.length, damaged.sii.mailbox.in.length);
      EXPECT_THAT(problem_of([&] { slave.to_pre_operational(); }), HasSubstr(lengths));
      EXPECT_THAT(problem_of([&] { slave.to_bootstrap(); }), HasSubstr(lengths));
    }
  }
}

class File final : public ethercat::FoeFiles {
 public:
  ethercat::FoeError open(std::string_view name, std::uint32_t password, bool writes) override {
    if (name != "parameters.csv") return ethercat::FoeError::not_found;
    if (password != 0x1234) return ethercat::FoeError::no_rights;
    if (writes) content.clear();
    return ethercat::FoeError::none;
  }
  ethercat::FoeError read(std::uint32_t position, std::span<std::uint8_t> into, std::size_t& count) override {
    count = std::min(into.size(), content.size() - position);
    std::copy_n(content.begin() + position, count, into.begin());
    return ethercat::FoeError::none;
  }
  ethercat::FoeError write(std::uint32_t, std::span<const std::uint8_t> data, bool last) override {
    content.insert(content.end(), data.begin(), data.end());
    complete = last;
    return ethercat::FoeError::none;
  }
  std::vector<std::uint8_t> content;
  bool complete = false;
};

TEST(EthercatFoe, FilesOfEverySizeAroundThePackets) {
  EthercatLine line({.profile = {.file_access = true}});
  File file;
  line.device(0).slave.set_files(&file);
  EthercatSlave& slave = *line.open()[0];
  EXPECT_TRUE(slave.has_foe());
  for (const std::size_t size : {0U, 1U, 243U, 244U, 245U, 488U, 5000U}) {
    std::vector<std::uint8_t> content(size);
    for (std::size_t i = 0; i < size; ++i) content[i] = static_cast<std::uint8_t>(i * 3);
    slave.foe().write("parameters.csv", content, 0x1234);
    EXPECT_TRUE(file.complete);
    EXPECT_EQ(file.content, content);
    EXPECT_EQ(slave.foe().read("parameters.csv", 0x1234), content) << size;
  }
  EXPECT_THAT(problem_of([&] { slave.foe().read("other", 0x1234); }),
              HasSubstr("file other: refused: file not found (8001h); check the name"));
  EXPECT_THAT(problem_of([&] { slave.foe().read("parameters.csv"); }), HasSubstr("no rights (800Ah)"));
}

TEST(EthercatFoe, ASlaveWithoutItSaysSoByAMailboxError) {
  EthercatLine line;
  EthercatSlave& slave = *line.open()[0];
  EXPECT_THAT(problem_of([&] { slave.foe().read("file"); }), HasSubstr("mailbox error 0002h: protocol not supported"));
}

}  // namespace
}  // namespace ethercat_master_coe_test
}  // namespace servodrome::master::test
