// Measures round trips of one EtherCAT frame over a link, one after the other: an LRW with the process data of all
// slaves, and a BRD of the AL status. Prints the round trips per second and their durations.
// Usage: ethercat_latency LINK SECONDS BYTES    an LRW of BYTES bytes, without a slave that maps them
//        ethercat_latency LINK SECONDS          brings all slaves to Operational and exchanges their process data
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "ethercat/esc/registers.hpp"
#include "ethercat/frame/frame_writer.hpp"
#include "links/ethercat/client.hpp"
#include "master/ethercat/operation.hpp"

namespace {

using namespace servodrome;
using namespace std::chrono_literals;
using links::Time;

// The process data of a line in operation: their logical address, the present outputs, and the working counter of all
// slaves.
struct ProcessImage {
  std::uint32_t logical = 0;
  std::vector<std::uint8_t> data;
  unsigned counter = 0;
  unsigned slaves = 0;
};

class Line {
 public:
  explicit Line(const char* link) : master_(master::EthercatMaster::open(link)), found_(master::scan_slaves(*master_)) {
    for (const master::FoundSlave& found : found_) {
      slaves_.push_back(std::make_unique<master::EthercatSlave>(*master_, found));
      slaves_.back()->to_pre_operational();
      members_.push_back(slaves_.back().get());
    }
    operation_.emplace(*master_, found_, members_);
    master_->wait(100ms);
  }

  // Reads the logical addresses from the FMMUs of the slaves.
  ProcessImage image() {
    constexpr unsigned channels = 2;  // outputs, inputs
    struct Mapping {
      std::size_t member;
      unsigned channel;
      std::uint32_t logical;
      std::uint16_t length;
    };
    std::vector<Mapping> mappings;
    ProcessImage image;
    image.slaves = static_cast<unsigned>(found_.size());
    std::uint32_t end = 0;
    image.logical = 0xFFFFFFFF;
    for (std::size_t i = 0; i < found_.size(); ++i) {
      for (unsigned channel = 0; channel < channels; ++channel) {
        const auto at = static_cast<std::uint16_t>(ethercat::reg::fmmu + 16 * channel);
        const Mapping mapping{i, channel, master_->read<std::uint32_t>(found_[i].station, at),
                              master_->read<std::uint16_t>(found_[i].station, static_cast<std::uint16_t>(at + 4))};
        mappings.push_back(mapping);
        image.logical = std::min(image.logical, mapping.logical);
        end = std::max(end, mapping.logical + mapping.length);
        image.counter += channel == 0 ? 2 : 1;
      }
    }
    image.data.resize(end - image.logical);
    for (const Mapping& mapping : mappings) {
      if (mapping.channel != 0) continue;
      const auto outputs = operation_->exchange().outputs(mapping.member);
      std::copy(outputs.begin(), outputs.end(), &image.data[mapping.logical - image.logical]);
    }
    return image;
  }

 private:
  std::unique_ptr<master::EthercatMaster> master_;
  std::vector<master::FoundSlave> found_;
  std::vector<std::unique_ptr<master::EthercatSlave>> slaves_;
  std::vector<master::EthercatSlave*> members_;
  std::optional<master::EthercatOperation> operation_;
};

// Counts of round trips by their length.
class Histogram {
 public:
  void add(Time length) {
    const auto bucket = static_cast<std::size_t>(length / resolution);
    ++counts_[std::min(bucket, counts_.size() - 1)];
    ++total_;
    longest_ = std::max(longest_, length);
  }
  std::uint64_t total() const { return total_; }
  double longest_us() const { return microseconds(longest_); }
  double percentile_us(double share) const {
    auto left = static_cast<std::uint64_t>(share * static_cast<double>(total_));
    std::size_t bucket = 0;
    while (bucket + 1 < counts_.size() && counts_[bucket] <= left) left -= counts_[bucket++];
    return microseconds(static_cast<std::int64_t>(bucket) * resolution);
  }

 private:
  static constexpr Time resolution = 50ns;
  static double microseconds(Time time) { return std::chrono::duration<double, std::micro>(time).count(); }

  std::vector<std::uint32_t> counts_ = std::vector<std::uint32_t>(1'000'000);
  std::uint64_t total_ = 0;
  Time longest_{};
};

int measure(const char* link, double seconds, ProcessImage image) {
  const auto client = links::open_ethercat_client(link);
  std::array<std::uint8_t, ethercat::max_payload> memory;
  std::array<std::uint8_t, ethercat::max_payload> received;
  ethercat::FrameWriter writer = ethercat::FrameWriter::payload(memory);
  const auto data = writer.add(ethercat::Command::lrw, 0, image.logical, image.data.size());
  std::copy(image.data.begin(), image.data.end(), data.begin());
  writer.add(ethercat::Command::brd, 0, ethercat::address_of(0, ethercat::reg::al_status), 2);
  constexpr std::size_t index_at = 3;

  Histogram lengths;
  std::uint64_t lost = 0;
  std::uint64_t wrong = 0;
  const Time start = client->now();
  const Time end = start + Time(static_cast<std::int64_t>(seconds * 1e9));
  Time sent = start;
  while (sent < end) {
    const auto index = static_cast<std::uint8_t>(memory[index_at] + 1);
    memory[index_at] = index;
    client->send(writer.bytes());
    std::size_t size = 0;
    do {
      size = client->receive(received, 100ms);
    } while (size != 0 && received[index_at] != index);
    const Time back = client->now();
    if (size == 0) {
      ++lost;
    } else {
      lengths.add(back - sent);
      const std::size_t counter_at = 2 + ethercat::datagram_header_size + image.data.size();
      if (image.counter != 0 && ethercat::load_u16(&received[counter_at]) != image.counter) ++wrong;
    }
    sent = back;
  }
  const double elapsed = std::chrono::duration<double>(sent - start).count();
  std::printf(
      "%8.0f /s   p50 %6.2f us   p99 %6.2f us   longest %8.1f us   %llu lost   %llu wrong counters   %zu bytes\n",
      static_cast<double>(lengths.total()) / elapsed, lengths.percentile_us(0.5), lengths.percentile_us(0.99),
      lengths.longest_us(), static_cast<unsigned long long>(lost), static_cast<unsigned long long>(wrong),
      image.data.size());
  return lost == 0 && wrong == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: ethercat_latency LINK SECONDS [BYTES]\n");
    return 2;
  }
  try {
    const double seconds = std::atof(argv[2]);
    if (argc > 3) {
      ProcessImage image;
      image.data.resize(static_cast<std::size_t>(std::atoi(argv[3])));
      return measure(argv[1], seconds, image);
    }
    Line line(argv[1]);
    return measure(argv[1], seconds, line.image());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ethercat_latency: %s\n", error.what());
    return 1;
  }
}
