#pragma once

#include <string>

namespace servodrome::app {

// The folder of the studio's page: the wanted one, otherwise the one beside this program, in the build folder or as
// installed. Empty: not found. Throws Failure if the wanted folder has no page.
std::string page_folder(const std::string& wanted);

}  // namespace servodrome::app
