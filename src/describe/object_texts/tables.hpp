#pragma once

#include "describe/object_texts.hpp"

// One file for each maker whose objects are explained.
namespace servodrome::describe {

std::span<const ObjectText> ismk_object_texts();

}  // namespace servodrome::describe
