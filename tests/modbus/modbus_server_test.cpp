// Requests and responses of the standard (Modbus Application Protocol V1.1b3), on a device with objects of all kinds.
#include "modbus/ismk_modbus.hpp"
#include "modbus/test_device.hpp"

namespace servodrome::modbus::test {
namespace modbus_server_test {
namespace {

static_assert(!is_valid_map(std::to_array<Register>({{0, 0x2003, 0, 3}}), test_table), "too narrow");
static_assert(!is_valid_map(std::to_array<Register>({{0, 0x2002, 0, 2}, {1, 0x2000, 0, 1}}), test_table), "overlap");
static_assert(!is_valid_map(std::to_array<Register>({{1, 0x2000, 0, 1}, {0, 0x2001, 0, 1}}), test_table), "not sorted");
static_assert(!is_valid_map(std::to_array<Register>({{0, 0x3000, 0, 1}}), test_table), "no such object");
static_assert(!is_valid_map(std::to_array<Register>({{0xFFFF, 0x2002, 0, 2}}), test_table), "behind the last register");

constexpr auto identification = std::to_array<Identification>(
    {{0x00, "Servodrome"}, {0x01, "REF402"}, {0x02, "1.0"}, {0x04, "Reference drive"}, {0x80, "extended"}});
constexpr Profile standard{.identification = identification};

struct Owner final : dictionary::Listener {
  explicit Owner(const TestObjects& its_objects) : objects(its_objects) {}
  dictionary::AbortCode check(const dictionary::Entry&, std::span<const std::byte>) override { return answer; }
  void written(const dictionary::Entry&) override {
    ++notices;
    secret_when_told = objects.secret;
  }

  const TestObjects& objects;
  dictionary::AbortCode answer = dictionary::AbortCode::none;
  unsigned notices = 0;
  std::uint16_t secret_when_told = 0;
};

struct ServerTest : testing::Test {
  ServerTest() { device.dictionary.set_listener(dictionary::Owner::drive, &owner); }

  std::string ask(std::span<const std::uint8_t> request) {
    std::array<std::uint8_t, longest_pdu> response{};
    return hex_of(std::span(response).first(server.answer(request, response)));
  }
  std::string ask(const std::string& request) { return ask(bytes_of(request)); }

