#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace servodrome::app {

// A child process, and the programs that it starts itself and leaves in its process group. The destructor kills the
// whole group.
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

  // Returns the exit status when the child has ended, 128 + signal if a signal killed it; nothing while it runs. When
  // the child has ended, kills the rest of its process group.
  std::optional<int> poll();
  // terminate() asks the whole group to end (SIGTERM); kill() kills it.
  void terminate();
  void kill();

 private:
  struct Handle;
  std::unique_ptr<Handle> handle_;
};

}  // namespace servodrome::app
