#include "master/ethercat/slave.hpp"

#include <fmt/format.h>

namespace servodrome::master {

namespace reg = ethercat::reg;
using ethercat::load_u16;
using ethercat::store_u16;

namespace {

// Control bytes of a mailbox's sync managers: mailbox mode, direction, interrupt to the application (ETG.1000.4 table
// 58).
constexpr std::uint8_t mailbox_out_control = 0x26;
constexpr std::uint8_t mailbox_in_control = 0x22;
constexpr std::uint8_t mode_and_direction = 0x0F;

// An SDO needs 10 bytes behind the header, and one datagram reads or writes a whole mailbox.
bool is_possible(const MailboxArea& area) {
  constexpr std::size_t least = ethercat::mailbox_header_size + 10;
  return area.length >= least && area.length <= ethercat::max_datagram_data;
}

}  // namespace

std::string EthercatSlave::where() const {
  return fmt::format("{}, slave {}{}", master_.name(), found_.position,
                     found_.sii.name.empty() ? "" : fmt::format(" ({})", found_.sii.name));
}

void EthercatSlave::lacks(const char* what, const char* remedy) const {
  throw EthercatError(EthercatError::Kind::unsupported, fmt::format("it has no {}", what), where(), remedy);
}

void EthercatSlave::to_init() {
  close_mailbox();
  request(AlState::init);
  const std::array<std::uint8_t, reg::fmmu_bytes * reg::fmmus> no_fmmus{};
  const std::array<std::uint8_t, reg::sync_manager_bytes * reg::sync_managers> no_sync_managers{};
  if (found_.has_clock()) master_.write<std::uint8_t>(station(), reg::sync_activation, 0);
  // A slave may have fewer FMMUs and sync managers.
  const auto fmmus = std::min<std::size_t>(master_.read<std::uint8_t>(station(), reg::fmmu_count), reg::fmmus);
  const auto channels =
      std::min<std::size_t>(master_.read<std::uint8_t>(station(), reg::sync_manager_count), reg::sync_managers);
  if (fmmus != 0) master_.write(station(), reg::fmmu, std::span(no_fmmus).first(fmmus * reg::fmmu_bytes));
  if (channels != 0) {
    master_.write(station(), reg::sync_manager, std::span(no_sync_managers).first(channels * reg::sync_manager_bytes));
  }
}

void EthercatSlave::set_up_mailbox(const MailboxAreas& areas, std::uint8_t out_control, std::uint8_t in_control) {
  std::array<std::uint8_t, 2 * reg::sync_manager_bytes> channels{};
  const auto put = [&](std::size_t n, const MailboxArea& area, std::uint8_t control) {
    std::uint8_t* at = &channels[n * reg::sync_manager_bytes];
    store_u16(at, area.start);
    store_u16(at + 2, area.length);
    at[4] = control;
    at[6] = 1;
  };
  put(0, areas.out, out_control);
  put(1, areas.in, in_control);
  master_.write(station(), reg::sync_manager, channels);
}

void EthercatSlave::check_lengths(const MailboxAreas& areas) const {
  if (is_possible(areas.out) && is_possible(areas.in)) return;
  throw EthercatError(EthercatError::Kind::malformed,
                      fmt::format("its SII describes mailboxes of {} and {} bytes", areas.out.length, areas.in.length),
                      where(), "write its SII again; the content is wrong");
}

void EthercatSlave::close_mailbox() {
  foe_.reset();
  coe_.reset();
  mailbox_.reset();
}

void EthercatSlave::open_mailbox(const MailboxAreas& areas, bool fresh) {
  close_mailbox();
  mailbox_.emplace(master_, station(), areas, fresh);
  coe_.emplace(*mailbox_, timeout_);
  foe_.emplace(*mailbox_);
}

void EthercatSlave::to_pre_operational() {
  AlStatus present = status();
  if (present.state() == AlState::bootstrap || present.state() == AlState::init) {
    if (has_mailbox()) check_lengths(found_.sii.mailbox);
    to_init();
    if (has_mailbox()) {
      const auto& channels = found_.sii.sync_managers;
      const bool listed = channels.size() >= 2 && channels[0].type == 1 && channels[1].type == 2;
      set_up_mailbox(found_.sii.mailbox, listed ? channels[0].control : mailbox_out_control,
                     listed ? channels[1].control : mailbox_in_control);
    }
    request(AlState::pre_operational);
    if (has_mailbox()) open_mailbox(found_.sii.mailbox, true);
    return;
  }
  if (present.state() == AlState::pre_operational && !present.error()) return;
  request(AlState::pre_operational);
}

void EthercatSlave::to_bootstrap() {
  const MailboxAreas& areas = found_.sii.bootstrap;
  if (areas.out.length == 0 || areas.in.length == 0) lacks("Bootstrap mailbox", "leave BOOT out; use FoE in PREOP");
  check_lengths(areas);
  to_init();
  set_up_mailbox(areas, mailbox_out_control, mailbox_in_control);
  request(AlState::bootstrap);
  open_mailbox(areas, true);
}

// The mailbox areas as sync managers 0 and 1 are set up; nullopt if they are not a mailbox.
std::optional<MailboxAreas> EthercatSlave::areas_in_use() {
  std::array<std::uint8_t, 2 * reg::sync_manager_bytes> channels{};
  master_.read(station(), reg::sync_manager, channels);
  const std::uint8_t* in = &channels[reg::sync_manager_bytes];
  const bool good = (channels[4] & mode_and_direction) == (mailbox_out_control & mode_and_direction) &&
                    (in[4] & mode_and_direction) == (mailbox_in_control & mode_and_direction) &&
                    (channels[6] & 1) != 0 && (in[6] & 1) != 0;
  const MailboxAreas areas{.out = {load_u16(channels.data()), load_u16(&channels[2])},
                           .in = {load_u16(in), load_u16(in + 2)}};
  if (!good || !is_possible(areas.out) || !is_possible(areas.in)) return std::nullopt;
  return areas;
}

MailboxClient& EthercatSlave::mailbox() {
  if (mailbox_) return *mailbox_;
  if (!has_mailbox()) lacks("mailbox", "use its process data; it has no objects to be read by SDO");
  if (status().state() != AlState::init) {
    if (const auto areas = areas_in_use()) {
      open_mailbox(*areas, false);
      return *mailbox_;
    }
    to_init();
  }
  to_pre_operational();
  if (mailbox_) return *mailbox_;
  throw EthercatError(EthercatError::Kind::refused, "it has left INIT before its mailbox was set up", where(),
                      "stop any other master of the segment, and try again");
}

CoeClient& EthercatSlave::coe() {
  if (!has_coe()) lacks("CoE", "use its process data; it has no objects to be read by SDO");
  mailbox();
  return *coe_;
}

FoeClient& EthercatSlave::foe() {
  mailbox();
  return *foe_;
}

}  // namespace servodrome::master
