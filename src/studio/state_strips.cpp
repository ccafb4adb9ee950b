#include "studio/state_strips.hpp"

#include <array>
#include <fmt/format.h>

#include "drive/power/power_state.hpp"
#include "links/time.hpp"

namespace servodrome::studio {
namespace {

// The plot of scope::svg_of has the same width and margins.
constexpr double picture_width = 1000;
constexpr double plot_left = 96;
constexpr double plot_width = 880;
constexpr double strip_height = 18;
constexpr double strip_gap = 6;
constexpr double character_width = 6.2;  // a piece too narrow for its name has it as a tooltip only

struct Look {
  std::string_view colour;
  std::string name;
};

// By state: no motion possible is grey, enabled is green, faults are red.
Look look_of(int state) {
  constexpr std::array<std::string_view, 8> colours{"#d9d9d9", "#c8c8c8", "#b5cde3", "#8fb8de",
                                                    "#7cc58a", "#f0c05a", "#ef8a62", "#d6604d"};
  if (state < 0) return {"#ffffff", "no power"};
  return {colours[static_cast<std::size_t>(state)], drive::name(static_cast<drive::PowerState>(state))};
}

}  // namespace

std::string state_strips_of(const line::Line& line, const scenario::ShaftLog& log) {
  const std::size_t rows = log.times().size();
  if (rows < 2) return {};
  const auto axes = static_cast<double>(line.axes().size());
  const double height = axes * (strip_height + strip_gap);
  std::string text = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:g}\" height=\"{1:g}\" viewBox=\"0 0 {0:g} {1:g}\" "
      "font-family=\"sans-serif\" font-size=\"11\" fill=\"#222222\">\n",
      picture_width, height);
  const auto span = links::to_seconds(log.times().back() - log.times().front());
  const auto x_of = [&](std::size_t row) {
    return plot_left + links::to_seconds(log.times()[row] - log.times().front()) / span * plot_width;
  };
  for (std::size_t axis = 0; axis < line.axes().size(); ++axis) {
    const double top = static_cast<double>(axis) * (strip_height + strip_gap);
    text += fmt::format("<text x=\"{:g}\" y=\"{:g}\" text-anchor=\"end\">{}</text>\n", plot_left - 8, top + 13,
                        line.axes()[axis]->settings().name);
    for (std::size_t begin = 0; begin + 1 < rows;) {
      const int state = log.sample(begin, axis).state;
      std::size_t end = begin + 1;
      while (end + 1 < rows && log.sample(end, axis).state == state) ++end;
      const Look look = look_of(state);
      const double piece = x_of(end) - x_of(begin);
      text += fmt::format(
          "<rect x=\"{:.2f}\" y=\"{:g}\" width=\"{:.2f}\" height=\"{:g}\" fill=\"{}\" stroke=\"#888888\" "
          "stroke-width=\".5\"><title>{} from {:.3f} s</title></rect>\n",
          x_of(begin), top, piece, strip_height, look.colour, look.name, links::to_seconds(log.times()[begin]));
      if (piece > character_width * static_cast<double>(look.name.size())) {
        text += fmt::format("<text x=\"{:.2f}\" y=\"{:g}\" pointer-events=\"none\">{}</text>\n", x_of(begin) + 4,
                            top + 13, look.name);
      }
      begin = end;
    }
  }
  return text + "</svg>\n";
}

}  // namespace servodrome::studio
