// The SDO protocol on CAN, frame by frame.
#include "tools/conform/check_tables.hpp"
#include "tools/conform/frames.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::sdo_group {
namespace {

using namespace std::chrono_literals;
using dictionary::AbortCode;

constexpr std::uint8_t initiate_upload = 0x40;
constexpr std::uint8_t toggle = 0x10;

// An object with a text of more than 4 bytes, for a segmented upload.
std::uint16_t long_object(Trial& trial) {
  for (const std::uint16_t index : {std::uint16_t{0x1008}, std::uint16_t{0x1009}, std::uint16_t{0x100A}}) {
    const auto refusal = Trial::refusal_of([&] { trial.subject().can().sdo.upload({index, 0}); });
    if (!refusal && trial.subject().can().sdo.upload({index, 0}).size() > 4) return index;
  }
  Trial::skip("it has no text of more than 4 bytes at 1008h to 100Ah, to be uploaded in segments");
}

SdoFrame request(std::uint8_t command, std::uint16_t index, std::uint8_t sub, std::uint32_t data = 0) {
  return {command,
          static_cast<std::uint8_t>(index),
          static_cast<std::uint8_t>(index >> 8),
          sub,
          static_cast<std::uint8_t>(data),
          static_cast<std::uint8_t>(data >> 8),
          static_cast<std::uint8_t>(data >> 16),
          static_cast<std::uint8_t>(data >> 24)};
}

std::uint32_t number_in(const SdoFrame& frame) {
  return static_cast<std::uint32_t>(frame[4]) | static_cast<std::uint32_t>(frame[5]) << 8 |
         static_cast<std::uint32_t>(frame[6]) << 16 | static_cast<std::uint32_t>(frame[7]) << 24;
}

void expect_abort(Trial& trial, const SdoFrame& sent, AbortCode code) {
  const auto answer = ask_sdo(trial, sent);
  const bool right = answer && (*answer)[0] == 0x80 && number_in(*answer) == static_cast<std::uint32_t>(code);
  trial.expect(right, text_of_sdo(sent), "abort " + text_of(code), answer ? text_of_sdo(*answer) : "no answer");
}

void unknown_command(Trial& trial, int) {
  expect_abort(trial, request(0xE0, 0x1000, 0), AbortCode::command_specifier_unknown);
}

void stray_segment(Trial& trial, int) {
  expect_abort(trial, request(0x60, 0, 0), AbortCode::command_specifier_unknown);
  expect_abort(trial, request(0x00, 0, 0), AbortCode::command_specifier_unknown);
}

void echoed_multiplexer(Trial& trial, int) {
  for (const auto& [index, sub] : {std::pair<std::uint16_t, std::uint8_t>{0x1000, 0}, {0x1018, 1}, {0x6041, 0}}) {
    const SdoFrame sent = request(initiate_upload, index, sub);
    const auto answer = ask_sdo(trial, sent);
    const bool right =
        answer && ((*answer)[0] & 0xE3) == 0x43 && std::equal(sent.begin() + 1, sent.begin() + 4, answer->begin() + 1);
    trial.expect(right, text_of_sdo(sent), "an expedited answer with its size, index and sub-index",
                 answer ? text_of_sdo(*answer) : "no answer");
  }
}

void wrong_toggle(Trial& trial, int) {
  const std::uint16_t index = long_object(trial);
  const auto initiated = ask_sdo(trial, request(initiate_upload, index, 0));
  trial.require(initiated && ((*initiated)[0] & 0xE2) == 0x40, text_of_sdo(request(initiate_upload, index, 0)),
                "a segmented upload begins", initiated ? text_of_sdo(*initiated) : "no answer");
  expect_abort(trial, request(0x60 | toggle, 0, 0), AbortCode::toggle_bit_not_alternated);
  // The abort has ended the transfer.
  expect_abort(trial, request(0x60, 0, 0), AbortCode::command_specifier_unknown);
}

void segmented_upload(Trial& trial, int) {
  const std::uint16_t index = long_object(trial);
  const auto initiated = ask_sdo(trial, request(initiate_upload, index, 0));
  trial.require(initiated && ((*initiated)[0] & 0xE2) == 0x40, text_of_sdo(request(initiate_upload, index, 0)),
                "a segmented upload begins", initiated ? text_of_sdo(*initiated) : "no answer");
  const bool sized = ((*initiated)[0] & 1) != 0;
  std::size_t bytes = 0;
  std::uint8_t expected_toggle = 0;
  for (bool last = false; !last;) {
    const SdoFrame sent = request(static_cast<std::uint8_t>(0x60 | expected_toggle), 0, 0);
    const auto answer = ask_sdo(trial, sent);
    trial.require(answer && ((*answer)[0] & 0xF0) == expected_toggle, text_of_sdo(sent),
                  fmt::format("a segment with toggle bit {}", expected_toggle != 0 ? 1 : 0),
                  answer ? text_of_sdo(*answer) : "no answer");
    bytes += 7U - ((*answer)[0] >> 1 & 7U);
    last = ((*answer)[0] & 1) != 0;
    expected_toggle ^= toggle;
    trial.require(bytes <= 4096, "segments", "an end", fmt::format("{} bytes and none", bytes));
  }
  if (sized) {
    trial.expect(bytes == number_in(*initiated), fmt::format("upload {:04X}h in segments", index),
                 fmt::format("{} bytes, as indicated", number_in(*initiated)), fmt::format("{} bytes", bytes));
  }
}

void segmented_download(Trial& trial, int) {
  const auto before = trial.objects().read_if_present<std::uint32_t>(0x6081);
  if (!before) Trial::skip("it has no 6081h, which would be written in segments");
  trial.objects().keep({0x6081, 0});
  const std::uint32_t value = *before + 1;
  const SdoFrame begin = request(0x21, 0x6081, 0, 4);
  auto answer = ask_sdo(trial, begin);
  trial.require(answer && (*answer)[0] == 0x60, text_of_sdo(begin), "60h, download initiated",
                answer ? text_of_sdo(*answer) : "no answer");
  const SdoFrame segment{0x07, static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value >> 8),
                         static_cast<std::uint8_t>(value >> 16), static_cast<std::uint8_t>(value >> 24)};
  answer = ask_sdo(trial, segment);
  trial.expect(answer && (*answer)[0] == 0x20, text_of_sdo(segment), "20h, segment taken",
               answer ? text_of_sdo(*answer) : "no answer");
  const auto after = trial.objects().read<std::uint32_t>(0x6081);
  trial.expect(after == value, "read 6081h", fmt::format("{}", value), fmt::format("{}", after));
}

