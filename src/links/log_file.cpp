#include "links/log_file.hpp"

namespace servodrome::links {

std::FILE* open_log_file(const std::string& path) { return std::fopen(path.c_str(), "wb"); }

}  // namespace servodrome::links
