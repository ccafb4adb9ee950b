#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

#include "scope/files.hpp"

namespace servodrome::scope {

namespace {

// Pixels.
constexpr double svg_width = 1000;
constexpr double svg_left = 96;
constexpr double svg_right = 24;
constexpr double svg_top = 56;
constexpr double svg_panel = 190;
constexpr double svg_gap = 44;  // between panels, including the legend of the lower panel
constexpr double svg_bottom = 56;
constexpr double svg_plot_width = svg_width - svg_left - svg_right;

// Colours that colour-blind readers can distinguish (Okabe and Ito), without yellow.
constexpr std::array<std::string_view, 7> svg_colours{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                      "#56b4e9", "#e69f00", "#000000"};

std::string svg_text(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '<': escaped += "&lt;"; break;
      case '>': escaped += "&gt;"; break;
      case '&': escaped += "&amp;"; break;
      case '"': escaped += "&quot;"; break;
      default: escaped += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return escaped;
}

// With as many decimals as the step has; -0 becomes 0.
std::string tick_text(double value, double step) {
  const int digits = std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 12);
  return fmt::format("{:.{}f}", value == 0 ? 0.0 : value, digits);
}

struct Range {
  double least = 0;
  double greatest = 1;
  void take(double value) {
    least = std::min(least, value);
    greatest = std::max(greatest, value);
  }
  double span() const { return greatest - least; }
};

class SvgWriter {
 public:
  explicit SvgWriter(const Recording& recording) : recording_(recording), panels_(panels_of(recording.channels)) {
    if (recording_.rows() == 0) return;
    time_ = {recording_.seconds(0, 0), recording_.seconds(0, 0)};
    for (const std::size_t row : {std::size_t{0}, recording_.rows() - 1}) {
      for (std::size_t i = 0; i < recording_.channels.size(); ++i) time_.take(recording_.seconds(row, i));
    }
    if (time_.span() <= 0) time_.greatest = time_.least + 1e-3;
  }

