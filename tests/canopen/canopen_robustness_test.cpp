#include <random>

#include "test_device.hpp"

namespace servodrome::canopen::test {
namespace canopen_robustness_test {
namespace {

// Random frames; those that a node accepts are far more frequent than in uniformly random ones.
Frame random_frame(std::minstd_rand& random) {
  static constexpr std::array<std::uint32_t, 16> interesting = {0x000, 0x080, 0x081, 0x100, 0x201, 0x301, 0x401, 0x501,
                                                                0x601, 0x601, 0x601, 0x601, 0x701, 0x77F, 0x7E5, 0x181};
  const auto next = [&random](unsigned below) { return static_cast<unsigned>(random() >> 4) % below; };
  Frame frame;
  frame.id = next(8) == 0 ? next(0x900) : interesting[next(interesting.size())];
  frame.extended = next(200) == 0;
  frame.remote = next(50) == 0;
  frame.length = static_cast<std::uint8_t>(next(4) == 0 ? next(9) : 8);
  for (std::uint8_t& byte : frame.data) byte = static_cast<std::uint8_t>(next(256));
  if (frame.id == 0x601 && next(2) == 0) {  // an object that may exist
    static constexpr std::array<std::uint16_t, 12> objects = {0x1003, 0x1005, 0x1006, 0x1014, 0x1016, 0x1017,
                                                              0x1400, 0x1600, 0x1800, 0x1A00, 0x2002, 0x6040};
    static constexpr std::array<std::uint8_t, 10> commands = {0x23, 0x2B, 0x2F, 0x40, 0x21,
                                                              0xC4, 0xA4, 0xA3, 0x60, 0x00};
    const std::uint16_t index = objects[next(objects.size())];
    frame.data[0] = commands[next(commands.size())];
    frame.data[1] = static_cast<std::uint8_t>(index);
    frame.data[2] = static_cast<std::uint8_t>(index >> 8);
    frame.data[3] = static_cast<std::uint8_t>(next(9));
    if (next(2) == 0) frame.data[6] = frame.data[7] = 0;
  }
  if (frame.id == 0 && frame.length == 8 && next(2) == 0) {
    frame.length = 2;
    static constexpr std::array<std::uint8_t, 5> commands = {0x01, 0x02, 0x80, 0x81, 0x82};
    frame.data[0] = commands[next(commands.size())];
    frame.data[1] = static_cast<std::uint8_t>(next(2));
  }
  return frame;
}

// After any input, a node must answer its master.
template <typename Device>
void expect_alive(Device& device, const std::string& context) {
  device.now += 10s;  // transfers time out, the bit rate changes
  device.node.poll(device.now);
  const auto drain = [&device] {
    Frame frame;
    for (unsigned frames = 0; device.node.take(frame); ++frames) ASSERT_LT(frames, 10000U) << "frames without end";
  };
  drain();
  device.send("7E5 # 04 00 00 00 00 00 00 00");
  const std::uint8_t node_id = device.node.node_id();
  ASSERT_NE(node_id, 0);
  device.send("000 # 80 00");
  drain();
  Frame request = frame_of("600 # 40 08 20 00 00 00 00 00");
  request.id += device.node.node_id() == 1 ? 1U : 0U;
  if (device.node.node_id() != 1) return;  // LSS has given it another node-ID
  device.node.receive(request, device.now);
  bool answered = false;
  Frame frame;
  while (device.node.take(frame)) answered |= text_of(frame) == "581 # 43 08 20 00 78 56 34 12";
  ASSERT_TRUE(answered) << context;
}

TEST(Robustness, AMillionRandomFrames) {
  std::minstd_rand random(20240601);
  auto device = make_device();
  device->start();
  unsigned answered = 0;
  for (unsigned i = 0; i < 1'000'000; ++i) {
    const Frame frame = random_frame(random);
    device->now += std::chrono::nanoseconds(random() % 2'000'000);
    device->node.receive(frame, device->now);
    device->node.poll(device->now);
    if (i % 4 == 0) device->node.process_image_updated(device->now);
    if (i % 3 == 0) device->objects.statusword = static_cast<std::uint16_t>(random());
    Frame out;
    for (unsigned frames = 0; device->node.take(out); ++frames) {
      ASSERT_LE(out.length, 8);
      ASSERT_LT(out.id, 0x800U);
      ASSERT_LT(frames, 1000U) << "frames without end";
      ++answered;
    }
    ASSERT_GT(device->node.next_deadline(), device->now);
    ASSERT_LE(device->objects.name.length, 40U);
    ASSERT_LE(device->objects.big.length, 6000U);
    if (i % 5000 == 4999) {
      ASSERT_NO_FATAL_FAILURE(expect_alive(*device, "after frame " + std::to_string(i)));
      device = make_device();
      device->start();
    }
  }
  EXPECT_GT(answered, 100'000U) << "the frames meant something";
}

// The minimum of a CANopen device (CiA 301 table 41): no service may depend on an optional object.
TEST(Robustness, ADeviceWithFourObjects) {
  static constexpr auto table = dictionary::make_table<[] {
    using namespace dictionary;
    TableBuilder<10> t;
    t.add(number_constant(0x1000, 0, ObjectCode::var, "Device type", Type::unsigned32, 0x00020192));
    t.add(number_constant(0x1001, 0, ObjectCode::var, "Error register", Type::unsigned8, 0));
    t.add(highest_sub(0x1018, ObjectCode::record, "Identity object", 1));
    t.add(number_constant(0x1018, 1, ObjectCode::record, "Vendor-ID", Type::unsigned32, 0x319));
    return t;
  }>();
  std::array<std::byte, 1> nothing{};
  dictionary::Dictionary dictionary(table, nothing);
  const Profile profile;
  RecordingEvents events;
  NodeStorage<1, 1, 1, 1, 8> storage;
  Node node(dictionary, profile, events, storage.memory());
  node.start(9, 0s);
  std::minstd_rand random(7);
  Frame out;
  for (unsigned i = 0; i < 100'000; ++i) {
    Frame frame = random_frame(random);
    if (frame.id == 0x7E5 || frame.id == 0) frame.data[1] = 9;
    if (frame.id == 0x601) frame.id = 0x609;
    node.receive(frame, 0s);
    if (i % 100 == 0) node.raise(0x1000, 0, {});
    while (node.take(out)) {
    }
  }
  node.start(9, 1s);
  ASSERT_TRUE(node.take(out));
  EXPECT_EQ(text_of(out), "709 # 00");
  node.receive(frame_of("609 # 40 00 10 00 00 00 00 00"), 1s);
  ASSERT_TRUE(node.take(out));
  EXPECT_EQ(text_of(out), "589 # 43 00 10 00 92 01 02 00");
  node.receive(frame_of("709 RTR 1"), 1s);
  ASSERT_TRUE(node.take(out));
  EXPECT_EQ(text_of(out), "709 # 7F");
  EXPECT_EQ(node.next_deadline(), never);
}

TEST(Robustness, TwoRunsAgree) {
  Frames runs[2];
  for (Frames& run : runs) {
    std::minstd_rand random(99);
    auto device = make_device();
    device->start();
    for (unsigned i = 0; i < 20'000; ++i) {
      for (std::string& frame : device->send(random_frame(random))) run.push_back(std::move(frame));
      device->now += 100us;
    }
  }
  EXPECT_FALSE(runs[0].empty());
  EXPECT_EQ(runs[0], runs[1]);
}

}  // namespace
}  // namespace canopen_robustness_test
}  // namespace servodrome::canopen::test
