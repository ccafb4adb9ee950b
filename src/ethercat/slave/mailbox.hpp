#pragma once

#include "ethercat/esc/esc.hpp"
#include "ethercat/slave/mailbox_wire.hpp"
#include "ethercat/slave/slave_interposer.hpp"

namespace servodrome::ethercat {

// The mailbox of a slave on sync managers 0 and 1: headers, counters, repeated messages (ETG.1000.4 clause 5.6, 6.5.3).
class Mailbox {
 public:
  static constexpr unsigned out = 0;  // sync manager, master to slave
  static constexpr unsigned in = 1;   // slave to master

  // The two memories keep messages for a repeat request; each must have the greatest mailbox length.
  Mailbox(Esc& esc, std::span<std::uint8_t> waiting, std::span<std::uint8_t> last_read)
      : esc_(esc), waiting_memory_(waiting), last_read_memory_(last_read) {}

  // The interposer sees all messages from now on; nullptr: none.
  void interpose(SlaveInterposer* interposer) { interposer_ = interposer; }

  void reset();

  // Call it first in a poll: detects that the master has read a message, or that it requests the last one again.
  void follow_master();

  struct Request {
    MailboxType type = MailboxType::error;
    std::span<const std::uint8_t> data;  // data behind the mailbox header
  };
  // Returns the next message, which stays valid until `done`; false if there is none, or the interposer keeps it. Skips
  // a message with the same counter as the one before, because it is a repetition.
  bool receive(Request& request);
  void done();

  // Opens a message to the master. Returns false if the master has not read the last one yet.
  bool open(Message& message);
  void send(const Message& message);
  void send_error(MailboxError error);

  // Puts a message that did not come from the slave into the mailbox. The message has at least a header, and is not
  // repeated on request. `numbered`: with the next counter of the slave. Returns false if it does not fit or the
  // mailbox is full.
  bool post(std::span<const std::uint8_t> message, bool numbered);
  // Sends the message that the interposer held.
  void release();

 private:
  void place(std::span<const std::uint8_t> bytes);
  void place_waiting();
  void send_interposed();
  std::size_t size() const { return std::min<std::size_t>(esc_.sync_manager(in).length, waiting_memory_.size()); }
  std::uint8_t next_counter() {
    return counter_ = counter_ == 7 ? std::uint8_t{1} : static_cast<std::uint8_t>(counter_ + 1);
  }

  Esc& esc_;
  SlaveInterposer* interposer_ = nullptr;
  std::span<std::uint8_t> waiting_memory_;
  std::span<std::uint8_t> last_read_memory_;
  std::size_t waiting_length_ = 0;    // of the message in `waiting_memory_`, also during a repeat
  std::size_t last_read_length_ = 0;  // of the message that the master read last
  bool occupied_ = false;             // the sync manager holds a message the master has not read
  bool repeating_ = false;            // that message is a repeated or posted one, not the one in `waiting_memory_`
  bool send_again_ = false;           // put the message in `waiting_memory_` into the sync manager when that is empty
  bool held_ = false;                 // the interposer holds the message in `waiting_memory_`
  unsigned copies_ = 0;               // how often the message in `waiting_memory_` is sent again after it was read
  std::uint8_t counter_ = 0;          // counter of the last message sent, 1..7
  std::uint8_t last_counter_ = 0;     // counter of the last message received; 0: none
};

}  // namespace servodrome::ethercat
