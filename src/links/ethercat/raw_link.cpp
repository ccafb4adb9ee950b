#include "links/ethercat/raw_link.hpp"

#include <algorithm>
#include <cerrno>
#include <fmt/format.h>

#include "links/ethercat/system_links.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

using boost::system::error_code;

constexpr auto retry_time = std::chrono::seconds(1);
// Limit of frames that a disturbance or an interposer delays; further ones are lost.
constexpr std::size_t most_delayed_frames = 256;
// Limit of batches of `most_at_once` frames before other links are served.
constexpr int most_rounds = 4;

}  // namespace

RawLink::RawLink(const RawName& name, EthercatBus& bus, boost::asio::io_context& io, DescriptorWatch& watch,
                 LineHost& host)
    : name_(name), bus_(bus), io_(io), watch_(watch), host_(host) {
  sides_.push_back(std::make_unique<Side>(name.interface, EthercatBus::Port::primary, io));
  if (name.secondary) sides_.push_back(std::make_unique<Side>(*name.secondary, EthercatBus::Port::secondary, io));
  try {
    for (const auto& side : sides_) open(*side);
  } catch (...) {
    for (const auto& side : sides_) close(*side);
    throw;
  }
  if (name.secondary) bus.set_cable(bus.size(), true);
}

RawLink::~RawLink() {
  *alive_ = false;
  for (const auto& side : sides_) close(*side);
}

void RawLink::open(Side& side) {
  side.socket.emplace(side.interface, name());
  counters_.clients = 1;
  if (name_.busy) return;
  watch_.add(side.socket->descriptor(), [this, &side] {
    if (serve(side) == 0) check(side);
  });
}

void RawLink::close(Side& side) {
  if (side.socket) watch_.remove(side.socket->descriptor());
  side.socket.reset();
  const auto is_open = [](const auto& one) { return one->socket.has_value(); };
  counters_.clients = std::any_of(sides_.begin(), sides_.end(), is_open) ? 1 : 0;
}

void RawLink::check(Side& side) {
  if (const int reason = side.socket->take_error(); reason != 0) lose(side, reason);
}

void RawLink::check() {
  for (const auto& side : sides_) {
    if (side->socket) check(*side);
  }
}

bool RawLink::poll() {
  std::size_t served = 0;
  for (const auto& side : sides_) {
    if (side->socket) served += serve(*side);
  }
  return served > 0;
}

// Returns the number of frames served.
std::size_t RawLink::serve(Side& side) {
  std::size_t total = 0;
  for (int round = 0; round < most_rounds; ++round) {
    std::span<std::uint8_t> frame = side.socket->frame(0);
    if (frame.empty()) break;
    const Time at = host_.frame_time();
    std::size_t count = 0;
    for (;;) {
      const auto passage = bus_.pass(frame, at, side.port, EthercatBus::Encapsulation::ethernet, {&side});
      if (passage.kind != ethercat::FrameKind::ethercat) ++counters_.malformed;
      if (passage.exit != EthercatBus::Exit::lost) {
        Side& exit = side_of(passage.exit);
        if (passage.delay > Time{}) {
          send_later(exit, frame.first(passage.length), passage.delay);
        } else {
          exit.outgoing[exit.outgoing_count++] = {frame.data(), passage.length};
        }
      }
      for (const auto& extra : passage.behind) send_later(side, extra, passage.delay);
      ++count;
      frame = count == most_at_once ? std::span<std::uint8_t>() : side.socket->frame(count);
      if (frame.empty()) break;
      bus_.settle(at);
    }
    for (const auto& exit : sides_) send(*exit);
    bus_.settle(at);
    side.socket->release(count);
    counters_.dropped += side.socket->take_overruns();
    counters_.to_bus += count;
    total += count;
  }
  return total;
}

// If this link has only one interface, the master's second port belongs to another link. Frames that come out there are
// still sent back to this link's master.
RawLink::Side& RawLink::side_of(EthercatBus::Exit exit) {
  return *sides_[exit == EthercatBus::Exit::secondary && sides_.size() == 2 ? 1 : 0];
}

void RawLink::send(Side& side) {
  const std::size_t count = std::exchange(side.outgoing_count, 0);
  if (count == 0) return;
  const std::size_t sent = side.socket ? side.socket->send(std::span(side.outgoing).first(count)) : 0;
  counters_.from_bus += sent;
  counters_.dropped += count - sent;
}

void RawLink::send_later(Side& side, std::span<const std::uint8_t> frame, Time delay) {
  if (waiting_ == most_delayed_frames) {
    ++counters_.dropped;
    return;
  }
  ++waiting_;
  const auto timer = std::make_shared<boost::asio::steady_timer>(io_, delay);
  timer->async_wait([this, &side, timer, alive = alive_,
                     bytes = std::vector<std::uint8_t>(frame.begin(), frame.end())](error_code code) mutable {
    if (!*alive || code) return;
    --waiting_;
    side.outgoing[side.outgoing_count++] = {bytes.data(), bytes.size()};
    send(side);
  });
}

void RawLink::lose(Side& side, int reason) {
  close(side);
  host_.report(fmt::format("EtherCAT link \"{}\": interface \"{}\" is lost ({}); waiting for it to come back", name(),
                           side.interface, std::error_code(reason, std::generic_category()).message()));
  try_again(side);
}

void RawLink::try_again(Side& side) {
  side.retry.expires_after(retry_time);
  side.retry.async_wait([this, &side, alive = alive_](error_code code) {
    if (!*alive || code) return;
    try {
      open(side);
    } catch (const LinkError&) {
      close(side);
      return try_again(side);
    }
    host_.report(fmt::format("EtherCAT link \"{}\": interface \"{}\" is back", name(), side.interface));
  });
}

std::unique_ptr<EthercatLink> open_raw_link(const RawName& name, EthercatBus& bus, boost::asio::io_context& io,
                                            DescriptorWatch& watch, LineHost& host) {
  return std::make_unique<RawLink>(name, bus, io, watch, host);
}

}  // namespace servodrome::links
