#include "described/can_drive.hpp"

namespace servodrome::described {

CanDrive::CanDrive(std::shared_ptr<const Blueprint> blueprint, const products::Settings& settings)
    : CanDevice(settings, {blueprint->table, blueprint->table, blueprint->policy, blueprint->object_bytes},
                blueprint->can),
      blueprint_(std::move(blueprint)) {}

}  // namespace servodrome::described
