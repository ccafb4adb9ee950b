#pragma once

#include "api/routes.hpp"
#include "studio/real_drives.hpp"
#include "studio/traffic_source.hpp"

namespace servodrome::studio {

// Finds the bus of real drives that the first argument of a call names, as in --bus. Throws ApiError 404.
std::unique_ptr<TrafficSource> find_real_traffic(RealDrives& drives, const api::Call& call);

}  // namespace servodrome::studio
