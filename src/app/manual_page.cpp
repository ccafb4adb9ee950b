#include "app/manual_page.hpp"

#include <fmt/format.h>

#include "api/version.hpp"

namespace servodrome::app {
namespace {

// Escapes a text for roff: a literal hyphen is \-; a dot or an apostrophe at the start of a line would begin a macro.
std::string roff(const std::string& text) {
  std::string escaped;
  if (text.starts_with('.') || text.starts_with('\'')) escaped = "\\&";
  for (const char c : text) {
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string manual_head_of(const CommandArgument& argument) {
  std::string head;
  for (const std::string& name : argument.names) {
    head += fmt::format("{}\\fB{}\\fR", head.empty() ? "" : ", ", roff(name));
  }
  if (const std::string value = argument.value_text(); !value.empty() && argument.names.back().starts_with("-")) {
    head += fmt::format(" \\fI{}\\fR", roff(value));
  }
  return head;
}

std::string text_of_arguments(const std::vector<CommandArgument>& arguments) {
  std::string text;
  for (const CommandArgument& argument : arguments) {
    if (argument.names.back() == "--help") continue;  // described once, above
    std::string description = roff(argument.description);
    if (argument.required && argument.names.back().starts_with("-")) description += " (required)";
    if (!argument.default_value.empty()) description += fmt::format(" (default: {})", roff(argument.default_value));
    text += fmt::format(".TP\n{}\n{}.\n", manual_head_of(argument), description);
  }
  return text;
}

constexpr const char* exit_status_section = R"(.SH EXIT STATUS
.TP
\fB0\fR
Success.
.TP
\fB1\fR
Failure; standard error shows what happened, where, and what to do.
.TP
\fB2\fR
Wrong use: nothing was done.
.TP
\fB130\fR, \fB143\fR, \fB129\fR
Ended by Ctrl\-C, SIGTERM or the end of the terminal; an axis that moved has been stopped.
)";
constexpr const char* environment_section = R"(.SH ENVIRONMENT
.TP
\fBSERVODROME_TOKEN\fR
The token that other computers need to write over the API of \fBservodrome up\fR and \fBservodrome studio\fR.
.TP
\fBSERVODROME_STUDIO\fR
Folder with the web page that \fBservodrome up\fR and \fBservodrome studio\fR serve.
)";

}  // namespace

std::string manual_page(const CommandNode& root) {
  std::string page = fmt::format(
      ".TH SERVODROME 1 \"\" \"servodrome {}\" \"User Commands\"\n.SH NAME\nservodrome \\- {}\n.SH SYNOPSIS\n.B "
      "servodrome\n\\fICOMMAND\\fR [OPTIONS]\n"
      ".SH DESCRIPTION\n{}\n.PP\n\\fBservodrome\\fR \\fICOMMAND\\fR \\fB\\-\\-help\\fR shows a command's options.\n"
      ".SH COMMANDS\n",
      roff(api::version()), roff("software servo drives and the tools to commission them"), roff(root.description));
  for (const CommandNode* command : all_commands(root)) {
    if (command == &root) continue;
    page += fmt::format(".SS {} {}\n{}.\n", roff(command->path), roff(usage_of(*command)), roff(command->description));
    page += text_of_arguments(command->positionals);
    page += text_of_arguments(command->options);
  }
  return page + exit_status_section + environment_section;
}

}  // namespace servodrome::app
