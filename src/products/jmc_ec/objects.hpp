#pragma once

#include "dictionary/entry.hpp"
#include "drive/objects.hpp"
#include "ethercat/slave/communication_objects.hpp"
#include "products/jmc_ec/monitor.hpp"
#include "products/jmc_ec/panel_objects.hpp"

// The values behind the object dictionary of the JMC EC drives.
namespace servodrome::products::jmc_ec {

// Objects that drive::Objects lacks, or has with another type or meaning.
struct Own {
  dictionary::Blob<24> device_name{};       // 1008h
  std::int32_t torque_offset = 0;           // 60B2h, wider than CiA 402's; 0.1 % of rated torque
  std::int32_t min_position_change = -100;  // 607Bh sub 1; not a position range, see README D-15
  std::int32_t max_position_change = 100;   // 607Bh sub 2
};

struct Objects {
  ethercat::CommunicationObjects<4, 4, 12, 4> communication{};
  drive::Objects drive{};
  Own own{};
  Panel panel{};
  MonitorObjects monitor{};
};

}  // namespace servodrome::products::jmc_ec
