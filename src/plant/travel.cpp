#include "plant/travel.hpp"

#include <algorithm>

namespace servodrome::plant {

namespace {

constexpr int most_events_per_tick = 64;  // with more, levels stay correct; most edges have no room in the feedback

std::int64_t floor_modulo(std::int64_t value, std::int64_t modulus) {
  const std::int64_t remainder = value % modulus;
  return remainder < 0 ? remainder + modulus : remainder;
}

// Positions of switches are open-ended or small; hysteresis must not make an open end overflow.
std::int64_t lowered(std::int64_t position, std::int64_t by) {
  return position == no_low_limit ? position : position - by;
}
std::int64_t raised(std::int64_t position, std::int64_t by) {
  return position == no_high_limit ? position : position + by;
}

}  // namespace

Travel::Travel(const Encoder& encoder, const std::array<Switch, most_switches>& switches, std::size_t count)
    : counts_per_revolution_(encoder.counts_per_revolution),
      index_position_(encoder.index_position_counts),
      index_width_(encoder.index_width_counts),
      count_(count) {
  for (std::size_t i = 0; i < count_; ++i) {
    const Switch& fitting = switches[i];
    fitted_[i] = {.from = fitting.from_counts,
                  .to = fitting.to_counts,
                  .release_from = lowered(fitting.from_counts, fitting.hysteresis_counts),
                  .release_to = raised(fitting.to_counts, fitting.hysteresis_counts),
                  .wire = fitting.wire,
                  .normally_closed = fitting.normally_closed,
                  .actuated = false};
  }
  place(encoder.start_position_counts);
}

void Travel::set_stops(std::int64_t low, std::int64_t high) {
  low_stop_ = low;
  high_stop_ = high;
}

void Travel::update_level(const Fitted& fitted) {
  const std::uint32_t bit = 1u << fitted.wire;
  levels_ = fitted.actuated != fitted.normally_closed ? levels_ | bit : levels_ & ~bit;
}

void Travel::place(std::int64_t position) {
  for (std::size_t i = 0; i < count_; ++i) {
    Fitted& fitted = fitted_[i];
    fitted.actuated = fitted.from <= position && position <= fitted.to;
    update_level(fitted);
  }
  index_ = floor_modulo(position - index_position_, counts_per_revolution_) < index_width_;
  update_quiet(position);
}

bool Travel::next(int direction, std::int64_t cursor, std::int64_t limit, Event& event) const {
  bool found = false;
  const auto consider = [&](std::int64_t position, std::size_t source) {
    const bool ahead =
        direction > 0 ? position >= cursor && position <= limit : position <= cursor && position >= limit;
    if (!ahead || (found && (direction > 0 ? position >= event.position : position <= event.position))) return;
    event = {position, source};
    found = true;
  };
  for (std::size_t i = 0; i < count_; ++i) {
    const Fitted& fitted = fitted_[i];
    if (!fitted.actuated) {
      const std::int64_t entry = direction > 0 ? fitted.from : fitted.to;
      if (entry != no_low_limit && entry != no_high_limit) consider(entry, i);
    } else if (direction > 0) {
      if (fitted.release_to != no_high_limit) consider(fitted.release_to + 1, i);
    } else {
      if (fitted.release_from != no_low_limit) consider(fitted.release_from - 1, i);
    }
  }
  if (index_width_ > 0) {
    // The first count with the other level in this direction.
    const std::int64_t edge =
        index_position_ + (direction > 0 ? (index_ ? index_width_ : 0) : (index_ ? -1 : index_width_ - 1));
    const std::int64_t distance = floor_modulo(direction * (edge - cursor), counts_per_revolution_);
    consider(cursor + direction * distance, index_source);
  }
  return found;
}

void Travel::apply(const Event& event, drive::Feedback& feedback) {
  drive::Edge edge{.source = drive::Edge::index_source, .rising = false, .position_counts = event.position};
  bool visible = true;
  if (event.source == index_source) {
    index_ = !index_;
    edge.rising = index_;
  } else {
    Fitted& fitted = fitted_[event.source];
    fitted.actuated = !fitted.actuated;
    update_level(fitted);
    edge.source = fitted.wire;
    edge.rising = fitted.actuated != fitted.normally_closed;
    visible = ((forced_ >> fitted.wire) & 1u) == 0;
  }
  if (visible && feedback.edge_count < feedback.edges.size()) feedback.edges[feedback.edge_count++] = edge;
}

void Travel::move(std::int64_t from, std::int64_t to, drive::Feedback& feedback) {
  if (from != to) {
    const int direction = to > from ? 1 : -1;
    std::int64_t cursor = from + direction;
    Event event{};
    int events = 0;
    while (next(direction, cursor, to, event) && ++events <= most_events_per_tick) {
      apply(event, feedback);
      cursor = event.position;
    }
    if (events > most_events_per_tick) place(to);
  }
  update_quiet(to);
}

void Travel::update_quiet(std::int64_t position) {
  // The search range is bounded only to keep the sums in range.
  constexpr std::int64_t far = std::int64_t{1} << 40;
  std::int64_t high = position + far;
  std::int64_t low = position - far;
  Event event{};
  if (next(1, position + 1, high, event)) high = event.position - 1;
  if (next(-1, position - 1, low, event)) low = event.position + 1;
  // The load may touch a stop anywhere within its last count.
  if (high_stop_ != no_high_limit) high = std::min(high, high_stop_ - 1);
  if (low_stop_ != no_low_limit) low = std::max(low, low_stop_);
  if (beyond_stop(position) || high < low) {  // the stop also pushes on the way out: check again in every tick
    quiet_from_ = position + far;
    quiet_span_ = 0;
    return;
  }
  quiet_from_ = low;
  quiet_span_ = static_cast<std::uint64_t>(high - low);
}

bool Travel::force(int wire, bool level_wanted) {
  const bool before = level(wire);
  const std::uint32_t bit = 1u << wire;
  forced_ |= bit;
  forced_levels_ = level_wanted ? forced_levels_ | bit : forced_levels_ & ~bit;
  return level(wire) != before;
}

bool Travel::release(int wire) {
  const bool before = level(wire);
  forced_ &= ~(1u << wire);
  return level(wire) != before;
}

}  // namespace servodrome::plant
