#pragma once

#include "dictionary/abort_code.hpp"
#include "master/ethercat/mailbox_client.hpp"
#include "master/late_answer.hpp"
#include "master/object_client.hpp"
#include "master/wait_limit.hpp"

namespace servodrome::master {

// An SDO over CoE failed: refused by the slave (from_slave) or aborted by this client.
class CoeError : public ObjectError {
 public:
  CoeError(const std::string& where, ObjectAddress object, bool upload, dictionary::AbortCode code, bool from_slave);

  dictionary::AbortCode code() const { return code_; }
  bool from_slave() const { return from_slave_; }

 private:
  dictionary::AbortCode code_;
  bool from_slave_;
};

enum class ObjectList : std::uint16_t { all = 1, rx_pdo = 2, tx_pdo = 3, stored = 4, start_up = 5 };

// Object description (ETG.1000.6 clause 5.6.3.5).
struct ObjectDescription {
  std::uint16_t index = 0;
  std::uint16_t type = 0;  // data type (CiA 301 table 44) or number of a record type
  std::uint8_t highest_sub = 0;
  std::uint8_t code = 0;  // 7 variable, 8 array, 9 record
  std::string name;
};

// Bits of an entry's access (ETG.1000.6 table 49).
namespace entry_access {
inline constexpr std::uint16_t read = 0x0007;  // bits for PREOP, SAFEOP and OP
inline constexpr std::uint16_t write = 0x0038;
inline constexpr std::uint16_t rx_pdo = 0x0040;
inline constexpr std::uint16_t tx_pdo = 0x0080;
inline constexpr std::uint16_t stored = 0x0100;
}  // namespace entry_access

struct EntryDescription {
  ObjectAddress address;
  std::uint16_t type = 0;
  std::uint16_t bits = 0;
  std::uint16_t access = 0;
  std::optional<std::uint32_t> unit{};  // CiA 303-2
  std::vector<std::uint8_t> default_value{};
  std::vector<std::uint8_t> minimum{};
  std::vector<std::uint8_t> maximum{};
  std::string name{};
};

// CoE client of one slave (ETG.1000.6 clause 5.6): SDO and SDO information. One service at a time. All calls throw
// CoeError, or EthercatError.
class CoeClient {
 public:
  CoeClient(MailboxClient& mailbox, Time timeout = std::chrono::seconds(1)) : mailbox_(mailbox), timeout_(timeout) {}

  // The size determines the transfer: expedited, normal or segmented. An upload without an answer is repeated once; a
  // download is not, because it may have taken effect. Before the repetition, and before the next upload, the client
  // reads a constant object, so that a late answer is not taken for the new one (LateAnswer). If this read gets no
  // answer, the upload counts as unanswered.
  std::vector<std::byte> upload(ObjectAddress object) { return upload(object, false); }
  void download(ObjectAddress object, std::span<const std::byte> data) { download(object, data, false); }
  // Complete access: all entries in one transfer, from sub-index 0 (as two bytes) or from 1. BOOLEANs are packed as
  // bits; every other type starts at a byte.
  std::vector<std::byte> upload_complete(std::uint16_t index, bool with_count = true) {
    return upload({index, with_count ? std::uint8_t{0} : std::uint8_t{1}}, true);
  }
  void download_complete(std::uint16_t index, std::span<const std::byte> data, bool with_count = true) {
    download({index, with_count ? std::uint8_t{0} : std::uint8_t{1}}, data, true);
  }

  template <typename T>
  T read(std::uint16_t index, std::uint8_t sub = 0) {
    const auto bytes = upload({index, sub});
    T value{};
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), std::min(bytes.size(), sizeof value));
    return value;
  }
  template <typename T>
  void write(std::uint16_t index, std::uint8_t sub, std::type_identity_t<T> value) {
    download({index, sub}, std::as_bytes(std::span(&value, 1)));
  }

  // ---- SDO information ----

  std::array<std::uint16_t, 5> list_lengths();
  std::vector<std::uint16_t> list(ObjectList which);
  ObjectDescription describe(std::uint16_t index);
  // Includes unit, default value and limits, if the slave provides them.
  EntryDescription describe(ObjectAddress entry);

  MailboxClient& mailbox() { return mailbox_; }
  void set_timeout(Time timeout) { timeout_ = timeout; }
  void limit_wait(std::optional<Time> longest) { limit_.set(longest); }

 private:
  std::vector<std::byte> upload(ObjectAddress object, bool complete);
  void expect_late_answer(ObjectAddress object);
  void drain_late_answer(ObjectAddress object);
  std::vector<std::byte> upload_once(ObjectAddress object, bool complete);
  void download(ObjectAddress object, std::span<const std::byte> data, bool complete);
  Mail ask(std::span<const std::uint8_t> sdo, ObjectAddress object, bool is_upload, std::uint8_t expected);
  Mail ask_information(std::span<const std::uint8_t> request, std::uint16_t index);
  [[noreturn]] void give_up(ObjectAddress object, bool is_upload, dictionary::AbortCode code);

  Time timeout() const { return limit_.timeout(timeout_); }

  MailboxClient& mailbox_;
  Time timeout_;
  WaitLimit limit_{};
  LateAnswer late_answer_{};
};

}  // namespace servodrome::master
