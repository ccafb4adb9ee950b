#pragma once

#include <memory>
#include <string>

#include "describe/device_file.hpp"
#include "line/registry.hpp"
#include "plant/parameters.hpp"

namespace servodrome::line {

// A product out of a maker's description: an EDS or DCF, or a device of an ESI file. Throws describe::DeviceFileError.
std::shared_ptr<const Product> describe_product(const std::string& path, const std::string& device = {});

// The plant has the encoder that the description tells of, if it does.
void fit_encoder(const Product& product, plant::Parameters& plant);

}  // namespace servodrome::line
