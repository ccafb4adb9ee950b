#include "tools/tuning/bode_plot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace servodrome::master::tuning {
namespace {

constexpr double left = 60.0;
constexpr double right = 780.0;
constexpr std::array colours{"#0072b2", "#d55e00", "#009e73", "#cc79a7"};  // also distinguishable by colour-blind
                                                                           // readers

// One of the two diagrams, gain or phase.
struct Panel {
  double top;
  double bottom;
  double low;
  double high;
  double grid;
  double BodePoint::*value;

  double y(double number) const {
    return bottom - (std::clamp(number, low, high) - low) / (high - low) * (bottom - top);
  }
};

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&': safe += "&amp;"; break;
      case '<': safe += "&lt;"; break;
      case '>': safe += "&gt;"; break;
      default: safe += c;
    }
  }
  return safe;
}

}  // namespace

std::string bode_svg(std::span<const BodeCurve> curves, const std::string& title) {
  double first = 1e9;
  double last = 0.0;
  for (const BodeCurve& curve : curves) {
    for (const BodePoint& point : curve.points) {
      first = std::min(first, point.frequency_hz);
      last = std::max(last, point.frequency_hz);
    }
  }
  if (last <= first) {
    first = 1.0;
    last = 1000.0;
  }
  const auto x = [&](double hz) { return left + (right - left) * std::log(hz / first) / std::log(last / first); };
  std::string svg = fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 800 640" font-family="sans-serif" font-size="12">)"
      "\n<rect width=\"800\" height=\"640\" fill=\"white\"/>\n<text x=\"60\" y=\"20\" font-size=\"14\">{}</text>\n",
      escaped(title));
  const std::array panels{Panel{40.0, 320.0, -40.0, 40.0, 10.0, &BodePoint::gain_db},
                          Panel{345.0, 590.0, -270.0, 90.0, 45.0, &BodePoint::phase_deg}};
  for (const Panel& panel : panels) {
    const bool gain = panel.value == &BodePoint::gain_db;
    for (double number = panel.low; number <= panel.high; number += panel.grid) {
      const bool marked = number == (gain ? 0.0 : -180.0);
      svg += fmt::format(
          "<line x1=\"{}\" x2=\"{}\" y1=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"/><text x=\"{}\" y=\"{:.1f}\" "
          "text-anchor=\"end\">{:g}{}</text>\n",
          left, right, panel.y(number), panel.y(number), marked ? "#555" : "#ddd", left - 6.0, panel.y(number) + 4.0,
          number, gain ? " dB" : "\xC2\xB0");
    }
    for (double decade = 1e-2; decade < last; decade *= 10.0) {
      for (int digit = 1; digit < 10; ++digit) {
        const double hz = decade * digit;
        if (hz < first || hz > last) continue;
        svg += fmt::format("<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1}\" y2=\"{2}\" stroke=\"#ddd\"/>\n", x(hz),
                           panel.top, panel.bottom);
        if (!gain && (digit == 1 || digit == 2 || digit == 5)) {
          svg += fmt::format("<text x=\"{:.1f}\" y=\"606\" text-anchor=\"middle\">{:g} Hz</text>\n", x(hz), hz);
        }
      }
    }
    for (std::size_t i = 0; i < curves.size(); ++i) {
      svg += fmt::format("<polyline fill=\"none\" stroke-width=\"1.6\" stroke=\"{}\" points=\"",
                         colours[i % colours.size()]);
      for (const BodePoint& point : curves[i].points) {
        svg += fmt::format("{:.1f},{:.1f} ", x(point.frequency_hz), panel.y(point.*panel.value));
      }
      svg += "\"/>\n";
    }
  }
  double at = left;
  for (std::size_t i = 0; i < curves.size(); ++i) {
    svg += fmt::format("<text x=\"{}\" y=\"630\" fill=\"{}\">{}</text>\n", at, colours[i % colours.size()],
                       escaped(curves[i].name));
    at += 180.0;
  }
  return svg + "</svg>\n";
}

}  // namespace servodrome::master::tuning
