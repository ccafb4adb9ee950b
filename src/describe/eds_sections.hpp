#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>

// The text of an EDS or DCF file as sections of keys and values (CiA 306-1), before their meaning.
namespace servodrome::describe::eds_file {

std::string lower(std::string_view text);

// Without blanks and ends of lines on both sides.
std::string_view trim(std::string_view text);

// Removes a comment behind a number, although the standard permits only whole lines as comments.
std::string_view before_comment(std::string_view text);

struct Value {
  std::string text;
  unsigned line = 0;
};

struct Section {
  std::string name;  // as in the file
  unsigned line = 0;
  std::map<std::string, Value> values;  // keys in lower case

  const Value* find(const std::string& key) const {
    const auto found = values.find(key);
    return found != values.end() && !found->second.text.empty() ? &found->second : nullptr;
  }
};

using Sections = std::map<std::string, Section>;  // by name in lower case

// Calls `note` with the line and a description of each deviation that it accepts. Throws DeviceFileError, with the name
// `file`, if a section's name has no end, or for more sections and keys than any device has.
Sections read_sections(std::string_view text, const std::string& file,
                       const std::function<void(unsigned line, const std::string& what)>& note);

}  // namespace servodrome::describe::eds_file
