#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

// The words of a script's line, and the numbers in them.
namespace servodrome::master::script {

struct Word {
  std::string text;
  unsigned column;
  bool quoted = false;
};

// Thrown within a line; parsing continues with the next line.
struct LineMistake {
  unsigned column;
  std::string message;
};

std::string_view trimmed(std::string_view text);

// Replaces control characters, so that a binary file or another encoding cannot disturb the terminal.
std::string shown(std::string_view word);

// The words of a line without its comment. `end` becomes the position at which the comment, or the end of the line,
// begins. Throws LineMistake.
std::vector<Word> words_of(std::string_view line, std::size_t& end);

// Numbers. `what` names the number in messages. Throw LineMistake if the word is not one, or out of range.
double number_in(const Word& word, const char* what);
double seconds(const Word& word);
unsigned whole(const Word& word, const char* what, unsigned least, unsigned most);

}  // namespace servodrome::master::script
