#include "scenario/schema.hpp"

#include <algorithm>
#include <limits>

#include "scenario/parse.hpp"

namespace servodrome::scenario {
namespace {

using Json = nlohmann::ordered_json;
using line::KeyNote;

Json reference(const std::string& definition) { return {{"$ref", "#/definitions/" + definition}}; }

Json type_of(const KeyNote& note) {
  switch (note.kind) {
    case KeyNote::Kind::string: {
      Json type{{"type", "string"}};
      if (!note.words.empty()) type["enum"] = note.words;
      return type;
    }
    case KeyNote::Kind::boolean: return {{"type", "boolean"}};
    case KeyNote::Kind::number: return {{"type", "number"}};
    case KeyNote::Kind::integer: {
      Json type{{"type", "integer"}};
      using Limits = std::numeric_limits<std::int64_t>;
      if (note.minimum.value_or(Limits::min()) != Limits::min()) type["minimum"] = *note.minimum;
      if (note.maximum.value_or(Limits::max()) != Limits::max()) type["maximum"] = *note.maximum;
      return type;
    }
    case KeyNote::Kind::table: return note.definition.empty() ? Json{{"type", "object"}} : reference(note.definition);
    case KeyNote::Kind::tables: return {{"type", "array"}, {"items", reference(note.definition)}};
  }
  return {};
}

// A key whose type depends on other keys may have any of its types.
void add(Json& properties, const std::string& key, const Json& type) {
  if (!properties.contains(key)) {
    properties[key] = type;
    return;
  }
  Json& present = properties[key];
  if (present == type) return;
  if (!present.contains("anyOf")) present = Json{{"anyOf", Json::array({present})}};
  Json& types = present["anyOf"];
  if (std::find(types.begin(), types.end(), type) == types.end()) types.push_back(type);
}

Json object_of(const Json& properties) {
  return {{"type", "object"}, {"additionalProperties", false}, {"properties", properties}};
}

// All keys of all actions, for completion, and the keys of each action.
Json rule_of(const FormatKeys& keys) {
  Json properties = properties_of(keys.tables.at("rule"));
  Json choices = Json::array();
  for (const auto& [action, notes] : keys.actions) {
    const Json its = properties_of(notes);
    for (const auto& [key, type] : its.items()) add(properties, key, type);
    choices.push_back({{"if", {{"properties", {{"do", {{"const", action}}}}}}}, {"then", object_of(its)}});
  }
  return {{"type", "object"}, {"required", {"do"}}, {"properties", properties}, {"allOf", choices}};
}

}  // namespace

nlohmann::ordered_json properties_of(const std::vector<KeyNote>& notes) {
  Json properties = Json::object();
  for (const KeyNote& note : notes) {
    // The words of a key are in a separate note, in addition to the note of its type.
    const bool has_words = note.kind == KeyNote::Kind::string && note.words.empty() &&
                           std::any_of(notes.begin(), notes.end(), [&](const KeyNote& other) {
                             return other.key == note.key && !other.words.empty();
                           });
    if (!has_words) add(properties, note.key, type_of(note));
  }
  return properties;
}

nlohmann::ordered_json json_schema() {
  const FormatKeys keys = format_keys();
  Json schema{{"$schema", "http://json-schema.org/draft-07/schema#"}, {"title", "Servodrome scenario"}};
  schema.update(object_of(properties_of(keys.tables.at(""))));
  schema["required"] = {"title"};
  Json& definitions = schema["definitions"];
  for (const auto& [name, notes] : keys.tables) {
    if (!name.empty()) definitions[name] = name == "rule" ? rule_of(keys) : object_of(properties_of(notes));
  }
  return schema;
}

}  // namespace servodrome::scenario
