#pragma once

#include "ethercat/esc/esc.hpp"
#include "ethercat/slave/mailbox_wire.hpp"

namespace servodrome::ethercat {

// The mailbox of a slave on sync managers 0 and 1: headers, counters, repeated messages (ETG.1000.4 clause 5.6, 6.5.3).
class Mailbox {
 public:
  static constexpr unsigned out = 0;  // sync manager, master to slave
  static constexpr unsigned in = 1;   // slave to master

  // The two memories keep messages for a repeat request; each as long as the mailbox can be.
  Mailbox(Esc& esc, std::span<std::uint8_t> waiting, std::span<std::uint8_t> last_read)
      : esc_(esc), waiting_memory_(waiting), last_read_memory_(last_read) {}

  void reset();

  // Before anything else in a poll: what the master read, and whether it wants it again.
  void follow_master();

  struct Request {
    MailboxType type = MailboxType::error;
    std::span<const std::uint8_t> data;  // behind the mailbox header
  };
  // The next message, which stays until `done`. False: there is none. A message with the counter of the one before it
  // was sent twice and is skipped.
  bool receive(Request& request);
  void done();

  // Room for a message to the master. False: the last one was not read yet.
  bool open(Message& message);
  void send(const Message& message);
  void send_error(MailboxError error);

 private:
  void place(std::span<const std::uint8_t> bytes);

  Esc& esc_;
  std::span<std::uint8_t> waiting_memory_;
  std::span<std::uint8_t> last_read_memory_;
  std::size_t waiting_length_ = 0;    // in the sync manager, or to come after a repeat
  std::size_t last_read_length_ = 0;  // what the master read last
  bool occupied_ = false;             // the sync manager holds a message the master has not read
  bool repeating_ = false;            // that message is the last one again
  bool send_again_ = false;           // `waiting_` was taken out for the repeat
  std::uint8_t counter_ = 0;          // of the last message sent, 1..7
  std::uint8_t last_counter_ = 0;     // of the last message received; 0: none
};

}  // namespace servodrome::ethercat