  TestDevice device;
  TestObjects& objects = device.objects;
  Owner owner{objects};
  Profile profile = standard;
  Server server{device.dictionary, test_map, profile};
};

TEST_F(ServerTest, ReadsRegisters) {
  objects.position = -2;
  EXPECT_EQ(ask("03 00 00 00 01"), "03 02 12 34");
  EXPECT_EQ(ask("04 00 00 00 01"), "04 02 12 34");
  EXPECT_EQ(ask("03 00 01 00 01"), "03 02 FF FD");
  EXPECT_EQ(ask("03 00 00 00 08"), "03 10 12 34 FF FD FF FF FF FE 11 22 33 44 55 66 77 88");
  EXPECT_EQ(ask("03 00 05 00 02"), "03 04 33 44 55 66");  // the middle of an object
  EXPECT_EQ(ask("03 00 0F 00 02"), "03 04 61 62 63 00");
  EXPECT_EQ(ask("03 FF FF 00 01"), "03 02 12 34");
  EXPECT_EQ(ask("03 FF FF 00 02"), "83 02");
  profile.registers_per_object_at_least = 2;
  EXPECT_EQ(ask("03 FF FF 00 02"), "83 02") << "nothing lies behind the last register";
}

// If each object has at least two registers, a small object has two if the address of the next object leaves room, and
// one if not.
TEST_F(ServerTest, ObjectsEndWhereTheNextBegins) {
  constexpr auto spread =
      std::to_array<Register>({{0, 0x2000, 0, 1}, {1, 0x2001, 0, 1}, {4, 0x2000, 0, 1}, {7, 0x2001, 0, 1}});
  profile.registers_per_object_at_least = 2;
  const Server wide{device.dictionary, spread, profile};
  const auto answer = [&](const std::string& request) {
    std::array<std::uint8_t, longest_pdu> response{};
    const auto bytes = bytes_of(request);
    return hex_of(std::span(response).first(const_cast<Server&>(wide).answer(bytes, response)));
  };
  EXPECT_EQ(answer("03 00 00 00 02"), "03 04 12 34 FF FD") << "1 is the next object";
  EXPECT_EQ(answer("03 00 04 00 02").substr(0, 5), "03 04") << "5 is the rest of 4";
  EXPECT_EQ(answer("03 00 05 00 01").substr(0, 5), "03 02");
  EXPECT_EQ(answer("03 00 06 00 01"), "83 02") << "6 is nothing";
  EXPECT_EQ(answer("03 00 03 00 01"), "83 02");
  EXPECT_EQ(answer("03 00 08 00 01").substr(0, 5), "03 02");
  EXPECT_EQ(answer("03 00 09 00 01"), "83 02");
}

TEST_F(ServerTest, WritesRegisters) {
  EXPECT_EQ(ask("06 00 00 BE EF"), "06 00 00 BE EF");
  EXPECT_EQ(objects.plain, 0xBEEF);
  EXPECT_EQ(ask("10 00 02 00 06 0C 00 01 00 02 00 00 00 00 00 00 00 09"), "10 00 02 00 06");
  EXPECT_EQ(objects.position, 0x10002);
  EXPECT_EQ(objects.wide, 9U);
  EXPECT_EQ(ask("06 00 01 FF 80"), "06 00 01 FF 80");
  EXPECT_EQ(objects.small, -128);
  EXPECT_EQ(ask("06 00 01 00 80"), "86 03") << "128 is no INTEGER8";
  EXPECT_EQ(ask("06 00 01 FF 7F"), "86 03") << "-129 is no INTEGER8";
  EXPECT_EQ(ask("06 00 02 00 01"), "86 03") << "half of an object";
  EXPECT_EQ(ask("10 00 03 00 01 02 00 01"), "90 03") << "the other half";
  EXPECT_EQ(ask("10 00 0C 00 03 06 78 79 7A 00 00 00"), "10 00 0C 00 03");
  EXPECT_EQ(std::string(objects.name.bytes.data(), objects.name.length), "xyz");
  EXPECT_EQ(ask("03 00 0C 00 03"), "03 06 78 79 7A 00 00 00");
}

// Nothing is written unless all values can be written.
TEST_F(ServerTest, SeveralObjectsAtOnce) {
  EXPECT_EQ(ask("10 00 00 00 03 06 00 01 00 02 00 03"), "90 03");              // ends within 2002h
  EXPECT_EQ(ask("10 00 08 00 05 0A 00 01 00 02 00 03 00 04 00 05"), "90 02");  // 11 is read only
  EXPECT_EQ(ask("10 00 07 00 02 04 00 00 00 01"), "90 03");
  EXPECT_EQ(ask("10 00 04 00 05 0A 00 00 00 00 00 00 00 09 00 65"), "90 03");  // 101 is out of range
  EXPECT_EQ(objects.plain, 0x1234);
  EXPECT_EQ(objects.wide, 0x1122334455667788U);
  EXPECT_EQ(objects.ranged, 0);
  owner.answer = dictionary::AbortCode::device_state;
  EXPECT_EQ(ask("10 00 08 00 03 06 00 05 00 06 00 07"), "90 04");
  EXPECT_EQ(objects.ranged, 0);
  EXPECT_EQ(objects.owned, 0);
  EXPECT_EQ(objects.secret, 0);
  EXPECT_EQ(ask("10 00 09 00 01 02 00 06"), "90 04");
  EXPECT_EQ(owner.notices, 0U);
}

// The owner of an object acts when all values of the request are stored, also those after its own.
TEST_F(ServerTest, OwnersActWithTheWholeRequest) {
  EXPECT_EQ(ask("10 00 08 00 03 06 00 05 00 06 00 07"), "10 00 08 00 03");
  EXPECT_EQ(owner.notices, 1U);
  EXPECT_EQ(owner.secret_when_told, 7);
  EXPECT_EQ(objects.owned, 6);
  EXPECT_EQ(ask("17 00 00 00 01 00 09 00 02 04 00 08 00 09"), "17 02 12 34");
  EXPECT_EQ(owner.notices, 2U);
  EXPECT_EQ(owner.secret_when_told, 9);
}

// A string is written with the other objects of its request, or with none of them.
TEST_F(ServerTest, StringsAmongNumbers) {
  constexpr auto map = std::to_array<Register>({{0, 0x2008, 0, 3}, {3, 0x2000, 0, 1}, {4, 0x2004, 0, 1}});
  Server mixed{device.dictionary, map, profile};
  const auto answer = [&](const std::string& request) {
    std::array<std::uint8_t, longest_pdu> response{};
    const auto bytes = bytes_of(request);
    return hex_of(std::span(response).first(mixed.answer(bytes, response)));
  };
  EXPECT_EQ(answer("10 00 00 00 05 0A 78 79 7A 00 00 00 00 01 00 65"), "90 03") << "101 is out of range";
  EXPECT_EQ(objects.name.length, 0U);
  EXPECT_EQ(objects.plain, 0x1234);
  EXPECT_EQ(answer("10 00 00 00 05 0A 78 79 7A 00 00 00 00 01 00 64"), "10 00 00 00 05");
  EXPECT_EQ(std::string(objects.name.bytes.data(), objects.name.length), "xyz");
  EXPECT_EQ(objects.plain, 1);
  EXPECT_EQ(objects.ranged, 100);
}

TEST_F(ServerTest, WritesThenReads) {
  EXPECT_EQ(ask("17 00 00 00 02 00 00 00 01 02 AB CD"), "17 04 AB CD FF FD");
  EXPECT_EQ(ask("17 00 20 00 01 00 00 00 01 02 11 11"), "97 02") << "what cannot be read is not written";
  EXPECT_EQ(objects.plain, 0xABCD);
  EXPECT_EQ(ask("17 00 00 00 01 00 0B 00 01 02 11 11"), "97 02");
}

// Every exception and its cause.
TEST_F(ServerTest, Exceptions) {
  for (unsigned function = 0; function < 256; ++function) {
    if (standard.functions.contains(static_cast<std::uint8_t>(function))) continue;
    const std::vector<std::uint8_t> request = {static_cast<std::uint8_t>(function), 0, 0, 0, 1};
    EXPECT_EQ(ask(request), hex_of(std::vector<std::uint8_t>{static_cast<std::uint8_t>(function | 0x80), 1}));
  }
  EXPECT_EQ(ask("03 00 11 00 01"), "83 02") << "no such register";
  EXPECT_EQ(ask("03 00 10 00 02"), "83 02") << "the second does not exist";
  EXPECT_EQ(ask("03 00 0A 00 01"), "83 02") << "write only";
  EXPECT_EQ(ask("06 00 0B 00 01"), "86 02") << "read only";
  EXPECT_EQ(ask("06 00 0F 00 01"), "86 02") << "constant";
  EXPECT_EQ(ask("06 00 08 00 65"), "86 03") << "101 is above 100";
  EXPECT_EQ(ask("06 00 08 FF 9B"), "86 03") << "-101 is below -100";
  EXPECT_EQ(ask("06 00 08 FF 9C"), "06 00 08 FF 9C");
  owner.answer = dictionary::AbortCode::value_too_high;
  EXPECT_EQ(ask("06 00 09 00 01"), "86 03");
  owner.answer = dictionary::AbortCode::general_error;
  EXPECT_EQ(ask("06 00 09 00 01"), "86 04") << "anything else";
  EXPECT_EQ(ask("03 00 00 00 00"), "83 03");
  EXPECT_EQ(ask("03 00 00 00 7E"), "83 03") << "126 registers";
  EXPECT_EQ(ask("03 00 00 00 7D"), "83 02") << "125 are a lawful number";
  EXPECT_EQ(ask("10 00 00 00 00 00"), "90 03");
  EXPECT_EQ(ask("10 00 00 00 01 04 00 00"), "90 03") << "byte count";
  EXPECT_EQ(ask("10 00 00 00 7C F8"), "90 03") << "124 registers";
  EXPECT_EQ(ask("17 00 00 00 7E 00 00 00 01 02 00 00"), "97 03");
  EXPECT_EQ(ask("17 00 00 00 01 00 00 00 7A F4"), "97 03") << "122 registers";
}

// The maximum number of registers in one request (6.3, 6.12, 6.17), on an object with that many registers, and one
// more.
TEST(ModbusServer, MostRegistersOfOneRequest) {
  struct Objects {
    dictionary::Blob<252> name;
  } objects;
  static constexpr auto table = std::to_array<dictionary::Entry>(
      {dictionary::var(0x2000, "", SERVODROME_FIELD(Objects, name), dictionary::Access::rw)});
  dictionary::Dictionary dictionary(table, std::as_writable_bytes(std::span(&objects, 1)));
  // The same object at four addresses, with the maximum number of registers per request, and with more.
  constexpr auto map = std::to_array<Register>(
      {{0, 0x2000, 0, 121}, {0x1000, 0x2000, 0, 123}, {0x2000, 0x2000, 0, 125}, {0x3000, 0x2000, 0, 126}});
  Server server{dictionary, map, standard};
  const auto ask = [&server](std::vector<std::uint8_t> request, unsigned registers) {
    request.resize(request.size() + 2 * registers, 'x');
    std::array<std::uint8_t, longest_pdu> response{};
    return std::vector<std::uint8_t>(response.begin(),
                                     response.begin() + static_cast<std::ptrdiff_t>(server.answer(request, response)));
  };
  using Bytes = std::vector<std::uint8_t>;
  EXPECT_EQ(ask({0x10, 0x10, 0, 0, 123, 246}, 123), (Bytes{0x10, 0x10, 0, 0, 123}));
  EXPECT_EQ(objects.name.length, 246U);
  EXPECT_EQ(ask({0x10, 0x20, 0, 0, 124, 248}, 124), (Bytes{0x90, 3}));
  Bytes response = ask({0x03, 0x20, 0, 0, 125}, 0);
  EXPECT_EQ(response.size(), 252U);
  EXPECT_EQ(response[1], 250);
  EXPECT_EQ(response[247], 'x') << "the last that was written";
  EXPECT_EQ(response[248], 0);
  EXPECT_EQ(ask({0x03, 0x30, 0, 0, 126}, 0), (Bytes{0x83, 3}));
  response = ask({0x17, 0x20, 0, 0, 125, 0, 0, 0, 121, 242}, 121);
  EXPECT_EQ(response.size(), 252U);
  EXPECT_EQ(objects.name.length, 242U);
  EXPECT_EQ(ask({0x17, 0x20, 0, 0, 125, 0x10, 0, 0, 122, 244}, 122), (Bytes{0x97, 3}));
  EXPECT_EQ(ask({0x17, 0x30, 0, 0, 126, 0, 0, 0, 121, 242}, 121), (Bytes{0x97, 3}));
  EXPECT_EQ(ask({0x17, 0x20, 0, 0, 0, 0, 0, 0, 121, 242}, 121), (Bytes{0x97, 3}));
  EXPECT_EQ(ask({0x17, 0x20, 0, 0, 1, 0, 0, 0, 0, 0}, 0), (Bytes{0x97, 3}));
}

TEST_F(ServerTest, WrongLengths) {
  const char* requests[] = {"03 00 00 00 01", "04 00 00 00 01", "06 00 00 00 01", "10 00 00 00 01 02 00 01",
                            "17 00 00 00 01 00 00 00 01 02 00 01"};
  for (const char* text : requests) {
    const std::vector<std::uint8_t> whole = bytes_of(text);
    const std::string refused = hex_of(std::vector<std::uint8_t>{static_cast<std::uint8_t>(whole[0] | 0x80), 3});
    for (std::size_t size = 1; size < whole.size(); ++size) {
      EXPECT_EQ(ask(std::span(whole).first(size)), refused) << text << " cut to " << size;
    }
    std::vector<std::uint8_t> longer = whole;
    longer.push_back(0);
    EXPECT_EQ(ask(longer), refused) << text;
    EXPECT_NE(ask(whole), refused) << text;
  }
  EXPECT_EQ(ask(std::span<const std::uint8_t>()), "");
}

TEST_F(ServerTest, DeviceIdentification) {
  const std::string vendor = "00 0A 53 65 72 76 6F 64 72 6F 6D 65";
  const std::string code = "01 06 52 45 46 34 30 32";
  const std::string revision = "02 03 31 2E 30";
  const std::string name = "04 0F 52 65 66 65 72 65 6E 63 65 20 64 72 69 76 65";
  const std::string more = "80 08 65 78 74 65 6E 64 65 64";
  EXPECT_EQ(ask("2B 0E 01 00"), "2B 0E 01 83 00 00 03 " + vendor + " " + code + " " + revision);
  EXPECT_EQ(ask("2B 0E 02 00"), "2B 0E 02 83 00 00 04 " + vendor + " " + code + " " + revision + " " + name);
  EXPECT_EQ(ask("2B 0E 03 04"), "2B 0E 03 83 00 00 02 " + name + " " + more);
  EXPECT_EQ(ask("2B 0E 01 01"), "2B 0E 01 83 00 00 02 " + code + " " + revision);
  EXPECT_EQ(ask("2B 0E 01 04"), ask("2B 0E 01 00")) << "not of the category: from the beginning";
  EXPECT_EQ(ask("2B 0E 02 03"), ask("2B 0E 02 00")) << "not there: from the beginning";
  EXPECT_EQ(ask("2B 0E 04 01"), "2B 0E 04 83 00 00 01 " + code);
  EXPECT_EQ(ask("2B 0E 04 03"), "AB 02");
  EXPECT_EQ(ask("2B 0E 00 00"), "AB 03");
  EXPECT_EQ(ask("2B 0E 05 00"), "AB 03");
  EXPECT_EQ(ask("2B 0E 01"), "AB 03");
  EXPECT_EQ(ask("2B 0D 01 00"), "AB 01");
  EXPECT_EQ(ask("2B"), "AB 01");
  profile.identification = {};
  EXPECT_EQ(ask("2B 0E 01 00"), "AB 01");
}

// Objects that do not fit into one response: "more follows" and the next object id.
TEST_F(ServerTest, DeviceIdentificationInSeveralResponses) {
  const std::string long_text(200, 'x');
  const std::string too_long(300, 'y');
  const Identification objects_list[] = {{0, long_text.c_str()}, {1, long_text.c_str()}, {2, too_long.c_str()}};
  profile.identification = objects_list;
  std::vector<std::uint8_t> first = bytes_of(ask("2B 0E 01 00"));
  EXPECT_EQ(first.size(), 7U + 202U);
  EXPECT_EQ(hex_of(std::span(first).first(9)), "2B 0E 01 81 FF 01 01 00 C8");
  std::vector<std::uint8_t> second = bytes_of(ask("2B 0E 01 01"));
  EXPECT_EQ(hex_of(std::span(second).first(9)), "2B 0E 01 81 FF 02 01 01 C8");
  std::vector<std::uint8_t> third = bytes_of(ask("2B 0E 01 02"));
  EXPECT_EQ(third.size(), longest_pdu) << "cut to what fits";
  EXPECT_EQ(hex_of(std::span(third).first(9)), "2B 0E 01 81 00 00 01 02 F4");
  // To the last byte: 7 + 2 + 100 + 2 + 142 are 253.
  for (const std::size_t size : {142U, 143U}) {
    const std::string hundred(100, 'x');
    const std::string rest(size, 'y');
    const Identification two[] = {{0, hundred.c_str()}, {1, rest.c_str()}};
    profile.identification = two;
    EXPECT_EQ(bytes_of(ask("2B 0E 01 00")).size(), size == 142 ? longest_pdu : 109U);
  }
}

// Clause 7 of the standard.
TEST(ModbusException, HasWords) {
  struct Row {
    std::uint8_t code;
    const char* words;
  };
  for (const auto& [code, words] : std::to_array<Row>({{0x00, "no exception"},
                                                       {0x01, "illegal function"},
                                                       {0x02, "illegal data address"},
                                                       {0x03, "illegal data value"},
                                                       {0x04, "server device failure"},
                                                       {0x05, "acknowledge"},
                                                       {0x06, "server device busy"},
                                                       {0x07, "unknown exception"},
                                                       {0x08, "memory parity error"},
                                                       {0x09, "unknown exception"},
                                                       {0x0A, "gateway path unavailable"},
                                                       {0x0B, "gateway target device failed to respond"},
                                                       {0x63, "unknown exception"}})) {
    EXPECT_STREQ(text(Exception{code}), words) << +code;
  }
}

}  // namespace
}  // namespace modbus_server_test
}  // namespace servodrome::modbus::test
