#include "line/coupled_axes.hpp"

namespace servodrome::line {

CoupledAxes::CoupledAxes(const plant::CouplingParameters& parameters, Axis& first, Axis& second)
    : first_(first), second_(second), coupling_(parameters, first.plant(), second.plant()) {
  first.couple(*this);
  second.couple(*this);
}

void CoupledAxes::run_to(std::int64_t tick) {
  for (std::int64_t next = first_.ticks() + 1; next <= tick; ++next) {
    coupling_.pull();
    first_.run_alone_to(next);
    second_.run_alone_to(next);
  }
}

double CoupledAxes::ratio_of(const Axis& axis) const {
  const double ratio = coupling_.parameters().ratio;
  return &axis == &first_ ? ratio : 1.0 / ratio;
}

std::vector<std::string> CoupledAxes::judge(const Axis& axis, const plant::Parameters& changed) const {
  const auto of = [&](const Axis& each) -> const plant::Parameters& {
    return &each == &axis ? changed : each.plant().parameters();
  };
  return plant::validate(coupling_.parameters(), of(first_), of(second_));
}

}  // namespace servodrome::line
