#pragma once

#include "dictionary/medium.hpp"
#include "line/model_plant.hpp"
#include "products/ismk/ismk.hpp"
#include "rig.hpp"

// An iSMK of one of its ratings, with the corresponding plant.
namespace servodrome::test {

inline plant::Parameters ismk_plant(std::string_view rating = products::ismk::default_rating) {
  plant::Parameters parameters;
  line::fit_model(*products::find_model(products::ismk::ratings, rating), parameters);
  parameters.supply.charged_at_start = true;
  return parameters;
}

inline products::Settings ismk_settings(std::string_view rating = products::ismk::default_rating) {
  products::Settings settings;
  settings.model = rating;
  return settings;
}

struct IsmkMemory {
  std::array<std::byte, 16384> bytes{};
  dictionary::RamMedium medium{bytes};
};

// With factory settings: kvp 4, which is slow, and the slower rates of the loops. Stores to its own memory, unless the
// settings contain one.
struct FactoryIsmkRig : private IsmkMemory, Rig<products::Ismk> {
  explicit FactoryIsmkRig(std::string_view rating = products::ismk::default_rating)
      : FactoryIsmkRig(ismk_plant(rating), ismk_settings(rating)) {}
  FactoryIsmkRig(const plant::Parameters& parameters, const products::Settings& settings)
      : Rig(parameters, with_memory(settings, medium)) {}

 private:
  static products::Settings with_memory(products::Settings settings, dictionary::Medium& memory) {
    if (settings.store == nullptr) settings.store = &memory;
    return settings;
  }
};

// Commissioned: the faster rates, and gains for a stiff axis, so that motion is fast and exact. A power cycle restores
// the factory settings.
struct IsmkRig : FactoryIsmkRig {
  explicit IsmkRig(std::string_view rating = products::ismk::default_rating) : FactoryIsmkRig(rating) { commission(); }
  IsmkRig(const plant::Parameters& parameters, const products::Settings& settings)
      : FactoryIsmkRig(parameters, settings) {
    commission();
  }

 private:
  void commission() {
    set(0x60F9, 6, 0x80);
    device.set_rigidity(150.0);
  }
};

}  // namespace servodrome::test
