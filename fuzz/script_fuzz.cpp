// Parses any text as a motion script: the result is a script or a list of errors with positions within the text.
#include <algorithm>
#include <cstdlib>

#include "tools/script/script.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace servodrome::master;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) + 1;
  try {
    const script::Script script = script::parse(text, "fuzz", ObjectCatalogue::standard());
    if (script.axes.empty() || script.count_steps() > lines) std::abort();
  } catch (const script::ScriptMistakes& mistakes) {
    if (mistakes.mistakes().empty()) std::abort();
    for (const script::Mistake& mistake : mistakes.mistakes()) {
      if (mistake.place.line == 0 || mistake.place.line > lines || mistake.place.column == 0) std::abort();
    }
  }
  return 0;
}
