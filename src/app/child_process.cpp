#include "app/child_process.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <string_view>
#include <sys/wait.h>
#include <unistd.h>

#include "app/commands.hpp"

extern char** environ;  // NOLINT(readability-redundant-declaration): not every C library declares it

namespace servodrome::app {
namespace {

std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

struct ChildProcess::Handle {
  pid_t group = 0;  // the child leads a process group
  std::optional<int> status;
};

ChildProcess::ChildProcess(const std::vector<std::string>& command,
                           const std::vector<std::pair<std::string, std::string>>& environment,
                           const std::filesystem::path& output)
    : handle_(std::make_unique<Handle>()) {
  std::vector<std::string> arguments = command;
  std::vector<std::string> variables;
  for (const auto& [name, value] : environment) variables.push_back(fmt::format("{}={}", name, value));
  for (char** variable = environ; *variable != nullptr; ++variable) {
    // A shell takes the last one of two variables with the same name.
    const std::string_view text = *variable;
    const std::string_view name = text.substr(0, text.find('='));
    const bool is_given =
        std::any_of(environment.begin(), environment.end(), [name](const auto& one) { return one.first == name; });
    if (!is_given) variables.emplace_back(text);
  }

  posix_spawn_file_actions_t files;
  ::posix_spawn_file_actions_init(&files);
  ::posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  ::posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  sigset_t defaults;
  ::sigemptyset(&defaults);
  ::sigaddset(&defaults, SIGPIPE);
  ::sigaddset(&defaults, SIGINT);
  ::posix_spawnattr_setsigdefault(&attributes, &defaults);
  ::posix_spawnattr_setpgroup(&attributes, 0);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF);
  const int error = ::posix_spawnp(&handle_->group, arguments.front().c_str(), &files, &attributes,
                                   pointers_to(arguments).data(), pointers_to(variables).data());
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&files);
  if (error != 0) {
    throw Failure::wrong_use(fmt::format("\"{}\" cannot be started: {}", command.front(), std::strerror(error)));
  }
}

ChildProcess::~ChildProcess() {
  if (poll()) return;
  kill();
  int status = 0;
  ::waitpid(handle_->group, &status, 0);
}

std::optional<int> ChildProcess::poll() {
  int status = 0;
  if (!handle_->status && ::waitpid(handle_->group, &status, WNOHANG) == handle_->group) {
    handle_->status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    ::kill(-handle_->group, SIGKILL);  // ends the programs that the child has started
  }
  return handle_->status;
}

void ChildProcess::terminate() { ::kill(-handle_->group, SIGTERM); }
void ChildProcess::kill() { ::kill(-handle_->group, SIGKILL); }

}  // namespace servodrome::app
