#pragma once

#include <memory>
#include <string>

#include "describe/device_file.hpp"
#include "line/registry.hpp"
#include "plant/parameters.hpp"

namespace servodrome::line {

// Makes a product from a maker's description: an EDS or DCF, or the device named `device` of an ESI file. Throws
// describe::DeviceFileError.
std::shared_ptr<const Product> describe_product(const std::string& path, const std::string& device = {});

// Gives the plant the encoder resolution of the description, if the description has one.
void fit_encoder(const Product& product, plant::Parameters& plant);

}  // namespace servodrome::line
