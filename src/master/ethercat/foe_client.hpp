#pragma once

#include "master/ethercat/mailbox_client.hpp"

namespace servodrome::master {

// File access over EtherCAT (ETG.1000.6 clause 5.8). One transfer at a time. All calls throw EthercatError.
class FoeClient {
 public:
  // `timeout`: for each answer; a slave that erases or writes its memory may need seconds.
  FoeClient(MailboxClient& mailbox, Time timeout = std::chrono::seconds(5)) : mailbox_(mailbox), timeout_(timeout) {}

  // Called with the number of bytes transferred so far.
  using Progress = std::function<void(std::size_t)>;

  std::vector<std::uint8_t> read(std::string_view file, std::uint32_t password = 0, const Progress& progress = {});
  void write(std::string_view file, std::span<const std::uint8_t> content, std::uint32_t password = 0,
             const Progress& progress = {});

 private:
  Mail ask(std::span<const std::uint8_t> request, std::string_view file);
  [[noreturn]] void fail(std::string_view file, const std::string& happened, const std::string& remedy);

  MailboxClient& mailbox_;
  Time timeout_;
};

}  // namespace servodrome::master
