#include "app/shell_completion.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace servodrome::app {
namespace {

using Value = CommandArgument::Value;

// Removes the characters `without`, so that the description can stand in single quotes in any of the three shells.
std::string quotable(const std::string& text, const char* without) {
  std::string kept;
  for (const char c : text) {
    if (std::string_view(without).find(c) == std::string_view::npos) kept += c;
  }
  return kept;
}

// "servodrome move:--to|servodrome move:--by": a `case` pattern of the options for which `wanted` returns true.
template <typename Wanted>
std::string pattern_of_options(const CommandNode& node, Wanted wanted) {
  std::string pattern;
  for (const CommandArgument& option : node.options) {
    if (!wanted(option)) continue;
    for (const std::string& name : option.names) {
      pattern += fmt::format("{}\"{}:{}\"", pattern.empty() ? "" : "|", node.path, name);
    }
  }
  return pattern;
}

bool takes_file(const CommandArgument& option) { return option.value == Value::text && option.choices.empty(); }
bool takes_number(const CommandArgument& option) { return option.value == Value::number && option.choices.empty(); }

// The lines of a `case` over "COMMAND:PREVIOUS WORD" in bash and zsh; `words`, `files` and `nothing` are their actions.
std::string cases_of_values(const CommandNode& root, const char* words, const char* files, const char* nothing) {
  std::string lines;
  const auto add = [&lines](const std::string& pattern, const std::string& action) {
    if (!pattern.empty()) lines += fmt::format("    {})\n      {}\n      return ;;\n", pattern, action);
  };
  for (const CommandNode* node : all_commands(root)) {
    for (const CommandArgument& option : node->options) {
      if (option.choices.empty()) continue;
      const auto is_it = [&option](const CommandArgument& one) { return &one == &option; };
      add(pattern_of_options(*node, is_it), fmt::format(fmt::runtime(words), fmt::join(option.choices, " ")));
    }
    add(pattern_of_options(*node, takes_file), files);
    add(pattern_of_options(*node, takes_number), nothing);
  }
  return lines;
}

// The pattern "servodrome params"|"servodrome params save"|...
std::string pattern_of_commands(const CommandNode& root) {
  std::string pattern;
  for (const CommandNode* node : all_commands(root)) {
    if (node != &root) pattern += fmt::format("{}\"{}\"", pattern.empty() ? "" : "|", node->path);
  }
  return pattern;
}

struct Candidate {
  std::string word;
  std::string description;
};

// What may follow a command in bash and zsh: its subcommands, the choices of its positional arguments, its options.
std::vector<Candidate> candidates_of(const CommandNode& node) {
  std::vector<Candidate> candidates;
  for (const CommandNode& command : node.commands) candidates.push_back({command.name, command.description});
  for (const CommandArgument& positional : node.positionals) {
    for (const std::string& choice : positional.choices) candidates.push_back({choice, positional.names.back()});
  }
  for (const CommandArgument& option : node.options) {
    for (const std::string& name : option.names) candidates.push_back({name, option.description});
  }
  return candidates;
}

// The assignment in bash and zsh that makes them complete file names too.
const char* files_assignment(const CommandNode& node) {
  return std::any_of(node.positionals.begin(), node.positionals.end(), takes_file) ? " files=1" : "";
}

}  // namespace

std::string bash_completion(const CommandNode& root) {
  std::string script =
      "# bash completion of servodrome, as `servodrome completion bash` writes it\n"
      "_servodrome() {\n"
      "  local current=${COMP_WORDS[COMP_CWORD]} command=servodrome words= files= i\n"
      "  COMPREPLY=()\n"
      "  for ((i = 1; i < COMP_CWORD; i++)); do\n";
  script += fmt::format("    case \"$command ${{COMP_WORDS[i]}}\" in\n      {}) command+=\" ${{COMP_WORDS[i]}}\" ;;\n",
                        pattern_of_commands(root));
  script += "    esac\n  done\n  case \"$command:${COMP_WORDS[COMP_CWORD - 1]}\" in\n";
  script += cases_of_values(root, "COMPREPLY=($(compgen -W \"{}\" -- \"$current\"))",
                            "compopt -o filenames 2>/dev/null; COMPREPLY=($(compgen -f -- \"$current\"))", ":");
  script += "  esac\n  case \"$command\" in\n";
  for (const CommandNode* node : all_commands(root)) {
    std::string words;
    for (const Candidate& candidate : candidates_of(*node)) words += (words.empty() ? "" : " ") + candidate.word;
    script += fmt::format("    \"{}\") words=\"{}\"{} ;;\n", node->path, words, files_assignment(*node));
  }
  script +=
      "  esac\n"
      "  COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
      "  if [[ -n $files && $current != -* ]]; then\n"
      "    compopt -o filenames 2>/dev/null\n"
      "    COMPREPLY+=($(compgen -f -- \"$current\"))\n"
      "  fi\n"
      "}\n"
      "complete -F _servodrome servodrome\n";
  return script;
}

