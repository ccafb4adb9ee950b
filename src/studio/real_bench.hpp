#pragma once

#include "api/bench.hpp"
#include "studio/real_drives.hpp"

namespace servodrome::studio {

// The bench API for drives on buses. It asks the drives over their buses, while a line reads the answers from its
// virtual drives. It has no plant, no inputs, no power switch, no fault injection, and real time only.
class RealBench final : public api::Bench {
 public:
  using Call = api::Call;
  using Json = api::Json;

  // `drives` must outlive this object.
  explicit RealBench(RealDrives& drives) : drives_(drives) {}

  Json show_line(Call& call) override;
  Json list_axes(Call& call) override;
  Json show_axis(Call& call) override;
  Json show_states(Call& call) override;
  Json show_homing(Call& call) override;
  Json list_objects(Call& call) override;
  Json read_object(Call& call) override;
  Json write_object(Call& call) override;
  Json read_values(Call& call) override;
  Json show_faults(Call& call) override;
  Json list_buses(Call& call) override;
  Json show_bus(Call& call) override;
  Json scan_bus(Call& call) override;
  Json show_clock(Call& call) override;

 private:
  RealDrives& drives_;
};

// Returns the index of the bus that the first argument of a call names. Throws ApiError 404.
std::size_t bus_argument(const RealDrives& drives, const api::Call& call);

}  // namespace servodrome::studio
