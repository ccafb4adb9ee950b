#pragma once

#include "api/scope/source.hpp"
#include "line/bench/api_names.hpp"
#include "line/bench/scope/tap_table.hpp"
#include "line/line.hpp"

namespace servodrome::line::bench {

// The axes of a line as a source of samples in every tick.
class LineSource final : public api::Source {
 public:
  // The line must outlive the source and all channels that the source returned. `epoch` returns the wall-clock time of
  // the line's time 0; without it wall_epoch() is 0.
  explicit LineSource(Line& line, std::function<Time()> epoch = {}) : line_(line), epoch_(std::move(epoch)) {}

  std::int64_t tick() const override { return line_.now() / tick_length; }
  Time wall_epoch() const override { return epoch_ ? epoch_() : Time{}; }
  std::vector<std::string> axes() const override;
  api::NamedChannel signal(const std::string& axis, std::string_view name) override { return signal(find(axis), name); }
  api::NamedChannel object(const std::string& axis, std::uint16_t index, std::uint8_t sub) override {
    return object(find(axis), index, sub);
  }
  std::int64_t stride_of(double rate_hz, const std::vector<api::NamedChannel>& channels) const override;
  std::int64_t trigger_stride(std::int64_t) const override { return 1; }
  std::vector<Json> views() override;
  Json clock() override;

  api::NamedChannel signal(Axis& axis, std::string_view name);                  // throws ApiError
  api::NamedChannel object(Axis& axis, std::uint16_t index, std::uint8_t sub);  // throws ApiError

  TapTable& taps() { return taps_; }

 private:
  Axis& find(std::string_view name) const;
  api::NamedChannel channel(const Channel& channel, Json view);

  Line& line_;
  std::function<Time()> epoch_;
  TapTable taps_;
};

}  // namespace servodrome::line::bench
