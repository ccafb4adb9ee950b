#include "test_device.hpp"

namespace servodrome::canopen::test {
namespace canopen_pdo_test {
namespace {

constexpr std::uint8_t synchronous = 1;
constexpr std::uint8_t event_driven = 255;

// ---- mapping ----

TEST(PdoMapping, ProcedureAndRefusals) {
  auto device = make_device();
  device->start();
  // While the PDO is valid, its mapping cannot change.
  EXPECT_EQ(device->write(0x1600, 0, 0, 1), AbortCode::unsupported_access);
  EXPECT_EQ(device->write(0x1600, 1, 0x60400010, 4), AbortCode::unsupported_access);
  EXPECT_EQ(device->write(0x1400, 1, 0x80000201, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1600, 0, 0, 1), AbortCode::none);
  struct Case {
    std::uint32_t mapped;
    AbortCode answer;
  };
  const Case rpdo_cases[] = {
      {0x60400010, AbortCode::none},
      {0x60410010, AbortCode::not_mappable},           // for TPDOs only
      {0x10050020, AbortCode::not_mappable},           // not in any PDO
      {0x20010008, AbortCode::not_mappable},           // a string
      {0x60400020, AbortCode::not_mappable},           // 16 bits, not 32
      {0x60400000, AbortCode::not_mappable},           // no bits
      {0x30000010, AbortCode::object_does_not_exist},  // no such object
      {0x60400110, AbortCode::object_does_not_exist},  // no such sub-index
      {0x00050008, AbortCode::none},                   // dummies
      {0x00010001, AbortCode::none},
      {0x001B0040, AbortCode::none},
      {0x00000000, AbortCode::none},  // empty
  };
  for (const Case& one : rpdo_cases) EXPECT_EQ(device->write(0x1600, 1, one.mapped, 4), one.answer) << one.mapped;
  EXPECT_EQ(device->write(0x1600, 0, 1, 1), AbortCode::object_does_not_exist) << "the entry is empty";
  EXPECT_EQ(device->write(0x1600, 0, 9, 1), AbortCode::value_invalid);
  EXPECT_EQ(device->write(0x1600, 0, 255, 1), AbortCode::value_invalid);
  EXPECT_EQ(device->write(0x1600, 1, 0x607A0020, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1600, 2, 0x60FF0020, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1600, 3, 0x60600008, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1600, 0, 3, 1), AbortCode::mapping_exceeds_pdo_length);
  EXPECT_EQ(device->write(0x1600, 0, 2, 1), AbortCode::none);
  EXPECT_EQ(device->write(0x1600, 2, 0x60600008, 4), AbortCode::unsupported_access) << "sub-index 0 is not 0";
  EXPECT_EQ(device->write(0x1400, 1, 0x00000201, 4), AbortCode::none);

  EXPECT_EQ(device->write(0x1800, 1, 0x80000181, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1A00, 1, 0x00050008, 4), AbortCode::not_mappable) << "dummies are for RPDOs";
  EXPECT_EQ(device->write(0x1A00, 1, 0x20080020, 4), AbortCode::none) << "a constant";
  EXPECT_EQ(device->write(0x1A00, 1, 0x10010008, 4), AbortCode::none) << "the error register";
}

TEST(PdoMapping, CobIdRules) {
  auto device = make_device();
  device->start();
  EXPECT_EQ(device->write(0x1800, 1, 0x00000182, 4), AbortCode::value_invalid) << "valid: other identifier";
  EXPECT_EQ(device->write(0x1800, 1, 0x40000181, 4), AbortCode::none) << "RTR may be forbidden at any time";
  EXPECT_EQ(device->write(0x1800, 1, 0x80000181, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1800, 1, 0x20000181, 4), AbortCode::value_invalid) << "extended frames";
  EXPECT_EQ(device->write(0x1800, 1, 0x00000981, 4), AbortCode::value_invalid) << "12 bits";
  for (const std::uint32_t restricted : {0x000U, 0x001U, 0x07FU, 0x101U, 0x180U, 0x581U, 0x5FFU, 0x601U, 0x67FU, 0x6E0U,
                                         0x6FFU, 0x701U, 0x77FU, 0x780U, 0x7FFU}) {
    EXPECT_EQ(device->write(0x1800, 1, restricted, 4), AbortCode::value_invalid) << restricted;
  }
  EXPECT_EQ(device->write(0x1800, 1, 0x000001FF, 4), AbortCode::none);
  // ESTUN manual, ch. 10.2: disable, then set.
  EXPECT_EQ(device->write(0x1400, 1, 0x80000201, 4), AbortCode::none);
  EXPECT_EQ(device->write(0x1400, 1, 0x00000201, 4), AbortCode::none);
}

TEST(PdoMapping, ProductsThatRemapValidPdos) {
  auto device = make_device<>({.valid_pdo_may_be_remapped = true, .valid_pdo_parameters_may_change = true});
  device->start();
  device->objects.statusword = 0x1234;
  // ESTUN manual, ch. 3.3, 'PDO mapping case', TPDO1 valid throughout.
  const char* const dialogue[] = {"601 # 2F 00 1A 00 00 00 00 00", "601 # 23 00 1A 01 10 00 41 60",
                                  "601 # 23 00 1A 02 08 00 61 60", "601 # 23 00 1A 03 20 00 64 60",
                                  "601 # 2F 00 1A 00 03 00 00 00", "601 # 2F 00 18 02 FF 00 00 00",
                                  "601 # 2B 00 18 03 14 00 00 00", "601 # 2B 00 18 05 0A 00 00 00"};
  for (const char* request : dialogue) {
    const Frame asked = frame_of(request);
    Frame expected = asked;
    expected.id = 0x581;
    expected.data[0] = 0x60;
    std::fill(expected.data.begin() + 4, expected.data.end(), std::uint8_t{0});
    EXPECT_EQ(device->send(request), (Frames{text_of(expected)})) << request;
  }
  EXPECT_EQ(device->send("000 # 01 01"), (Frames{"181 # 34 12 00 00 00 00 00"}));
}

TEST(PdoMapping, LengthBeyondTheObjectPadsWithZeros) {
  // ESTUN manual, ch. 3.3, T-PDO2: 6061h mapped with 16 bits.
  auto device = make_device<>({.mapped_length_may_exceed_object = true});
  device->start();
  device->map(0x1800, {0x60640020, 0x60610010});
  device->map(0x1400, {0x60600010, 0x60400010});
  device->objects.position_actual = -2;
  device->objects.modes_of_operation_display = -3;
  EXPECT_EQ(device->send("000 # 01 01"), (Frames{"181 # FE FF FF FF FD 00"}));
  device->send("201 # 07 99 0F 00");
  EXPECT_EQ(device->objects.modes_of_operation, 7);
  EXPECT_EQ(device->objects.controlword, 0x0F);
}

TEST(PdoMapping, SingleBits) {
  auto device = make_device<4, 64>();
  device->start();
  std::vector<std::uint32_t> mapped;
  for (std::uint32_t i = 0; i < 60; ++i) mapped.push_back(0x00010001);
  mapped[59] = 0x20100101;
  mapped.push_back(0x20100201);
  mapped.push_back(0x20100301);
  mapped.push_back(0x20100401);
  mapped.push_back(0x20100501);
  device->map(0x1400, mapped);
  device->map(0x1800, {0x20100101, 0x60610008, 0x20100201, 0x20100301, 0x20100401, 0x20100501});
  device->objects.modes_of_operation_display = -1;
  EXPECT_EQ(device->send("000 # 01 01"), (Frames{"181 # FE 01"}));
  device->send("201 # FF FF FF FF FF FF FF A7");
  const std::array<bool, 8> expected = {false, false, true, false, true, false, false, false};
  EXPECT_EQ(device->objects.bits, expected);
  EXPECT_EQ(device->image_updated(), (Frames{"181 # FE 15"}));
}

// ---- RPDO ----

// ISMC manual, ch. 6, Table 5-2 with the frames of ch. 4.3.6, 'Single point non immediate effective mode'.
TEST(Rpdo, ExampleMapping) {
  auto device = make_device();
  device->start();
  device->map(0x1400, {0x60400010, 0x60600008, 0x607A0020});
  device->map(0x1401, {0x60FF0020, 0x60810020});
  device->send("000 # 01 01");
  device->send("201 # 06 00 01 A0 86 01 00");
  device->send("301 # 00 00 00 00 40 42 0F 00");
  EXPECT_EQ(device->objects.controlword, 6);
  EXPECT_EQ(device->objects.modes_of_operation, 1);
  EXPECT_EQ(device->objects.target_position, 100000);
  EXPECT_EQ(device->objects.profile_velocity, 1000000U);
  EXPECT_TRUE(device->events.saw("rpdo 0"));
  EXPECT_TRUE(device->events.saw("rpdo 1"));
}

TEST(Rpdo, EveryTransmissionType) {
  for (unsigned type = 0; type <= 255; ++type) {
    auto device = make_device();
    device->start();
    const bool offered = type <= 240 || type >= 254;
    ASSERT_EQ(device->write(0x1400, 2, type, 1), offered ? AbortCode::none : AbortCode::value_invalid) << type;
    if (!offered) continue;
    device->map(0x1400, {0x60400010}, static_cast<std::uint8_t>(type));
    device->send("000 # 01 01");
    device->send("201 # 01 00");
    device->send("201 # 02 00");
    EXPECT_EQ(device->objects.controlword, type >= 254 ? 2 : 0) << type;
    device->send("080 #");
    EXPECT_EQ(device->objects.controlword, 2) << type;
  }
}

TEST(Rpdo, LengthErrors) {
  auto device = make_device();
  device->start();
  device->map(0x1400, {0x60400010, 0x60600008});
  device->send("000 # 01 01");
  EXPECT_EQ(device->send("201 # 01 00"), (Frames{"081 # 10 82 11 00 00 00 00 00"}));
  EXPECT_EQ(device->objects.controlword, 0) << "not processed";
  EXPECT_EQ(device->send("201 # 01 00"), Frames{}) << "told once";
  EXPECT_EQ(device->send("201 # 01 00 03"), (Frames{"081 # 00 00 00 00 00 00 00 00"}));
  EXPECT_EQ(device->objects.controlword, 1);
  EXPECT_EQ(device->send("201 # 02 00 03 99"), (Frames{"081 # 20 82 11 00 00 00 00 00"}));
  EXPECT_EQ(device->objects.controlword, 2) << "the first bytes are processed";
  EXPECT_EQ(device->send("201 # 02"), (Frames{"081 # 10 82 11 00 00 00 00 00", "081 # 00 00 11 00 00 00 00 00"}));
}

TEST(Rpdo, RefusedValuesLeaveTheirObjectAlone) {
  struct Owner final : dictionary::Listener {
    AbortCode check(const dictionary::Entry&, std::span<const std::byte> value) override {
      return value[0] == std::byte{0x99} ? AbortCode::local_control : AbortCode::none;
    }
    void written(const dictionary::Entry& entry) override { last = entry.index; }
    int last = 0;
  } owner;
  auto device = make_device();
  device->dictionary.set_listener(dictionary::Owner::drive, &owner);
  device->start();
  device->map(0x1400, {0x20060010, 0x20070010, 0x60400010});
  device->send("000 # 01 01");
  device->send("201 # 9C FF 01 00 01 00");
  EXPECT_EQ(device->objects.ranged, -100);
  EXPECT_EQ(device->objects.owned, 1);
  EXPECT_EQ(owner.last, 0x2007);
  owner.last = 0;
  device->send("201 # 9B FF 99 00 02 00");
  EXPECT_EQ(device->objects.ranged, -100);
  EXPECT_EQ(device->objects.owned, 1);
  EXPECT_EQ(owner.last, 0);
  EXPECT_EQ(device->objects.controlword, 2) << "the others are written";
}

TEST(Rpdo, CommandsWithoutStorageReachTheirOwner) {
  static constexpr auto table = dictionary::make_table<[] {
    using namespace dictionary;
    using C = CommunicationObjects<1, 1, 2>;
    TableBuilder<80> t;
    t.append(general_section<C>).append(rpdo_section<C>).append(dummy_section);
    t.add(var(0x2000, "", {Type::unsigned16}, Access::wo, Pdo::rpdo, {.owner = Owner::product}));
    return t;
  }>();
  struct Owner final : dictionary::Listener {
    AbortCode check(const dictionary::Entry&, std::span<const std::byte> value) override {
      command = static_cast<int>(dictionary::decode_number(dictionary::Type::unsigned16, value));
      return AbortCode::none;
    }
    int command = 0;
  } owner;
  CommunicationObjects<1, 1, 2> objects;
  objects.rpdo_parameters[0] = {.cob_id = 0x201, .transmission_type = 255};
  objects.rpdo_mappings[0] = {.count = 2, .objects = {0x00060010, 0x20000010}};
  dictionary::Dictionary dictionary(table, std::as_writable_bytes(std::span(&objects, 1)));
  dictionary.set_listener(dictionary::Owner::product, &owner);
  const Profile profile{.starts_operational = true};
  RecordingEvents events;
  NodeStorageFor<CommunicationObjects<1, 1, 2>> storage;
  Node node(dictionary, profile, events, storage.memory());
  node.start(1, 0s);
  node.receive(frame_of("201 # 11 11 34 12"), 0s);
  EXPECT_EQ(owner.command, 0x1234);
}

TEST(Pdo, ObjectsBeyondTheNodesMemoryAreRefused) {
  auto device = make_device();
  NodeStorage<2, 2> small;
  Node node(device->dictionary, device->profile, device->events, small.memory());
  node.start(1, 0s);
  EXPECT_EQ(device->dictionary.set_number(0x1401, 2, 1), AbortCode::none);
  EXPECT_EQ(device->dictionary.set_number(0x1402, 2, 1), AbortCode::out_of_memory);
  EXPECT_EQ(device->dictionary.set_number(0x1803, 2, 1), AbortCode::out_of_memory);
}

TEST(Rpdo, DummiesSkipOtherNodesData) {
  // ESTUN manual, ch. 10.2: one frame serves two nodes.
  auto device = make_device();
  device->start();
  device->map(0x1400, {0x00070020, 0x607A0020});
  device->send("000 # 01 01");
  device->send("201 # 11 11 11 11 10 00 00 00");
  EXPECT_EQ(device->objects.target_position, 16);
}

TEST(Rpdo, SeveralOfOneCanId) {
  auto device = make_device();
  device->start();
  for (const std::uint16_t parameter : std::array<std::uint16_t, 2>{0x1401, 0x1402}) {
    ASSERT_EQ(device->write(parameter, 1, 0x80000201, 4), AbortCode::none);
    ASSERT_EQ(device->write(parameter, 1, 0x00000201, 4), AbortCode::none);
  }
  device->map(0x1400, {0x60400010, 0x00060010});
  device->map(0x1401, {0x00060010, 0x20070010});
  device->map(0x1402, {0x60400010, 0x20060010}, synchronous);
  device->send("000 # 01 01");
  device->send("201 # 01 00 02 00");
  EXPECT_EQ(device->objects.controlword, 1);
  EXPECT_EQ(device->objects.owned, 2);
  EXPECT_EQ(device->objects.ranged, 0);
  device->send("080 #");
  EXPECT_EQ(device->objects.ranged, 2);
}

TEST(Rpdo, DeadlineMonitoring) {
  auto device = make_device();
  device->start();
  device->map(0x1400, {0x60400010});
  ASSERT_EQ(device->write(0x1400, 5, 20, 2), AbortCode::none);
  device->send("000 # 01 01");
  EXPECT_EQ(device->advance(1s), Frames{}) << "starts with the first reception";
  device->send("201 # 01 00");
  device->advance(20ms - 1ns);
  EXPECT_FALSE(device->events.saw("lost 2 33360 1"));
  EXPECT_EQ(device->advance(1ns), (Frames{"081 # 50 82 11 00 00 00 00 00"}));
  EXPECT_TRUE(device->events.saw("lost 2 33360 1"));
  EXPECT_EQ(device->node.nmt_state(), NmtState::operational);
  EXPECT_EQ(device->advance(1s), Frames{});
  EXPECT_EQ(device->send("201 # 01 00"), (Frames{"081 # 00 00 00 00 00 00 00 00"}));
}

// CiA 301 7.5.2.35, sub-index 5: a shorter time acts while the old one runs.
TEST(Rpdo, ShorterDeadlineActsAtOnce) {
  auto device = make_device();
  device->start();
  device->map(0x1400, {0x60400010});
  ASSERT_EQ(device->write(0x1400, 5, 60000, 2), AbortCode::none);
  device->send("000 # 01 01");
  device->send("201 # 01 00");
  device->advance(10ms);
  ASSERT_EQ(device->write(0x1400, 5, 50, 2), AbortCode::none);
  EXPECT_EQ(device->advance(50ms - 1ns), Frames{});
  EXPECT_EQ(device->advance(1ns), (Frames{"081 # 50 82 11 00 00 00 00 00"}));
  device->send("201 # 01 00");
  ASSERT_EQ(device->write(0x1400, 5, 60000, 2), AbortCode::none);
  EXPECT_EQ(device->advance(50ms), (Frames{"081 # 50 82 11 00 00 00 00 00"})) << "a longer time waits for an RPDO";
  EXPECT_EQ(device->advance(10min), Frames{});
}

// The timeout of an RPDO that is no longer monitored, or no longer valid, ends (CiA 301 7.2.7).
TEST(Rpdo, TimeoutEndsWithItsMonitoring) {
  struct Case {
    std::uint8_t sub;
    std::uint32_t value;
    unsigned size;
  };
  for (const Case& end : {Case{5, 0, 2}, {1, 0x80000201, 4}}) {
    auto device = make_device();
    device->start();
    device->map(0x1400, {0x60400010});
    ASSERT_EQ(device->write(0x1400, 5, 20, 2), AbortCode::none);
    device->send("000 # 01 01");
    device->send("201 # 01 00");
    EXPECT_EQ(device->advance(20ms), (Frames{"081 # 50 82 11 00 00 00 00 00"}));
    ASSERT_EQ(device->write(0x1400, 5, 30, 2), AbortCode::none);
    EXPECT_EQ(device->node.error_register(), 0x11) << "still monitored";
    ASSERT_EQ(device->write(0x1400, end.sub, end.value, end.size), AbortCode::none);
    EXPECT_EQ(device->others, (Frames{"081 # 00 00 00 00 00 00 00 00"}));
    EXPECT_EQ(device->node.error_register(), 0);
    EXPECT_TRUE(device->events.saw("restored 2"));
    ASSERT_EQ(device->write(0x1400, 1, 0x201, 4), AbortCode::none);
    EXPECT_EQ(device->advance(10s), Frames{});
  }
}

// A device may report the timeout in another way than by the EMCY of the node.
TEST(Rpdo, TimeoutWithoutAnEmergencyEnds) {
  auto device = make_device();
  LossReaction silent{0, ErrorBehaviour::no_change};
  device->events.override_reaction = &silent;
  device->start();
  device->map(0x1400, {0x60400010});
  ASSERT_EQ(device->write(0x1400, 5, 20, 2), AbortCode::none);
  device->send("000 # 01 01");
  device->send("201 # 01 00");
  EXPECT_EQ(device->advance(20ms), Frames{});
  EXPECT_TRUE(device->events.saw("lost 2 33360 1"));
  EXPECT_EQ(device->send("201 # 01 00"), Frames{});
  EXPECT_TRUE(device->events.saw("restored 2"));
}

// An RPDO that is changed or becomes invalid drops the data that wait for SYNC (CiA 301 7.5.2.35, 7.5.2.36).
TEST(Rpdo, ReconfigurationDropsDataThatWaitForSync) {
  auto device = make_device();
  device->start();
  device->map(0x1400, {0x60400010}, synchronous);
  device->map(0x1401, {0x607A0020}, synchronous);
  device->map(0x1402, {0x60810020}, synchronous);
  device->send("000 # 01 01");
  const auto fill = [&] {
    device->send("201 # 0F 00");
    device->send("301 # 01 00 00 00");
    device->send("401 # 02 00 00 00");
  };
  fill();
  ASSERT_EQ(device->write(0x1400, 2, event_driven, 1), AbortCode::none);
  device->send("201 # 06 00");
  EXPECT_EQ(device->objects.controlword, 6) << "acts at once";
  device->map(0x1401, {0x60FF0020}, synchronous);
  device->send("080 #");
  EXPECT_EQ(device->objects.controlword, 6);
  EXPECT_EQ(device->objects.target_position, 0);
  EXPECT_EQ(device->objects.target_velocity, 0) << "the old data were for another object";
  EXPECT_EQ(device->objects.profile_velocity, 2U) << "of an RPDO that did not change";
  device->send("301 # 03 00 00 00");
  device->send("080 #");
  EXPECT_EQ(device->objects.target_velocity, 3);
  for (int i = 0; i < 10; ++i) {  // the list of waiting RPDOs does not grow
    device->send("301 # 04 00 00 00");
    ASSERT_EQ(device->write(0x1401, 1, 0x80000301, 4), AbortCode::none);
    ASSERT_EQ(device->write(0x1401, 1, 0x00000301, 4), AbortCode::none);
  }
  device->send("080 #");
  EXPECT_EQ(device->objects.target_velocity, 3);
}

TEST(Rpdo, SynchronousWindow) {
  auto device = make_device();
  device->start();
  device->map(0x1400, {0x60400010}, synchronous);
  ASSERT_EQ(device->write(0x1007, 0, 500, 4), AbortCode::none);
  device->send("000 # 01 01");
  device->send("080 #");
  device->now += 500us;
  device->send("201 # 01 00");
  device->now += 1us;
  device->send("201 # 02 00");
  device->send("080 #");
  EXPECT_EQ(device->objects.controlword, 1);
}

TEST(Rpdo, NothingWaitsAcrossAnNmtState) {
  auto device = make_device();
  device->start();
  device->map(0x1400, {0x60400010}, synchronous);
  device->send("000 # 01 01");
  device->send("201 # 01 00");
  device->send("000 # 80 01");
  device->send("000 # 01 01");
  device->send("080 #");
  EXPECT_EQ(device->objects.controlword, 0);
}

// ---- TPDO ----

TEST(Tpdo, CyclicSynchronousTypes) {
  for (unsigned type = 1; type <= 240; ++type) {
    auto device = make_device();
    device->start();
    device->map(0x1800, {0x60410010}, static_cast<std::uint8_t>(type));
    EXPECT_EQ(device->send("000 # 01 01"), Frames{});
    for (unsigned sync = 1; sync <= 3 * type; ++sync) {
      device->objects.statusword = static_cast<std::uint16_t>(sync);
      ASSERT_EQ(device->send("080 #").size(), sync % type == 0 ? 1U : 0U) << type << ' ' << sync;
    }
  }
}

TEST(Tpdo, AcyclicSynchronousIsSentAfterAChange) {
  auto device = make_device();
  device->start();
  device->map(0x1800, {0x60410010}, 0);
  device->send("000 # 01 01");
  EXPECT_EQ(device->send("080 #"), (Frames{"181 # 00 00"})) << "the first of this operational phase";
  EXPECT_EQ(device->send("080 #"), Frames{});
  device->objects.statusword = 5;
  EXPECT_EQ(device->image_updated(), Frames{});
  EXPECT_EQ(device->send("080 #"), (Frames{"181 # 05 00"}));
  EXPECT_EQ(device->send("080 #"), Frames{});
  device->node.trigger_tpdo(0, device->now);
  EXPECT_EQ(device->send("080 #"), (Frames{"181 # 05 00"}));
}

TEST(Tpdo, RemoteTypes) {
  auto device = make_device();
  device->start();
  device->map(0x1800, {0x60410010}, 252);
  device->map(0x1801, {0x60410010}, 253);
  device->send("000 # 01 01");
  device->objects.statusword = 1;
  EXPECT_EQ(device->send("080 #"), Frames{});
  device->objects.statusword = 2;
  EXPECT_EQ(device->image_updated(), Frames{});
  EXPECT_EQ(device->send("181 RTR 2"), (Frames{"181 # 01 00"})) << "as sampled at the SYNC";
  EXPECT_EQ(device->send("281 RTR 2"), (Frames{"281 # 02 00"})) << "as it is now";
  EXPECT_EQ(device->send("381 RTR 2"), Frames{});
  ASSERT_EQ(device->write(0x1801, 1, 0x40000281, 4), AbortCode::none);
  EXPECT_EQ(device->send("281 RTR 2"), Frames{}) << "bit 30: no RTR";
  auto silent = make_device<>({.remote_frames = false});
  silent->start();
  silent->map(0x1800, {0x60410010}, 255);
  silent->send("000 # 01 01");
  EXPECT_EQ(silent->send("181 RTR 2"), Frames{});
}

TEST(Tpdo, SentOnChangeWithInhibitTime) {
  auto device = make_device();
  device->start();
  device->map(0x1800, {0x60410010});
  EXPECT_EQ(device->write(0x1800, 3, 50, 2), AbortCode::value_invalid) << "while valid";
  ASSERT_EQ(device->write(0x1800, 1, 0x80000181, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1800, 3, 50, 2), AbortCode::none);
  ASSERT_EQ(device->write(0x1800, 1, 0x00000181, 4), AbortCode::none);
  EXPECT_EQ(device->send("000 # 01 01"), (Frames{"181 # 00 00"}));
  EXPECT_EQ(device->image_updated(), Frames{});
  device->objects.statusword = 1;
  EXPECT_EQ(device->image_updated(), Frames{}) << "5 ms not over";
  device->objects.statusword = 2;
  EXPECT_EQ(device->advance(4999us), Frames{});
  EXPECT_EQ(device->node.next_deadline(), device->now + 1us);
  EXPECT_EQ(device->advance(1us), (Frames{"181 # 02 00"})) << "with what is true then";
  EXPECT_EQ(device->advance(1s), Frames{});
  device->objects.statusword = 3;
  EXPECT_EQ(device->image_updated(), (Frames{"181 # 03 00"}));
}

TEST(Tpdo, InhibitTimeInMilliseconds) {
  // Kinco manual, Table 9-14, ch. 9.3.3.3
  auto device = make_device<>({.valid_pdo_parameters_may_change = true, .inhibit_time_unit = 1ms});
  device->start();
  device->map(0x1800, {0x60410010});
  ASSERT_EQ(device->write(0x1800, 3, 50, 2), AbortCode::none);
  device->send("000 # 01 01");
  device->objects.statusword = 1;
  device->image_updated();
  EXPECT_EQ(device->advance(49ms), Frames{});
  EXPECT_EQ(device->advance(1ms), (Frames{"181 # 01 00"}));
}

TEST(Tpdo, EventTimer) {
  auto device = make_device();
  device->start();
  device->map(0x1800, {0x60410010});
  ASSERT_EQ(device->write(0x1800, 5, 10, 2), AbortCode::none);
  EXPECT_EQ(device->send("000 # 01 01"), (Frames{"181 # 00 00"}));
  EXPECT_EQ(device->advance(35ms).size(), 3U);
  device->objects.statusword = 1;
  EXPECT_EQ(device->image_updated(), (Frames{"181 # 01 00"}));
  EXPECT_EQ(device->advance(10ms - 1ns), Frames{}) << "the timer starts anew with each PDO";
  EXPECT_EQ(device->advance(1ns), (Frames{"181 # 01 00"}));
  device->send("000 # 80 01");
  EXPECT_EQ(device->advance(1s), Frames{});
}

TEST(Tpdo, TimerOnlyTypesIgnoreChanges) {
  auto device = make_device<>({.type_255_sends_on_change = false});
  device->start();
  device->map(0x1800, {0x60410010}, 255);
  device->map(0x1801, {0x60410010}, 254);
  ASSERT_EQ(device->write(0x1800, 5, 10, 2), AbortCode::none);
  EXPECT_EQ(device->send("000 # 01 01"), (Frames{"281 # 00 00"}));
  device->objects.statusword = 1;
  EXPECT_EQ(device->image_updated(), (Frames{"281 # 01 00"}));
  EXPECT_EQ(device->advance(20ms), (Frames{"181 # 01 00", "181 # 01 00"}));
  ASSERT_NO_FATAL_FAILURE(device->map(0x1800, {0x60410010}, 255));
  EXPECT_EQ(device->others, Frames{}) << "becoming valid is no event for it";
}

TEST(Tpdo, ChangeMask) {
  // ESTUN manual, ch. 3.3: a change of a masked bit does not trigger the PDO.
  auto device = make_device();
  device->start();
  device->map(0x1800, {0x60410010, 0x60640020}, 254);
  device->node.set_tpdo_change_mask(0, ~std::uint64_t{0x00FF0001});
  device->send("000 # 01 01");
  device->objects.statusword = 1;
  device->objects.position_actual = 0xFF;
  EXPECT_EQ(device->image_updated(), Frames{});
  device->objects.position_actual = 0x1FF;
  EXPECT_EQ(device->image_updated(), (Frames{"181 # 01 00 FF 01 00 00"}));
  device->send("000 # 82 01");
  device->send("000 # 01 01");
  device->objects.statusword = 0;
  EXPECT_EQ(device->image_updated(), Frames{}) << "the mask survives a reset";
}

TEST(Tpdo, SyncStartValue) {
  auto device = make_device();
  ASSERT_EQ(device->objects.communication.synchronous_counter_overflow, 0);
  device->objects.communication.synchronous_counter_overflow = 10;
  device->start();
  device->map(0x1800, {0x60410010}, 3);
  ASSERT_EQ(device->write(0x1800, 1, 0x80000181, 4), AbortCode::none);
  ASSERT_EQ(device->write(0x1800, 6, 241, 1), AbortCode::value_invalid);
  ASSERT_EQ(device->write(0x1800, 6, 4, 1), AbortCode::none);
  ASSERT_EQ(device->write(0x1800, 1, 0x00000181, 4), AbortCode::none);
  device->send("000 # 01 01");
  std::string sent_with;
  for (int i = 0; i < 12; ++i) {
    Frame sync = frame_of("080 # 00");
    sync.data[0] = static_cast<std::uint8_t>(i % 10 + 1);
    if (!device->send(sync).empty()) sent_with += std::to_string(sync.data[0]) + " ";
  }
  EXPECT_EQ(sent_with, "4 7 10 ");
}

TEST(Tpdo, BecomesValidWhileOperational) {
  auto device = make_device();
  device->start_operational();
  ASSERT_NO_FATAL_FAILURE(device->map(0x1800, {0x60410010}));
  EXPECT_EQ(device->others, (Frames{"181 # 00 00"}));
  // ISMC manual, ch. 2.6.2, 'PDO CAN identifier': bit 31 set switches the PDO off.
  EXPECT_EQ(device->write(0x1800, 1, 0x80000181, 4), AbortCode::none);
  device->objects.statusword = 1;
  EXPECT_EQ(device->image_updated(), Frames{});
}

TEST(Tpdo, ReadsComputedObjectsFresh) {
  struct Owner final : dictionary::Listener {
    explicit Owner(std::uint16_t& the_value) : value(the_value) {}
    void refresh(const dictionary::Entry&) override { ++value; }
    std::uint16_t& value;
  };
  auto device = make_device();
  Owner owner(device->objects.owned);
  device->dictionary.set_listener(dictionary::Owner::drive, &owner);
  device->start();
  device->map(0x1800, {0x20070010, 0x20080020}, 1);
  device->send("000 # 01 01");
  EXPECT_EQ(device->send("080 #"), (Frames{"181 # 01 00 78 56 34 12"}));
  EXPECT_EQ(device->send("080 #"), (Frames{"181 # 02 00 78 56 34 12"}));
}

// ---- many PDOs ----

TEST(Pdo, FiveHundredAndTwelvePerDirection) {
  auto device = make_device<512>();
  device->start();
  for (unsigned i = 0; i < 512; ++i) {
    const std::uint32_t rpdo_id = 0x200 + i % 0x180;
    const std::uint32_t tpdo_id = 0x400 + i % 0x180;
    const auto rpdo = static_cast<std::uint16_t>(0x1400 + i);
    const auto tpdo = static_cast<std::uint16_t>(0x1800 + i);
    ASSERT_EQ(device->write(rpdo, 1, 0x80000000, 4), AbortCode::none);
    ASSERT_EQ(device->write(rpdo, 1, rpdo_id, 4), AbortCode::none);
    ASSERT_EQ(device->write(tpdo, 1, 0x80000000, 4), AbortCode::none);
    ASSERT_EQ(device->write(tpdo, 1, tpdo_id, 4), AbortCode::none);
    ASSERT_NO_FATAL_FAILURE(device->map(rpdo, {0x60400010, 0x60FF0020}, synchronous));
    ASSERT_NO_FATAL_FAILURE(device->map(tpdo, {0x60400010, 0x60FF0020}, synchronous));
  }
  device->send("000 # 01 01");
  for (unsigned i = 0; i < 0x180; ++i) {
    Frame frame = frame_of("200 # 00 00 00 00 00 00");
    frame.id += i;
    frame.data[0] = static_cast<std::uint8_t>(i);
    device->send(frame);
  }
  device->events.log.clear();
  EXPECT_EQ(device->send("080 #").size(), 512U);
  EXPECT_EQ(device->events.log.size(), 512U + 1U);
  EXPECT_EQ(device->objects.controlword, 0x7F);
  EXPECT_EQ(device->write(0x15FF, 2, event_driven, 1), AbortCode::none);
}

}  // namespace
}  // namespace canopen_pdo_test
}  // namespace servodrome::canopen::test
