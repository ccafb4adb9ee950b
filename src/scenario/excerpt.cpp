#include "scenario/excerpt.hpp"

#include <array>
#include <fmt/format.h>

namespace servodrome::scenario {

std::string_view word_of(TrafficLine::Kind kind) {
  constexpr std::array<std::string_view, 5> words{"frame", "error", "act", "moment", "gap"};
  return words[static_cast<std::size_t>(kind)];
}

void Excerpt::add(TrafficLine line) {
  while (next_ < moments_.size() && moments_[next_].at < line.at) pass_moment();
  if (behind_ > 0) {
    --behind_;
    picked_.push_back(std::move(line));
    return;
  }
  before_.push_back(std::move(line));
  if (before_.size() <= lines_before) return;
  before_.pop_front();
  ++left_out_;
}

void Excerpt::pass_moment() {
  const Moment& moment = moments_[next_++];
  if (left_out_ > 0) {
    TrafficLine gap;
    gap.at = before_.front().at;
    gap.text = fmt::format("{} lines are left out", left_out_);
    gap.kind = TrafficLine::Kind::gap;
    picked_.push_back(std::move(gap));
    left_out_ = 0;
  }
  for (TrafficLine& line : before_) picked_.push_back(std::move(line));
  before_.clear();
  TrafficLine mark;
  mark.at = moment.at;
  mark.text = moment.text;
  mark.kind = TrafficLine::Kind::moment;
  picked_.push_back(std::move(mark));
  behind_ = lines_behind;
}

std::vector<TrafficLine> Excerpt::finish() {
  while (next_ < moments_.size()) pass_moment();
  return std::move(picked_);
}

}  // namespace servodrome::scenario
