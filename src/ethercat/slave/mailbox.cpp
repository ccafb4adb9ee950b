#include "ethercat/slave/mailbox.hpp"

namespace servodrome::ethercat {

void Mailbox::reset() {
  waiting_length_ = last_read_length_ = 0;
  occupied_ = repeating_ = send_again_ = held_ = false;
  copies_ = 0;
  counter_ = last_counter_ = 0;
}

void Mailbox::place(std::span<const std::uint8_t> bytes) {
  const std::span<std::uint8_t> memory = esc_.open_for_writing(in);
  if (memory.size() < bytes.size()) return;
  std::copy(bytes.begin(), bytes.end(), memory.begin());
  esc_.close_writing(in);
  occupied_ = true;
}

void Mailbox::place_waiting() {
  if (occupied_ || !send_again_) return;
  send_again_ = false;
  place(waiting_memory_.first(waiting_length_));
}

void Mailbox::follow_master() {
  if (occupied_ && esc_.sync_manager(in).unread == 0) {
    occupied_ = false;
    if (!repeating_) {
      std::copy_n(waiting_memory_.begin(), waiting_length_, last_read_memory_.begin());
      last_read_length_ = waiting_length_;
      if (copies_ != 0) {
        --copies_;
        send_again_ = true;
      } else {
        waiting_length_ = 0;
      }
    }
    repeating_ = false;
  }
  if (esc_.repeat_requested(in)) {
    // The master missed the message that it read last. It is placed again; a newer waiting message is sent after it.
    if (last_read_length_ != 0) {
      if (occupied_) {
        esc_.disable_sync_manager(in, true);
        esc_.disable_sync_manager(in, false);
        send_again_ = send_again_ || !repeating_;
      }
      place(last_read_memory_.first(last_read_length_));
      repeating_ = true;
    }
    esc_.acknowledge_repeat(in);
  }
  place_waiting();
}

bool Mailbox::receive(Request& request) {
  while (true) {
    const std::span<std::uint8_t> bytes = esc_.open_for_reading(out);
    if (bytes.size() < mailbox_header_size) return false;
    auto receipt = SlaveInterposer::Receipt::serve;
    if (interposer_ != nullptr) receipt = interposer_->receives(bytes);
    if (receipt == SlaveInterposer::Receipt::keep) return false;
    const std::size_t length = load_u16(bytes.data());
    const std::uint8_t counter = bytes[5] >> 4 & 7;
    request.type = static_cast<MailboxType>(bytes[5] & 0x0F);
    if (counter != 0 && counter == last_counter_) {
      done();
      continue;
    }
    last_counter_ = counter;
    if (receipt == SlaveInterposer::Receipt::discard) {
      done();
      continue;
    }
    request.data = {};
    if (length <= bytes.size() - mailbox_header_size) request.data = bytes.subspan(mailbox_header_size, length);
    return true;
  }
}

void Mailbox::done() { esc_.close_reading(out); }

bool Mailbox::open(Message& message) {
  if (occupied_ || send_again_ || held_ || !esc_.sync_manager(in).active) return false;
  if (size() < mailbox_header_size) return false;
  message.room = waiting_memory_.subspan(mailbox_header_size, size() - mailbox_header_size);
  message.length = 0;
  return true;
}

void Mailbox::send(const Message& message) {
  std::uint8_t* header = waiting_memory_.data();
  store_u16(header, static_cast<unsigned>(message.length));
  store_u16(header + 2, 0);  // source: the slave itself
  header[4] = 0;
  header[5] = static_cast<std::uint8_t>(static_cast<unsigned>(message.type) | unsigned{next_counter()} << 4);
  waiting_length_ = mailbox_header_size + message.length;
  if (interposer_ != nullptr) {
    send_interposed();
  } else {
    place(waiting_memory_.first(waiting_length_));
  }
}

void Mailbox::send_interposed() {
  SlaveInterposer::Mail mail{waiting_memory_.first(size()), waiting_length_};
  const SlaveInterposer::Dispatch dispatch = interposer_->sends(mail);
  const bool withheld = dispatch.how == SlaveInterposer::Sending::withhold;
  waiting_length_ = withheld ? 0 : std::min(mail.length, mail.mailbox.size());
  copies_ = withheld ? 0 : dispatch.copies;
  held_ = dispatch.how == SlaveInterposer::Sending::hold;
  send_again_ = dispatch.how == SlaveInterposer::Sending::pass;
  place_waiting();  // if the interposer has posted another message, this one waits until the master has read it
}

bool Mailbox::post(std::span<const std::uint8_t> message, bool numbered) {
  const SyncManager& channel = esc_.sync_manager(in);
  if (occupied_ || !channel.active || message.size() < mailbox_header_size || message.size() > channel.length) {
    return false;
  }
  const std::span<std::uint8_t> memory = esc_.open_for_writing(in);
  if (memory.empty()) return false;
  std::copy(message.begin(), message.end(), memory.begin());
  if (numbered) memory[5] = static_cast<std::uint8_t>((memory[5] & 0x8FU) | unsigned{next_counter()} << 4);
  esc_.close_writing(in);
  occupied_ = repeating_ = true;
  return true;
}

void Mailbox::release() {
  if (!held_) return;
  held_ = false;
  send_again_ = true;
  place_waiting();
}

void Mailbox::send_error(MailboxError error) {
  Message message;
  if (!open(message)) return;
  message.type = MailboxType::error;
  message.u16(1);  // the only defined type of mailbox error reply
  message.u16(static_cast<unsigned>(error));
  send(message);
}

}  // namespace servodrome::ethercat
