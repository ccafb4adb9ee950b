#pragma once

#include <string>

namespace servodrome::app {

// The folder of the studio's page: `wanted`, else that of $SERVODROME_STUDIO, else the one that belongs to this program
// in its build folder or installation. Empty: not found. Throws Failure if `wanted` or the folder of the variable has
// no page.
std::string page_folder(const std::string& wanted);

}  // namespace servodrome::app
