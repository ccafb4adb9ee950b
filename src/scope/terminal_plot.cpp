#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

#include "scope/files.hpp"

namespace servodrome::scope {

namespace {

// A braille character is U+2800 plus a bit for each of its 2 by 4 dots.
constexpr std::array<std::array<std::uint8_t, 4>, 2> braille_dots{{{0x01, 0x02, 0x04, 0x40}, {0x08, 0x10, 0x20, 0x80}}};
constexpr unsigned dots_across = 2;
constexpr unsigned dots_down = 4;

std::string braille_character(std::uint8_t dots) {
  const unsigned code = 0x2800U + dots;
  return {static_cast<char>(0xE0U | code >> 12U), static_cast<char>(0x80U | (code >> 6U & 0x3FU)),
          static_cast<char>(0x80U | (code & 0x3FU))};
}

class DotCanvas {
 public:
  DotCanvas(unsigned columns, unsigned rows) : columns_(columns), rows_(rows), dots_(columns * rows) {}
  void set(unsigned x, unsigned y) {
    if (x >= columns_ * dots_across || y >= rows_ * dots_down) return;
    dots_[y / dots_down * columns_ + x / dots_across] |= braille_dots[x % dots_across][y % dots_down];
  }
  std::string row(unsigned y) const {
    std::string text;
    for (unsigned x = 0; x < columns_; ++x) text += braille_character(dots_[y * columns_ + x]);
    return text;
  }

 private:
  unsigned columns_, rows_;
  std::vector<std::uint8_t> dots_;
};

constexpr unsigned scale_characters = 12;

std::string panel_plot(const Recording& recording, std::size_t channel, unsigned columns, unsigned rows) {
  double least = recording.value(0, channel);
  double greatest = least;
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    least = std::min(least, recording.value(row, channel));
    greatest = std::max(greatest, recording.value(row, channel));
  }
  DotCanvas canvas(columns, rows);
  const double first = recording.seconds(0, channel);
  const double span = std::max(recording.seconds(recording.rows() - 1, channel) - first, 1e-9);
  const double height = greatest - least;
  unsigned before = 0;
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    const double along = (recording.seconds(row, channel) - first) / span;
    const double part = height > 0 ? (greatest - recording.value(row, channel)) / height : 0.5;
    const auto x = static_cast<unsigned>(std::lround(along * (columns * dots_across - 1)));
    const auto y = static_cast<unsigned>(std::lround(part * (rows * dots_down - 1)));
    // Fills the dots in between if the line is steeper than one dot.
    const unsigned from = row == 0 ? y : before;
    for (unsigned dot = std::min(from, y); dot <= std::max(from, y); ++dot) canvas.set(x, dot);
    before = y;
  }
  const Channel& what = recording.channels[channel];
  std::string text = what.unit.empty() ? what.name : fmt::format("{} [{}]", what.name, what.unit);
  text += '\n';
  for (unsigned row = 0; row < rows; ++row) {
    const std::string scale = row == 0 ? text_of_number(greatest) : row + 1 == rows ? text_of_number(least) : "";
    text += fmt::format("{:>{}} {}\n", scale, scale_characters, canvas.row(row));
  }
  return text;
}

}  // namespace

std::string terminal_plot_of(const Recording& recording, unsigned columns, unsigned rows) {
  if (recording.rows() == 0) return "";
  std::string text;
  for (std::size_t channel = 0; channel < recording.channels.size(); ++channel) {
    text += panel_plot(recording, channel, columns, rows);
  }
  const std::string begin = fmt::format("{:.4g} s", recording.seconds(0, 0));
  const std::string end = fmt::format("{:.4g} s", recording.seconds(recording.rows() - 1, 0));
  const unsigned gap = columns > begin.size() + end.size() ? columns - static_cast<unsigned>(begin.size()) : 0;
  return text + fmt::format("{:>{}} {}{:>{}}\n", "", scale_characters, begin, end, gap);
}

}  // namespace servodrome::scope
