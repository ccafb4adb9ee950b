#pragma once

#include "links/serial/client.hpp"
#include "links/serial_rig.hpp"

// Drives and a master on one simulated serial line, in virtual time.
namespace servodrome::master::test {

using namespace std::chrono_literals;

class SerialMasterLine final : public links::test::SerialRig, public links::VirtualClock {
 public:
  links::Time now() const override { return line.now(); }
  links::Time now() override { return line.now(); }
  // Advances to the next event, by at most 100 us.
  void step(links::Time latest = links::never) override {
    const links::Time step = std::min<links::Time>(latest, line.now() + 100us);
    line.advance(std::min(step, std::max(line.now() + 1us, line.next_event())));
  }

  std::unique_ptr<links::ByteClient> client() { return std::make_unique<links::MemoryByteClient>(line, *this); }
};

// Answers each request with the next answer of a script, whatever the request is.
class ScriptedClient final : public links::ByteClient {
 public:
  using Bytes = std::vector<std::uint8_t>;

  explicit ScriptedClient(std::vector<Bytes> answers) : answers_(std::move(answers)) {}

  void send(std::span<const std::uint8_t>) override {
    if (next_ < answers_.size()) waiting_ = answers_[next_++];
  }
  bool receive(Bytes& bytes, links::Time timeout) override {
    if (waiting_.empty()) now_ += timeout;
    bytes.insert(bytes.end(), waiting_.begin(), waiting_.end());
    return !std::exchange(waiting_, {}).empty();
  }
  links::Time now() const override { return now_; }
  void wait(links::Time span) override { now_ += span; }

 private:
  std::vector<Bytes> answers_;
  std::size_t next_ = 0;
  Bytes waiting_;
  links::Time now_{};
};

}  // namespace servodrome::master::test
