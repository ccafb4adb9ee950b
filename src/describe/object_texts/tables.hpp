#pragma once

#include "describe/object_texts.hpp"

// One file for each maker whose objects have texts.
namespace servodrome::describe {

std::span<const ObjectText> generic402_object_texts();
std::span<const ObjectText> ismc_object_texts();
std::span<const ObjectText> ismk_object_texts();
std::span<const ObjectText> jmc_ec_object_texts();
std::span<const ObjectText> pronet_object_texts();

}  // namespace servodrome::describe
