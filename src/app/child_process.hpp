#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace servodrome::app {

// A program that this one starts, with the programs that it starts in turn and leaves in its process group. The
// destructor kills them.
class ChildProcess {
 public:
  // `environment` is added to that of this process, and replaces variables of the same name. Standard output and
  // standard error go to the file `output`. Throws Failure if the program cannot be started.
  ChildProcess(const std::vector<std::string>& command,
               const std::vector<std::pair<std::string, std::string>>& environment,
               const std::filesystem::path& output);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  // Returns the exit status when the program has ended, 128 + signal if a signal killed it; nothing while it runs.
  std::optional<int> poll();
  // Asks the program to end (SIGTERM), or kills it.
  void terminate();
  void kill();

 private:
  struct Handle;
  std::unique_ptr<Handle> handle_;
};

}  // namespace servodrome::app
