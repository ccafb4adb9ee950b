#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "ethercat/esc/registers.hpp"
#include "ethercat/frame/frame_writer.hpp"
#include "links/heard_clients.hpp"
#include "master/ethercat/error.hpp"

namespace servodrome::master {

using links::Time;

// A datagram to send, and its answer.
struct EthercatDatagram {
  ethercat::Command command = ethercat::Command::nop;
  std::uint32_t address = 0;       // ADP | ADO << 16, or a logical address
  std::span<std::uint8_t> data{};  // at most ethercat::max_datagram_data bytes
  std::uint16_t counter = 0;       // working counter
  bool answered = false;
  std::uint8_t index = 0;  // index of the frame that carried it
};

// A task that sends frames at its own times, while the master waits.
class CyclicTask {
 public:
  virtual Time due() const = 0;
  virtual void run() = 0;
  // Called for a frame that no call waits for any more, or that belongs to another master.
  virtual void overdue(std::span<const ethercat::Datagram> datagrams) = 0;

 protected:
  ~CyclicTask() = default;
};

struct EthercatOptions {
  Time timeout = std::chrono::milliseconds(50);  // until a frame must have returned
  unsigned retries = 3;                          // of lost frames
  links::Heard heard{};                          // observer of the frames sent and received
};

// The master's connection to a segment: sends datagrams and matches the answers, reads and writes registers, and runs a
// cyclic task while it waits. ETG.1000.4 clause 5. Single thread.
//
// This class does not evaluate late answers and frames of other masters; it passes them to the cyclic task.
class EthercatMaster {
 public:
  explicit EthercatMaster(std::unique_ptr<links::EthercatClient> client, const EthercatOptions& options = {})
      : client_(std::move(client)), options_(options) {}
  EthercatMaster(const EthercatMaster&) = delete;
  EthercatMaster& operator=(const EthercatMaster&) = delete;

  // Opens `raw:INTERFACE` or `udp:HOST:PORT`. Throws MasterError.
  static std::unique_ptr<EthercatMaster> open(std::string_view link, const EthercatOptions& options = {});

  std::string name() const { return client_->name(); }
  Time now() const { return client_->now(); }
  // Waits for `span`; the cyclic task runs meanwhile.
  void wait(Time span);
  // `task` must exist until another one, or nullptr for none, is set.
  void set_cyclic_task(CyclicTask* task) { task_ = task; }

  // Sends the datagrams in order, in as few frames as possible. Lost frames are sent again, so use try_exchange for an
  // action that must not happen twice. Throws EthercatError if frames do not return, MasterError if the link is lost.
  void exchange(std::span<EthercatDatagram> datagrams);
  void exchange(EthercatDatagram& datagram) { exchange(std::span(&datagram, 1)); }
  // Sends the datagrams that are not `answered`, once. False: not all returned in time.
  bool try_exchange(std::span<EthercatDatagram> datagrams, Time timeout);

  // ---- Registers and memory of one slave, by its station address. All throw EthercatError if it does not answer. ----

  void read(std::uint16_t station, std::uint16_t offset, std::span<std::uint8_t> into);
  void write(std::uint16_t station, std::uint16_t offset, std::span<const std::uint8_t> bytes);
  template <typename T>
  T read(std::uint16_t station, std::uint16_t offset) {
    std::array<std::uint8_t, sizeof(T)> bytes{};
    read(station, offset, bytes);
    return ethercat::load<T>(bytes.data());
  }
  template <typename T>
  void write(std::uint16_t station, std::uint16_t offset, std::type_identity_t<T> value) {
    std::array<std::uint8_t, sizeof(T)> bytes{};
    ethercat::store(bytes.data(), value);
    write(station, offset, bytes);
  }
  // Like read(), but returns the working counter (0 or 1) instead of throwing if the slave does not answer.
  unsigned read_if_there(std::uint16_t station, std::uint16_t offset, std::span<std::uint8_t> into);
  // Like write(), but returns the working counter (0 or 1) instead of throwing if the slave is absent or ignores the
  // write, as a slave whose SII memory is busy ignores 0502h.
  unsigned write_if_accepted(std::uint16_t station, std::uint16_t offset, std::span<const std::uint8_t> bytes);

  // Writes to all slaves; returns the number that accepted it.
  unsigned write_all(std::uint16_t offset, std::span<const std::uint8_t> bytes);

  const EthercatOptions& options() const { return options_; }
  // Number of frames that did not return, including those sent again.
  std::uint64_t lost_frames() const { return lost_frames_; }

 private:
  struct Sent {
    std::size_t first;  // number of the first datagram
    std::size_t count;
    std::uint8_t index;
    bool back = false;
  };

  void run_cyclic_task();
  void send(std::span<EthercatDatagram> datagrams, std::vector<Sent>& sent);
  bool take_answer(std::span<EthercatDatagram> datagrams, std::vector<Sent>& sent, std::size_t size);
  [[noreturn]] void no_answer() const;
  [[noreturn]] void absent(std::uint16_t station, std::uint16_t offset, const char* doing) const;

  std::unique_ptr<links::EthercatClient> client_;
  EthercatOptions options_;
  CyclicTask* task_ = nullptr;
  bool task_runs_ = false;
  std::uint8_t index_ = 0;
  std::uint64_t lost_frames_ = 0;
  std::array<std::uint8_t, ethercat::max_payload> received_{};
};

// For example "udp:127.0.0.1:34980, slave 1001h".
std::string slave_text(const EthercatMaster& master, std::uint16_t station);

}  // namespace servodrome::master