std::string zsh_completion(const CommandNode& root) {
  std::string script =
      "#compdef servodrome\n"
      "# zsh completion of servodrome, as `servodrome completion zsh` writes it\n"
      "_servodrome() {\n"
      "  local command=servodrome word files=\n"
      "  local -a candidates\n"
      "  for word in \"${(@)words[2,CURRENT-1]}\"; do\n";
  script += fmt::format("    case \"$command $word\" in\n      {}) command+=\" $word\" ;;\n    esac\n  done\n",
                        pattern_of_commands(root));
  script += "  case \"$command:${words[CURRENT-1]}\" in\n";
  script += cases_of_values(root, "compadd -- {}", "_files", ":");
  script += "  esac\n  case \"$command\" in\n";
  for (const CommandNode* node : all_commands(root)) {
    std::string candidates;
    for (const Candidate& one : candidates_of(*node)) {
      candidates += fmt::format("      '{}:{}'\n", one.word, quotable(one.description, "'"));
    }
    script += fmt::format("    \"{}\")\n      candidates=(\n{}      ){} ;;\n", node->path, candidates,
                          files_assignment(*node));
  }
  script +=
      "  esac\n"
      "  _describe -t commands servodrome candidates\n"
      "  [[ -n $files ]] && _files\n"
      "}\n"
      "_servodrome \"$@\"\n";
  return script;
}

std::string fish_completion(const CommandNode& root) {
  std::string script =
      "# fish completion of servodrome, as `servodrome completion fish` writes it\n"
      "function __servodrome_at\n"
      "  set -l path servodrome\n"
      "  for word in (commandline -opc)[2..-1]\n"
      "    contains -- \"$path $word\" $__servodrome_commands\n"
      "    and set path \"$path $word\"\n"
      "  end\n"
      "  test \"$path\" = \"$argv[1]\"\n"
      "end\n"
      "set -g __servodrome_commands";
  for (const CommandNode* node : all_commands(root)) {
    if (node != &root) script += fmt::format(" '{}'", node->path);
  }
  script += "\ncomplete -c servodrome -f\n";
  for (const CommandNode* node : all_commands(root)) {
    const auto add = [&](const std::string& what, const std::string& text) {
      script += fmt::format("complete -c servodrome -n '__servodrome_at \"{}\"' {} -d '{}'\n", node->path, what,
                            quotable(text, "'\\"));
    };
    for (const CommandNode& command : node->commands) add("-a " + command.name, command.description);
    for (const CommandArgument& positional : node->positionals) {
      if (takes_file(positional)) add("-F", positional.description);
      if (!positional.choices.empty()) {
        add(fmt::format("-a '{}'", fmt::join(positional.choices, " ")), positional.names.back());
      }
    }
    for (const CommandArgument& option : node->options) {
      std::string what;
      for (const std::string& name : option.names) {
        what += name.starts_with("--") ? fmt::format(" -l {}", name.substr(2)) : fmt::format(" -s {}", name.substr(1));
      }
      if (!option.choices.empty()) {
        what += fmt::format(" -x -a '{}'", fmt::join(option.choices, " "));
      } else if (option.value != Value::none) {
        what += takes_file(option) ? " -r -F" : " -x";
      }
      add(what.substr(1), option.description);
    }
  }
  return script;
}

}  // namespace servodrome::app