void download_aborted(Trial& trial, int) {
  const auto before = trial.objects().read_if_present<std::uint32_t>(0x6081);
  if (!before) Trial::skip("it has no 6081h, which would be written in segments");
  trial.objects().keep({0x6081, 0});
  const SdoFrame begin = request(0x21, 0x6081, 0, 4);
  ask_sdo(trial, begin);
  const SdoFrame abort = request(0x80, 0x6081, 0, 0x08000000);
  const auto answer = ask_sdo(trial, abort, 100ms);
  trial.expect(!answer, text_of_sdo(abort), "no answer to an abort", answer ? text_of_sdo(*answer) : "no answer");
  const auto after = trial.objects().read<std::uint32_t>(0x6081);
  trial.expect(after == *before, "read 6081h", fmt::format("{}, as before", *before), fmt::format("{}", after));
}

// A server without block transfer must refuse it; one with it must return the same bytes as a segmented upload.
void block_upload(Trial& trial, int) {
  const std::uint16_t index = long_object(trial);
  SdoClient& sdo = trial.subject().can().sdo;
  const auto by_segments = sdo.upload({index, 0});
  std::vector<std::byte> by_block;
  const auto refusal = Trial::refusal_of([&] { by_block = sdo.upload({index, 0}, SdoProtocol::block); });
  if (refusal) {
    trial.expect(refusal->code == AbortCode::command_specifier_unknown, fmt::format("block upload of {:04X}h", index),
                 "the block, or " + text_of(AbortCode::command_specifier_unknown), refusal->text);
    return;
  }
  trial.expect(by_block == by_segments, fmt::format("block upload of {:04X}h", index),
               fmt::format("the {} bytes that come in segments", by_segments.size()),
               fmt::format("{} bytes", by_block.size()));
}

void one_answer(Trial& trial, int) {
  const SdoFrame sent = request(initiate_upload, 0x1000, 0);
  const unsigned answers = count_sdo_answers(trial, sent, 200ms);
  trial.expect(answers == 1, text_of_sdo(sent), "one answer", fmt::format("{} answers", answers));
}

constexpr std::array rows{
    Check{"sdo.one-answer", "CiA 301 7.2.4.2", "A request is answered exactly once", Demand::nothing, buses::can,
          one_answer},
    Check{"sdo.multiplexer", "CiA 301 7.2.4.3.6", "An answer has the index and sub-index of its request",
          Demand::nothing, buses::can, echoed_multiplexer},
    Check{"sdo.unknown-command", "CiA 301 table 22", "An unknown command is refused with 0504 0001h", Demand::nothing,
          buses::can, unknown_command},
    Check{"sdo.stray-segment", "CiA 301 table 22", "A segment without a transfer is refused with 0504 0001h",
          Demand::nothing, buses::can, stray_segment},
    Check{"sdo.toggle", "CiA 301 7.2.4.3.7, table 22", "A wrong toggle bit ends the transfer with 0503 0000h",
          Demand::nothing, buses::can, wrong_toggle},
    Check{"sdo.segmented-upload", "CiA 301 7.2.4.3.7", "Segments toggle and have the indicated size", Demand::nothing,
          buses::can, segmented_upload},
    Check{"sdo.segmented-download", "CiA 301 7.2.4.3.4", "A segmented download is accepted", Demand::nothing,
          buses::can, segmented_download},
    Check{"sdo.abort-by-client", "CiA 301 7.2.4.3.17", "A transfer that the client aborts changes nothing",
          Demand::nothing, buses::can, download_aborted},
    Check{"sdo.block-upload", "CiA 301 7.2.4.3.12", "A block upload is refused, or has the same data as segments",
          Demand::nothing, buses::can, block_upload},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::sdo_group
