#include "links/serial/line.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace servodrome::links {
namespace {

// Longer than any frame, so that no allocation is necessary while the line runs.
constexpr std::size_t usual_queue = 1024;

std::size_t index_of(SerialPortId port) { return static_cast<std::size_t>(port); }

}  // namespace

SerialPortId SerialLine::attach(SerialStation& station, SerialSender side) {
  auto place = std::find_if(ports_.begin(), ports_.end(), [](const Port& port) { return port.station == nullptr; });
  if (place == ports_.end()) place = ports_.emplace(ports_.end());
  *place = Port{};
  place->station = &station;
  place->side = side;
  place->format = format_;
  place->queue.reserve(usual_queue);
  return static_cast<SerialPortId>(place - ports_.begin());
}

void SerialLine::detach(SerialPortId port) { ports_[index_of(port)] = Port{}; }

void SerialLine::set_format(SerialPortId port, const modbus::CharacterFormat& format) {
  ports_[index_of(port)].format = format;
}

void SerialLine::transmit(SerialPortId id, std::span<const std::uint8_t> characters, Time at) {
  Port& port = ports_[index_of(id)];
  port.queue.erase(port.queue.begin(), port.queue.begin() + static_cast<std::ptrdiff_t>(port.sent));
  port.sent = 0;
  port.queue.insert(port.queue.end(), characters.begin(), characters.end());
  if (!port.is_sending && !port.queue.empty()) begin_character(port, std::max(at, now_));
}

void SerialLine::discard(SerialPortId id) {
  Port& port = ports_[index_of(id)];
  port.queue.clear();
  port.sent = 0;
  port.is_lost = true;
  port.pieces.clear();
  port.piece_at = never;
}

void SerialLine::interpose(SerialPortId port, SerialInterposer* interposer) {
  ports_[index_of(port)].interposer = interposer;
}

std::size_t SerialLine::pending(SerialPortId id) const {
  const Port& port = ports_[index_of(id)];
  std::size_t count = port.queue.size() - port.sent + (port.is_sending ? 1U : 0U);
  for (const SerialPiece& piece : port.pieces) count += piece.characters.size();
  return count;
}

void SerialLine::begin_character(Port& port, Time at) {
  port.character = port.queue[port.sent++];
  port.is_sending = true;
  port.is_garbled = false;
  disturb_character(port);
  port.begin = at;
  port.end = at + port.format.character_time();
  ++counters_.characters;
  for (Port& other : ports_) {
    if (&other == &port || !other.is_sending || other.begin >= port.end || port.begin >= other.end) continue;
    for (Port* one : {&port, &other}) {
      if (!one->is_garbled) ++counters_.collisions;
      one->is_garbled = true;
    }
    // Real receivers may see anything here. The simulation joins the two characters so that a 0 of either sender wins.
    port.character = other.character = port.character & other.character;
  }
}

void SerialLine::disturb(const SerialDisturbance& disturbance) {
  disturbance_ = disturbance;
  DisturbanceGenerator seeds(disturbance.seed);
  drops_ = DisturbanceGenerator(seeds.next());
  corruptions_ = DisturbanceGenerator(seeds.next());
}

void SerialLine::disturb_character(Port& port) {
  port.is_lost = drops_.chance(disturbance_.drop) || disturbance_.cut;
  const bool is_corrupt = corruptions_.chance(disturbance_.corrupt);
  const auto bit = static_cast<unsigned>(corruptions_.next() % port.format.data_bits);
  if (is_corrupt) port.character = static_cast<std::uint8_t>(port.character ^ 1U << bit);
  if (port.is_lost || is_corrupt) ++counters_.disturbed;
}

void SerialLine::end_character(Port& sender) {
  sender.is_sending = false;
  if (!observers_.empty() && !sender.is_lost) {
    const auto id = static_cast<SerialPortId>(&sender - ports_.data());
    for (SerialObserver* observer : observers_) observer->on_character(sender.side, id, sender.character, now_);
  }
  for (std::size_t i = 0; i < ports_.size() && !sender.is_lost; ++i) {
    Port& receiver = ports_[i];
    if (&receiver == &sender || receiver.station == nullptr) continue;
    std::uint8_t character = sender.character;
    bool intact = !sender.is_garbled && sender.format == receiver.format;
    if (receiver.interposer != nullptr && !receiver.interposer->receives(character, intact, now_)) continue;
    receiver.station->receive(character, intact, now_);
  }
  if (!sender.is_sending && sender.sent < sender.queue.size()) begin_character(sender, now_);
}

Time SerialLine::next_event() const {
  Time next = never;
  for (const Port& port : ports_) {
    if (port.station == nullptr) continue;
    next = std::min(next, port.is_sending ? port.end : port.piece_at);
    next = std::min(next, port.station->next_deadline());
  }
  return next == never ? never : std::max(next, now_);
}

void SerialLine::collect() {
  for (std::size_t i = 0; i < ports_.size(); ++i) {
    Port& port = ports_[i];
    if (port.station == nullptr) continue;
    const auto id = static_cast<SerialPortId>(i);
    const auto characters = port.station->take();
    if (!characters.empty() && (port.interposer != nullptr || !port.pieces.empty())) {
      std::vector<SerialPiece> pieces{{Time{}, {characters.begin(), characters.end()}}};
      if (port.interposer != nullptr) pieces = port.interposer->answers(characters, now_);
      std::move(pieces.begin(), pieces.end(), std::back_inserter(port.pieces));
    } else if (!characters.empty()) {
      transmit(id, characters, now_);
    }
    if (!port.pieces.empty()) send_pieces(id);
  }
}

// Sends the pieces that are due. The pause before a piece begins when the port has sent everything before it.
void SerialLine::send_pieces(SerialPortId id) {
  Port& port = ports_[index_of(id)];
  while (!port.pieces.empty() && !port.is_sending) {
    if (port.piece_at == never) port.piece_at = now_ + port.pieces.front().pause;
    if (port.piece_at > now_) return;
    port.piece_at = never;
    const SerialPiece piece = std::move(port.pieces.front());
    port.pieces.erase(port.pieces.begin());
    transmit(id, piece.characters, now_);
  }
}

void SerialLine::advance(Time until) {
  for (Time next = next_event(); next <= until && next != never; next = next_event()) {
    now_ = next;
    for (std::size_t i = 0; i < ports_.size(); ++i) {
      if (ports_[i].is_sending && ports_[i].end <= now_) end_character(ports_[i]);
    }
    for (std::size_t i = 0; i < ports_.size(); ++i) {
      SerialStation* station = ports_[i].station;
      if (station != nullptr && station->next_deadline() <= now_) station->poll(now_);
    }
    collect();
  }
  now_ = std::max(now_, until);
}

}  // namespace servodrome::links
