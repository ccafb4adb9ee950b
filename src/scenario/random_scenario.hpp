#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace servodrome::scenario {

// The text of a scenario that combines the rules of two or three scenario files of the same line; `seed` and `number`
// determine the choice. The names of its rules begin with the name of their file. It has no expectations of its own:
// the standard expectations of every trial apply. The caller writes the text into `folder`: the path of the line file
// starts there. Throws std::runtime_error if a file cannot be read or has errors.
std::string random_scenario(const std::vector<std::string>& files, std::uint64_t seed, std::uint64_t number,
                            const std::filesystem::path& folder);

}  // namespace servodrome::scenario
