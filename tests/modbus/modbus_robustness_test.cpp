// Random bytes, and random requests with valid framing: the server must not fail, and must answer afterwards.
#include <random>

#include "modbus/ismk_modbus.hpp"
#include "modbus/tcp_connection.hpp"

namespace servodrome::modbus::test {
namespace modbus_robustness_test {
namespace {

using Device = servodrome::test::IsmkDevice;

struct Random {
  std::minstd_rand source{1};
  unsigned below(unsigned limit) { return static_cast<unsigned>(source() >> 4) % limit; }
  std::uint8_t byte() { return static_cast<std::uint8_t>(below(256)); }
};

// A million streams: noise, complete frames with valid or random content, garbled characters, pauses of any length.
TEST(ModbusRobustness, RandomStreams) {
  Random random;
  Profile standard;
  standard.registers_per_object_at_least = 2;
  Station<Device> station(standard, ismk_map);
  static constexpr std::array<std::uint8_t, 8> functions = {0x03, 0x04, 0x06, 0x10, 0x17, 0x2B, 0x90, 0x01};
  unsigned answers = 0;
  for (unsigned stream = 0; stream < 1'000'000; ++stream) {
    std::array<std::uint8_t, 40> bytes{};
    std::size_t size = 1 + random.below(30);
    for (std::uint8_t& byte : bytes) byte = random.byte();
    if (random.below(2) == 0) {
      const Register& row = ismk_map[random.below(ismk_map.size())];
      bytes[0] = static_cast<std::uint8_t>(random.below(2));
      bytes[1] = functions[random.below(functions.size())];
      write_u16(&bytes[2], static_cast<std::uint16_t>(row.address + random.below(3)));
      write_u16(&bytes[4], static_cast<std::uint16_t>(random.below(5)));
      bytes[6] = static_cast<std::uint8_t>(2 * bytes[5]);
      if (random.below(4) != 0) size = bytes[1] == 0x10 ? 7U + bytes[6] : 6U;
      size = seal_rtu_frame(bytes, size);
    }
    for (std::size_t i = 0; i < size; ++i) {
      if (random.below(300) == 0) station.now += Time(random.below(1'000'000));
      station.now += station.timing.character;
      if (random.below(1000) == 0) {
        station.rtu.receive_garbled(station.now);
      } else {
        station.rtu.receive(bytes[i], station.now);
      }
    }
    if (random.below(8) != 0) {
      station.now += Time(random.below(2'000'000));
      station.rtu.poll(station.now);
    }
    const auto answer = station.rtu.take();
    if (!answer.empty()) {
      ++answers;
      ASSERT_TRUE(is_rtu_frame(answer));
      ASSERT_EQ(answer[0], 1);
    }
  }
  EXPECT_GT(answers, 50'000U) << "the streams are not that random";
  station.now += 1s;
  station.rtu.poll(station.now);
  station.rtu.take();
  station.device.objects.statusword = 0x1234;
  EXPECT_EQ(station.ask_sealed("01 03 32 00 00 01"), "01 03 02 12 34");
}

class HalfOfTheUnits final : public Units {
 public:
  explicit HalfOfTheUnits(Server& server) : server_(server) {}
  Server* find(std::uint8_t unit) override { return unit < 128 ? &server_ : nullptr; }

 private:
  Server& server_;
};

TEST(ModbusRobustness, RandomTcpStreams) {
  Random random;
  Device device;
  Profile standard;
  Server server(device.dictionary, ismk_map, standard);
  HalfOfTheUnits units(server);
  unsigned answers = 0;
  for (unsigned stream = 0; stream < 200'000; ++stream) {
    TcpConnection connection(units);
    std::array<std::uint8_t, 300> bytes{};
    const std::size_t size = random.below(bytes.size());
    for (std::uint8_t& byte : bytes) byte = random.byte();
    if (random.below(8) != 0) {
      const std::size_t length = 2 + random.below(20);
      Mbap{random.byte(), 0, static_cast<std::uint16_t>(length), random.byte()}.write(bytes.data());
      Mbap{random.byte(), 0, 6, random.byte()}.write(&bytes[6 + length]);
    }
    auto rest = std::span<const std::uint8_t>(bytes).first(size);
    while (!rest.empty()) {
      const std::size_t taken =
          connection.receive(rest.first(std::min<std::size_t>(rest.size(), 1 + random.below(64))));
      ASSERT_GT(taken, 0U);
      rest = rest.subspan(taken);
      const auto answer = connection.take();
      if (answer.empty()) continue;
      ++answers;
      const Mbap header = Mbap::read(answer.data());
      ASSERT_TRUE(header.is_valid());
      ASSERT_EQ(answer.size(), 6U + header.length);
    }
  }
  EXPECT_GT(answers, 100'000U);
}

}  // namespace
}  // namespace modbus_robustness_test
}  // namespace servodrome::modbus::test
