#pragma once

#include <filesystem>
#include <string>

#include "api/scope/recordings.hpp"

// The recordings of a project: ID.csv has the samples, ID.json all the rest. The JSON file is written last and deleted
// first: without it there is no recording.
namespace servodrome::studio {

// Adds the recordings of a folder: the newest that fit into the memory of the server. The numbers of new recordings are
// above those of all files. Throws ProjectError for a file that is wrong.
void load_recordings(const std::filesystem::path& folder, api::Recordings& recordings);

// The content of the two files. `recording` has ended.
std::string about_text(const api::Recording& recording);
std::string samples_text(std::shared_ptr<const api::Recording> recording);

}  // namespace servodrome::studio
