#include "coverage.hpp"

#include <fmt/format.h>
#include <stdexcept>
#include <sys/mman.h>

namespace servodrome::motion {
namespace {

const char* mode_text(std::size_t mode) {
  static constexpr std::array names{"pulse", "-3", "none", "PP", "VL", "PV", "PT", "HM", "IP", "CSP", "CSV", "CST"};
  return names[mode];
}

const char* state_text(std::size_t state) { return drive::name(static_cast<drive::PowerState>(state)); }

bool possible(const Variant& variant, std::size_t state, Kind kind) {
  if (state == 0) return false;  // the drive leaves it at once
  if (kind == Kind::al) return variant.on_ethercat();
  if (kind == Kind::nmt || kind == Kind::heartbeat || kind == Kind::cut) return !variant.on_ethercat();
  return true;
}

}  // namespace

void Coverage::count(drive::PowerState state, Kind kind, drive::Mode mode) {
  for (std::size_t i = 0; i < all_modes.size(); ++i) {
    if (all_modes[i] == mode) ++counts[static_cast<std::size_t>(state)][static_cast<std::size_t>(kind)][i];
  }
}

void Coverage::add(const Coverage& other) {
  for (std::size_t s = 0; s < power_states; ++s) {
    for (std::size_t k = 0; k < kinds; ++k) {
      for (std::size_t m = 0; m < all_modes.size(); ++m) counts[s][k][m] += other.counts[s][k][m];
    }
  }
}

CoverageBook::CoverageBook(const std::vector<Variant>& variants) {
  for (const Variant& variant : variants) index_.emplace(variant.product->name, index_.size());
  void* memory =
      mmap(nullptr, sizeof(Coverage) * index_.size(), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::runtime_error("no memory for the coverage");
  pages_ = static_cast<Coverage*>(memory);  // mmap fills it with zeros
}

CoverageBook::~CoverageBook() { munmap(pages_, sizeof(Coverage) * index_.size()); }

std::map<std::string, Coverage> CoverageBook::copy() const {
  std::map<std::string, Coverage> copies;
  for (const auto& [product, index] : index_) copies[product] = pages_[index];
  return copies;
}

std::string report(const std::map<std::string, Coverage>& by_product, const std::vector<Variant>& variants) {
  std::string text;
  for (const auto& [product, coverage] : by_product) {
    const Variant* variant = nullptr;
    for (const Variant& one : variants) {
      if (one.product->name == product) variant = &one;
    }
    if (variant == nullptr) continue;
    std::uint64_t reached = 0;
    std::uint64_t cells = 0;
    std::string missing;
    text += fmt::format("{}: modes in which an event met a state (of those that it has)\n  {:24}", product, "");
    for (std::size_t k = 0; k < kinds; ++k) text += fmt::format(" {:>10}", name_of(static_cast<Kind>(k)));
    text += "\n";
    for (std::size_t s = 1; s < power_states; ++s) {
      text += fmt::format("  {:24}", state_text(s));
      for (std::size_t k = 0; k < kinds; ++k) {
        unsigned met = 0;
        unsigned of = 0;
        for (std::size_t m = 0; m < all_modes.size(); ++m) {
          if (!variant->has(all_modes[m]) || !possible(*variant, s, static_cast<Kind>(k))) continue;
          ++of;
          if (coverage.counts[s][k][m] != 0) {
            ++met;
          } else {
            missing +=
                fmt::format("  never: {} in {}, mode {}\n", name_of(static_cast<Kind>(k)), state_text(s), mode_text(m));
          }
        }
        reached += met;
        cells += of;
        text += of == 0 ? fmt::format(" {:>10}", "-") : fmt::format(" {:>10}", fmt::format("{}/{}", met, of));
      }
      text += "\n";
    }
    text += fmt::format("  {} of {} reached\n{}", reached, cells, missing);
  }
  return text;
}

}  // namespace servodrome::motion
