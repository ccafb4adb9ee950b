#include "app/child_process.hpp"

#include "app/commands.hpp"

namespace servodrome::app {

struct ChildProcess::Handle {};

ChildProcess::ChildProcess(const std::vector<std::string>& /*command*/,
                           const std::vector<std::pair<std::string, std::string>>& /*environment*/,
                           const std::filesystem::path& /*output*/) {
  throw Failure::wrong_use("trials need Linux: this program starts no other programs on Windows");
}

ChildProcess::~ChildProcess() = default;
std::optional<int> ChildProcess::poll() { return std::nullopt; }
void ChildProcess::terminate() {}
void ChildProcess::kill() {}

}  // namespace servodrome::app
