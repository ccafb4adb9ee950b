// SDO block download on CAN, frame by frame.
#include "canopen/301/sdo_wire.hpp"
#include "canopen/crc16.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/frames.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::block_group {
namespace {

using namespace std::chrono_literals;
using dictionary::AbortCode;
namespace sdo = canopen::sdo;

// The profile velocity: writing it has no effect on an axis at rest.
constexpr std::uint16_t index = 0x6081;
constexpr std::uint8_t bytes = 4;
constexpr std::uint8_t initiate = 0xC6;  // initiate block download, with CRC and size
constexpr std::uint8_t end_request = 0xC1;
constexpr std::uint8_t in_server_crc = 0x04;

std::array<std::byte, bytes> bytes_of(std::uint32_t value) {
  std::array<std::byte, bytes> result{};
  std::memcpy(result.data(), &value, bytes);
  return result;
}

std::uint32_t number_in(const SdoFrame& frame) {
  std::uint32_t value = 0;
  std::memcpy(&value, &frame[4], sizeof value);
  return value;
}

std::string text_of_answer(const std::optional<SdoFrame>& answer) {
  return answer ? text_of_sdo(*answer) : "no answer";
}

bool is_abort(const std::optional<SdoFrame>& answer, AbortCode code) {
  return answer && (*answer)[0] == sdo::abort_transfer && number_in(*answer) == static_cast<std::uint32_t>(code);
}

SdoFrame segment(std::uint8_t first, std::uint32_t value) {
  SdoFrame frame{first};
  std::memcpy(&frame[1], &value, bytes);
  return frame;
}

SdoFrame end_with(std::uint16_t crc) {
  return {static_cast<std::uint8_t>(end_request | (7 - bytes) << 2), static_cast<std::uint8_t>(crc),
          static_cast<std::uint8_t>(crc >> 8)};
}

// State of a block download that has been initiated; `value` is the value to download.
struct Begun {
  std::uint32_t before = 0;
  std::uint32_t value = 0;
  bool checks_crc = false;
  std::uint8_t block_size = 0;
};

Begun begin(Trial& trial) {
  const auto before = trial.objects().read_if_present<std::uint32_t>(index);
  if (!before) Trial::skip("it has no 6081h, which would be written");
  trial.objects().keep({index, 0});
  const SdoFrame request{initiate, index & 0xFF, index >> 8, 0, bytes};
  const auto answer = ask_sdo(trial, request);
  if (is_abort(answer, AbortCode::command_specifier_unknown)) Trial::skip("it has no block transfer (0504 0001h)");
  trial.require(answer && ((*answer)[0] & 0xFB) == 0xA0 && (*answer)[4] >= 1 && (*answer)[4] <= sdo::largest_block,
                text_of_sdo(request), "A0h or A4h, and a block size from 1 to 127", text_of_answer(answer));
  return {*before, *before + 1, ((*answer)[0] & in_server_crc) != 0, (*answer)[4]};
}

void send_segment(Trial& trial, const Begun& begun) {
  const SdoFrame only = segment(sdo::last_block_segment | 1, begun.value);
  const auto answer = ask_sdo(trial, only);
  trial.require(answer && (*answer)[0] == sdo::server::block_downloaded && (*answer)[1] == 1, text_of_sdo(only),
                "A2h, segment 1 acknowledged", text_of_answer(answer));
}

void expect_value(Trial& trial, std::uint32_t wanted, const char* when) {
  const auto value = trial.objects().read<std::uint32_t>(index);
  trial.expect(value == wanted, fmt::format("read 6081h {}", when), fmt::format("{}", wanted),
               fmt::format("{}", value));
}

void downloads(Trial& trial, int) {
  const Begun begun = begin(trial);
  send_segment(trial, begun);
  const SdoFrame end = end_with(begun.checks_crc ? canopen::crc16(bytes_of(begun.value)) : std::uint16_t{0});
  const auto answer = ask_sdo(trial, end);
  trial.expect(answer && (*answer)[0] == sdo::server::block_download_ended, text_of_sdo(end), "A1h",
               text_of_answer(answer));
  expect_value(trial, begun.value, "after the block");
}

void wrong_crc(Trial& trial, int) {
  const Begun begun = begin(trial);
  if (!begun.checks_crc) {
    ask_sdo(trial, {sdo::abort_transfer, index & 0xFF, index >> 8, 0, 0, 0, 0, 0x08}, 100ms);
    Trial::skip("it checks no CRC, which its answer to the request says");
  }
  send_segment(trial, begun);
  const SdoFrame end = end_with(static_cast<std::uint16_t>(canopen::crc16(bytes_of(begun.value)) ^ 0x0001U));
  const auto answer = ask_sdo(trial, end);
  trial.expect(is_abort(answer, AbortCode::crc_error), text_of_sdo(end) + " (the CRC is wrong)",
               "abort " + text_of(AbortCode::crc_error), text_of_answer(answer));
  expect_value(trial, begun.before, "after it was refused");
}

void aborted(Trial& trial, int) {
  const Begun begun = begin(trial);
  send_segment(trial, begun);
  const SdoFrame abort{sdo::abort_transfer, index & 0xFF, index >> 8, 0, 0, 0, 0, 0x08};
  const auto answer = ask_sdo(trial, abort, 100ms);
  trial.expect(!answer, text_of_sdo(abort), "no answer to an abort", text_of_answer(answer));
  expect_value(trial, begun.before, "after the abort");
  // The server must have discarded the transfer.
  const SdoFrame end = end_with(canopen::crc16(bytes_of(begun.value)));
  const auto late = ask_sdo(trial, end);
  trial.expect(is_abort(late, AbortCode::command_specifier_unknown), text_of_sdo(end) + " (after the abort)",
               "abort " + text_of(AbortCode::command_specifier_unknown), text_of_answer(late));
  expect_value(trial, begun.before, "after that");
}

// Sends segment 2 without segment 1, which the server must request again; then sends segment 1.
void missing_segment(Trial& trial, int) {
  const Begun begun = begin(trial);
  if (begun.block_size < 2) {
    ask_sdo(trial, {sdo::abort_transfer, index & 0xFF, index >> 8, 0, 0, 0, 0, 0x08}, 100ms);
    Trial::skip("its blocks are of one segment");
  }
  const SdoFrame second = segment(sdo::last_block_segment | 2, ~begun.value);
  const auto answer = ask_sdo(trial, second);
  trial.require(answer && (*answer)[0] == sdo::server::block_downloaded && (*answer)[1] == 0,
                text_of_sdo(second) + " (segment 2, and no segment 1)", "A2h, segment 0 acknowledged: repeat all",
                text_of_answer(answer));
  send_segment(trial, begun);
  const SdoFrame end = end_with(begun.checks_crc ? canopen::crc16(bytes_of(begun.value)) : std::uint16_t{0});
  const auto ended = ask_sdo(trial, end);
  trial.expect(ended && (*ended)[0] == sdo::server::block_download_ended, text_of_sdo(end), "A1h",
               text_of_answer(ended));
  expect_value(trial, begun.value, "after segment 1 came");
}

void wrong_sequence_number(Trial& trial, int) {
  const Begun begun = begin(trial);
  const SdoFrame zero = segment(0, begun.value);  // with the last-segment bit it would be 80h, an abort
  const auto answer = ask_sdo(trial, zero);
  trial.expect(is_abort(answer, AbortCode::invalid_sequence_number), text_of_sdo(zero) + " (segment 0)",
               "abort " + text_of(AbortCode::invalid_sequence_number), text_of_answer(answer));
  expect_value(trial, begun.before, "after it was refused");
}

constexpr std::array rows{
    Check{"sdo.block-download", "CiA 301 7.2.4.3.9 to 7.2.4.3.11", "A block download is accepted", Demand::nothing,
          buses::can, downloads},
    Check{"sdo.block-crc", "CiA 301 7.2.4.3.11, 7.2.4.3.16, table 22",
          "A block with a wrong CRC is refused with 0504 0004h, and changes nothing", Demand::nothing, buses::can,
          wrong_crc},
    Check{"sdo.block-abort", "CiA 301 7.2.4.3.17", "A block that the client aborts changes nothing", Demand::nothing,
          buses::can, aborted},
    Check{"sdo.block-repeat", "CiA 301 7.2.4.3.10", "A missing segment is requested again", Demand::nothing, buses::can,
          missing_segment},
    Check{"sdo.block-sequence", "CiA 301 7.2.4.3.10, table 22", "Sequence number 0 is refused with 0504 0003h",
          Demand::nothing, buses::can, wrong_sequence_number},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::block_group
