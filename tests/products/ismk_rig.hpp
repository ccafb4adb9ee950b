#pragma once

#include "line/model_plant.hpp"
#include "products/ismk/ismk.hpp"
#include "rig.hpp"

// An iSMK of one of its ratings on the plant that belongs to it.
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

struct IsmkRig : Rig<products::Ismk> {
  explicit IsmkRig(std::string_view rating = products::ismk::default_rating)
      : Rig(ismk_plant(rating), ismk_settings(rating)) {}
  IsmkRig(const plant::Parameters& parameters, const products::Settings& settings) : Rig(parameters, settings) {}
};

}  // namespace servodrome::test
