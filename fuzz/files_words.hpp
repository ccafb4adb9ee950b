#pragma once

#include "parsers.hpp"

namespace servodrome::fuzz {

// Takes any bytes as a text that a user writes into an option or a form: the first byte selects a trigger, a link name,
// an object, a value, a channel, a column, keys, or a word.
void read_words(Bytes input);

}  // namespace servodrome::fuzz
