#pragma once

#include "master/ethercat/master.hpp"
#include "master/ethercat/sii_content.hpp"

namespace servodrome::master {

// Reads and writes the slave information interface (SII memory) of one slave through 0500h..050Fh (ETG.1000.4 clause
// 6.4). Addresses count words. Takes the interface away from the slave's application if that owns it. All calls throw
// EthercatError.
class SiiClient {
 public:
  SiiClient(EthercatMaster& master, std::uint16_t station) : master_(master), station_(station) {}

  std::vector<std::uint8_t> read(std::uint16_t word, std::size_t bytes);
  // Reads the fixed part and all categories including the end marker.
  std::vector<std::uint8_t> read_all();
  SiiContent content() { return parse_sii(read_all()); }

  // Writes an even number of bytes, word by word; each word takes some milliseconds.
  void write(std::uint16_t word, std::span<const std::uint8_t> bytes);
  // Writes the alias and the checksum of the configuration area. The slave applies them at its next power-on.
  void write_alias(std::uint16_t alias);

 private:
  struct Status {
    std::uint16_t bits = 0;
    std::array<std::uint8_t, 8> data{};
    std::size_t width = 4;  // bytes returned by one read access
  };

  void take_interface();
  Status wait_until_idle(std::uint16_t word);
  Status command(std::uint16_t control, std::uint16_t word, std::span<const std::uint8_t> data);
  [[noreturn]] void fail(std::uint16_t word, const std::string& happened, const std::string& remedy);

  EthercatMaster& master_;
  std::uint16_t station_;
  bool taken_ = false;
};

}  // namespace servodrome::master