  std::string write() {
    const auto count = static_cast<double>(panels_.size());
    const double height = svg_top + count * (svg_panel + svg_gap) - svg_gap / 2 + svg_bottom;
    text_ = fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:g}\" height=\"{1:g}\" viewBox=\"0 0 {0:g} {1:g}\" "
        "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        "<text x=\"{2:g}\" y=\"22\" font-size=\"14\" fill=\"#222222\">{3}</text>\n",
        svg_width, height, svg_left, svg_text(title()));
    for (std::size_t i = 0; i < panels_.size(); ++i) {
      write_panel(panels_[i], svg_top + static_cast<double>(i) * (svg_panel + svg_gap), i + 1 == panels_.size());
    }
    text_ += "</svg>\n";
    return text_;
  }

 private:
  std::string title() const {
    return fmt::format("{}: {} samples, {:.4g} Hz, {}{}", recording_.source, recording_.rows(), recording_.rate_hz(),
                       recording_.way,
                       recording_.missed != 0 ? fmt::format(", {} samples missed", recording_.missed) : "");
  }

  double x_of(double seconds) const { return svg_left + (seconds - time_.least) / time_.span() * svg_plot_width; }

  void write_panel(const std::vector<std::size_t>& channels, double top, bool last) {
    Range range{recording_.rows() == 0 ? 0 : recording_.value(0, channels[0]), 0};
    range.greatest = range.least;
    for (const std::size_t channel : channels) {
      for (std::size_t row = 0; row < recording_.rows(); ++row) range.take(recording_.value(row, channel));
    }
    // Margin above and below; a constant line is drawn in the middle.
    const double room = range.span() > 0 ? 0.06 * range.span() : std::max(1.0, 0.01 * std::abs(range.least));
    range = {range.least - room, range.greatest + room};
    const auto y_of = [&](double value) { return top + (range.greatest - value) / range.span() * svg_panel; };

    write_grid(range, y_of, top, last, recording_.channels[channels[0]].unit);
    double legend = svg_left;
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const std::string_view colour = svg_colours[i % svg_colours.size()];
      const std::string& name = recording_.channels[channels[i]].name;
      text_ += fmt::format(
          "<line x1=\"{0:g}\" y1=\"{1:g}\" x2=\"{2:g}\" y2=\"{1:g}\" stroke=\"{3}\" stroke-width=\"3\"/>"
          "<text x=\"{4:g}\" y=\"{5:g}\" fill=\"#222222\">{6}</text>\n",
          legend, top - 10, legend + 18, colour, legend + 24, top - 6, svg_text(name));
      legend += 50 + 7.2 * static_cast<double>(name.size());
      write_line(channels[i], colour, y_of);
    }
    if (recording_.triggered) {
      text_ += fmt::format(
          "<line x1=\"{0:.2f}\" y1=\"{1:g}\" x2=\"{0:.2f}\" y2=\"{2:g}\" stroke=\"#555555\" "
          "stroke-dasharray=\"4 3\"/>\n",
          x_of(0), top, top + svg_panel);
    }
  }

  template <typename ToY>
  void write_grid(const Range& range, const ToY& y_of, double top, bool last, const std::string& unit) {
    const double bottom = top + svg_panel;
    const Ticks seconds = round_ticks(time_.least, time_.greatest, 10);
    for (const double at : seconds.at) {
      text_ += fmt::format("<line x1=\"{0:.2f}\" y1=\"{1:g}\" x2=\"{0:.2f}\" y2=\"{2:g}\" stroke=\"#e4e4e4\"/>\n",
                           x_of(at), top, bottom);
      if (!last) continue;
      text_ += fmt::format("<text x=\"{:.2f}\" y=\"{:g}\" text-anchor=\"middle\" fill=\"#444444\">{}</text>\n",
                           x_of(at), bottom + 18, tick_text(at, seconds.step));
    }
    const Ticks values = round_ticks(range.least, range.greatest, 5);
    for (const double at : values.at) {
      text_ += fmt::format(
          "<line x1=\"{0:g}\" y1=\"{1:.2f}\" x2=\"{2:g}\" y2=\"{1:.2f}\" stroke=\"#e4e4e4\"/>"
          "<text x=\"{3:g}\" y=\"{4:.2f}\" text-anchor=\"end\" fill=\"#444444\">{5}</text>\n",
          svg_left, y_of(at), svg_left + svg_plot_width, svg_left - 8, y_of(at) + 4, tick_text(at, values.step));
    }
    text_ +=
        fmt::format("<rect x=\"{:g}\" y=\"{:g}\" width=\"{:g}\" height=\"{:g}\" fill=\"none\" stroke=\"#888888\"/>\n",
                    svg_left, top, svg_plot_width, svg_panel);
    if (!unit.empty()) {
      text_ += fmt::format(
          "<text transform=\"translate(18 {:g}) rotate(-90)\" text-anchor=\"middle\" fill=\"#222222\">{}</text>\n",
          top + svg_panel / 2, svg_text(unit));
    }
    if (last) {
      text_ += fmt::format("<text x=\"{:g}\" y=\"{:g}\" text-anchor=\"middle\" fill=\"#222222\">{}</text>\n",
                           svg_left + svg_plot_width / 2, bottom + 38,
                           recording_.triggered ? "seconds from the trigger" : "seconds");
    }
  }

  // With more samples than pixels, draws each pixel's least and greatest value, so that no peak is lost. A value is
  // held until the next one; the line is interrupted where samples are missing.
  template <typename ToY>
  void write_line(std::size_t channel, std::string_view colour, const ToY& y_of) {
    std::string points;
    const auto end_line = [&] {
      if (points.empty()) return;
      text_ += fmt::format(
          "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\" stroke-linejoin=\"round\" points=\"{}\"/>\n",
          colour, points);
      points.clear();
    };
    const auto put = [&](double x, double value) {
      points += fmt::format("{}{:.2f},{:.2f}", points.empty() ? "" : " ", x, y_of(value));
    };
    const Time longest = recording_.period * 5 / 2;
    const std::size_t rows = recording_.rows();
    for (std::size_t row = 0; row < rows;) {
      const double x = x_of(recording_.seconds(row, channel));
      double least = recording_.value(row, channel);
      double greatest = least;
      std::size_t last = row;
      bool rising = true;
      while (last + 1 < rows && x_of(recording_.seconds(last + 1, channel)) - x < 0.5) {
        ++last;
        const double value = recording_.value(last, channel);
        if (value < least) rising = false;
        if (value > greatest) rising = true;
        least = std::min(least, value);
        greatest = std::max(greatest, value);
      }
      put(x, rising ? least : greatest);
      if (greatest > least) put(x, rising ? greatest : least);
      row = last + 1;
      const bool gap = row < rows && recording_.period > Time{0} &&
                       recording_.time(row, channel) - recording_.time(last, channel) > longest;
      if (gap) end_line();
    }
    end_line();
  }

  const Recording& recording_;
  std::vector<std::vector<std::size_t>> panels_;
  Range time_{};
  std::string text_;
};

}  // namespace

std::string svg_of(const Recording& recording) { return SvgWriter(recording).write(); }

}  // namespace servodrome::scope
