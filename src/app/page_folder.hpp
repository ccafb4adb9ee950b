#pragma once

#include <string>

namespace servodrome::app {

// Where the studio's page is: what was asked for, or beside this program: in the build folder it was built into, or
// where it was installed. Empty: nowhere. Throws Failure when what was asked for is none.
std::string page_folder(const std::string& wanted);

}  // namespace servodrome::app
