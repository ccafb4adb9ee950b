#include "shrink.hpp"

#include <algorithm>

namespace servodrome::motion {
namespace {

class Shrinker {
 public:
  Shrinker(Sequence sequence, const std::function<bool(const Sequence&)>& breaks, int most_runs)
      : best_(std::move(sequence)), breaks_(breaks), left_(most_runs) {}

  Sequence shrink() {
    for (bool better = true; better && left_ > 0;) {
      better = false;
      better |= drop_axes();
      better |= drop_events();
      better |= simplify_setup();
      better |= simplify_times();
      better |= simplify_values();
    }
    return best_;
  }

 private:
  bool take(const Sequence& candidate) {
    if (left_ <= 0 || candidate == best_) return false;
    --left_;
    if (!breaks_(candidate)) return false;
    best_ = candidate;
    return true;
  }

  bool drop_axes() {
    bool better = false;
    for (std::size_t i = best_.axes.size(); best_.axes.size() > 1 && i-- > 0;) {
      Sequence candidate = best_;
      candidate.axes.erase(candidate.axes.begin() + static_cast<std::ptrdiff_t>(i));
      std::erase_if(candidate.events, [i](const Event& event) { return event.axis == i; });
      for (Event& event : candidate.events) {
        if (event.axis > i) --event.axis;
      }
      better |= take(candidate);
    }
    return better;
  }

  bool drop_events() {
    bool better = false;
    for (std::size_t chunk = std::max<std::size_t>(1, best_.events.size() / 2);; chunk /= 2) {
      for (std::size_t at = 0; at < best_.events.size();) {
        Sequence candidate = best_;
        const auto first = candidate.events.begin() + static_cast<std::ptrdiff_t>(at);
        candidate.events.erase(first, first + static_cast<std::ptrdiff_t>(std::min(chunk, best_.events.size() - at)));
        if (take(candidate)) {
          better = true;
        } else {
          at += chunk;
        }
      }
      if (chunk <= 1) return better;
    }
  }

  bool simplify_setup() {
    bool better = false;
    const auto attempt = [&](auto change) {
      Sequence candidate = best_;
      change(candidate);
      better |= take(candidate);
    };
    for (std::size_t i = 0; i < best_.axes.size(); ++i) {
      attempt([i](Sequence& s) { s.axes[i].model.clear(); });
      attempt([i](Sequence& s) { s.axes[i].start_counts = 0; });
      attempt([i](Sequence& s) { s.axes[i].inertia_percent = 100; });
      attempt([i](Sequence& s) { s.axes[i].friction_percent = 100; });
      attempt([i](Sequence& s) { s.axes[i].travel_counts = 0; });
      attempt([i](Sequence& s) { s.axes[i].stop_counts = 0; });
    }
    attempt([](Sequence& s) { s.cycle_us = 1000; });
    attempt([](Sequence& s) { s.sync = false; });
    attempt([](Sequence& s) { s.mapped = true; });
    return better;
  }

  // Shortens the times between events, to whole milliseconds.
  bool simplify_times() {
    bool better = false;
    for (std::size_t i = 0; i < best_.events.size(); ++i) {
      const std::int64_t before = i == 0 ? 16 : best_.events[i - 1].tick;
      const std::int64_t wait = best_.events[i].tick - before;
      for (const std::int64_t shorter : {std::int64_t{0}, wait / 4 / 16 * 16, wait / 2 / 16 * 16, wait / 16 * 16}) {
        if (shorter < 0 || shorter >= wait) continue;
        Sequence candidate = best_;
        for (std::size_t k = i; k < candidate.events.size(); ++k) candidate.events[k].tick -= wait - shorter;
        candidate.end_tick -= wait - shorter;
        if (take(candidate)) {
          better = true;
          break;
        }
      }
    }
    const std::int64_t last = best_.events.empty() ? 16 : best_.events.back().tick;
    for (const std::int64_t tail : {std::int64_t{160}, std::int64_t{800}, std::int64_t{1600}, std::int64_t{4800}}) {
      if (last + tail >= best_.end_tick) continue;
      Sequence candidate = best_;
      candidate.end_tick = last + tail;
      if (take(candidate)) {
        better = true;
        break;
      }
    }
    return better;
  }

  static std::int64_t rounded(std::int64_t value, std::int64_t unit) { return value / unit * unit; }

  bool simplify_values() {
    bool better = false;
    for (std::size_t i = 0; i < best_.events.size(); ++i) {
      const Event event = best_.events[i];
      const auto attempt = [&](auto change) {
        Sequence candidate = best_;
        change(candidate.events[i]);
        const bool taken = take(candidate);
        better |= taken;
        return taken;
      };
      if (event.kind == Kind::write_here) {
        attempt([](Event& e) { e.kind = Kind::write; });
      }
      if (event.kind == Kind::write || event.kind == Kind::write_here) {
        if (event.via != Via::sdo) attempt([](Event& e) { e.via = Via::sdo; });
      }
      const bool number = event.kind == Kind::write || event.kind == Kind::write_here || event.kind == Kind::stream;
      if (number && event.index != 0x6040 && event.index != 0x6060) {
        for (const std::int64_t simpler :
             {std::int64_t{0}, rounded(event.value, 100000), rounded(event.value, 1000), rounded(event.value, 10)}) {
          if (simpler == event.value) continue;
          if (attempt([simpler](Event& e) { e.value = simpler; })) break;
        }
      }
      if (event.gap != 0) attempt([](Event& e) { e.gap = 0; });
      if (event.kind == Kind::stream && event.count > 10) {
        for (const std::int64_t count : {std::int64_t{10}, std::int64_t{50}, std::int64_t{100}}) {
          if (count < event.count && attempt([count](Event& e) { e.count = count; })) break;
        }
      }
    }
    return better;
  }

  Sequence best_;
  const std::function<bool(const Sequence&)>& breaks_;
  int left_;
};

}  // namespace

Sequence shrink(Sequence sequence, const std::function<bool(const Sequence&)>& breaks, int most_runs) {
  return Shrinker(std::move(sequence), breaks, most_runs).shrink();
}

}  // namespace servodrome::motion
