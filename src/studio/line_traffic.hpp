#pragma once

#include <map>

#include "line/bench/buses.hpp"
#include "studio/traffic_source.hpp"

namespace servodrome::studio {

// A bus of a line.
class LineTraffic final : public TrafficSource {
 public:
  // Both must outlive this object.
  LineTraffic(line::Line& line, line::bench::AnyBus bus);

  const std::string& name() const override;
  Medium medium() const override;
  std::unique_ptr<line::TrafficTap> tap(line::TrafficRing& ring) override;
  std::string sender(std::uint32_t sender) const override;
  void introduce(TrafficDecoders& decoders) override;

 private:
  line::Line& line_;
  line::bench::AnyBus bus_;
  std::map<std::uint32_t, std::string> senders_;
};

}  // namespace servodrome::studio
