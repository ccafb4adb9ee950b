#include "sdo_client.hpp"

namespace servodrome::canopen::test {
namespace canopen_sdo_round_trip_test {
namespace {

constexpr std::uint16_t big = 0x2002;

Bytes random_bytes(std::minstd_rand& random, std::size_t size) {
  Bytes bytes(size);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() >> 8);
  return bytes;
}

std::size_t random_size(std::minstd_rand& random) {
  switch (random() % 3) {
    case 0: return random() % 30;
    case 1: return 880 + random() % 20;  // around one full sub-block of 889 bytes
    default: return random() % 6001;
  }
}

TEST(Crc16, CheckValue) {
  const char digits[] = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
  EXPECT_EQ(crc16(std::as_bytes(std::span(digits))), 0x31C3);
}

TEST(SdoRoundTrip, Segmented) {
  auto device = make_device();
  device->start();
  SdoClient client(*device);
  std::minstd_rand random(2);
  for (int i = 0; i < 300; ++i) {
    const Bytes bytes = random_bytes(random, random_size(random));
    ASSERT_EQ(client.download_segmented(big, bytes, random() % 2 == 0), AbortCode::none) << bytes.size();
    ASSERT_EQ(client.upload_segmented(big), bytes);
  }
}

TEST(SdoRoundTrip, Blocks) {
  auto device = make_device();
  device->start();
  SdoClient client(*device);
  std::minstd_rand random(3);
  for (int i = 0; i < 300; ++i) {
    const Bytes bytes = random_bytes(random, random_size(random));
    client.block_size = static_cast<std::uint8_t>(1 + random() % 127);
    ASSERT_EQ(client.download_block(big, bytes, random() % 2 == 0), AbortCode::none) << bytes.size();
    ASSERT_EQ(client.upload_block(big), bytes);
  }
  EXPECT_EQ(client.repeated_blocks, 0U);
}

TEST(SdoRoundTrip, BlocksWithLostSegments) {
  auto device = make_device();
  device->start();
  std::minstd_rand random(4);
  unsigned repeated = 0;
  for (std::uint32_t seed = 1; seed <= 300; ++seed) {
    SdoClient client(*device, seed);
    client.loss = 0.02 * static_cast<double>(seed % 10 + 1);
    const Bytes bytes = random_bytes(random, random_size(random));
    ASSERT_EQ(client.download_block(big, bytes, seed % 2 == 0), AbortCode::none) << bytes.size() << " seed " << seed;
    ASSERT_EQ(client.upload_block(big), bytes) << " seed " << seed;
    repeated += client.repeated_blocks;
  }
  EXPECT_GT(repeated, 300U) << "segments were lost and asked for again";
}

TEST(SdoRoundTrip, EveryLength) {
  auto device = make_device();
  device->start();
  SdoClient client(*device);
  std::minstd_rand random(5);
  for (std::size_t size = 0; size <= 900; ++size) {
    const Bytes bytes = random_bytes(random, size);
    ASSERT_EQ(client.download_block(big, bytes, true), AbortCode::none) << size;
    ASSERT_EQ(client.upload_segmented(big), bytes);
    ASSERT_EQ(client.upload_block(big), bytes);
  }
}

TEST(SdoRoundTrip, SpoiledDataChangesNothing) {
  auto device = make_device();
  device->start();
  SdoClient client(*device);
  std::minstd_rand random(6);
  const Bytes good = random_bytes(random, 100);
  ASSERT_EQ(client.download_block(big, good, true), AbortCode::none);
  EXPECT_EQ(client.download_block(big, random_bytes(random, 100), true, true), AbortCode::crc_error);
  EXPECT_EQ(client.upload_segmented(big), good);
  EXPECT_EQ(client.download_block(0x2001, random_bytes(random, 41), false), AbortCode::length_too_high);
}

TEST(SdoRoundTrip, SmallBufferTakesExactlyItsSize) {
  auto device = make_device<4, 8, 64>();
  device->start();
  SdoClient client(*device);
  std::minstd_rand random(7);
  for (std::size_t size = 50; size <= 80; ++size) {
    const Bytes bytes = random_bytes(random, size);
    const AbortCode expected = size <= 64 ? AbortCode::none : AbortCode::out_of_memory;
    EXPECT_EQ(client.download_block(big, bytes, false), expected) << size;
    EXPECT_EQ(client.download_block(big, bytes, true), expected) << size;
    EXPECT_EQ(client.download_segmented(big, bytes, false), expected) << size;
  }
}

}  // namespace
}  // namespace canopen_sdo_round_trip_test
}  // namespace servodrome::canopen::test
