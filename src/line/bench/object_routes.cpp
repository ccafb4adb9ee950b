#include <algorithm>
#include <fmt/format.h>

#include "api/query.hpp"
#include "line/bench/line_bench.hpp"
#include "line/bench/object_values.hpp"

namespace servodrome::line::bench {
namespace {

using dictionary::AbortCode;
using dictionary::Entry;

struct Object {
  Axis& axis;
  const Entry& entry;
  std::string where;
};

Object object_argument(Axis& axis, const Call& call) {
  const auto [index, sub] = object_address(call.arguments[1], call.arguments[2]);
  std::string where = fmt::format("{}, {:04X}h:{:02X}", axis.settings().name, index, sub);
  if (!axis.powered()) {
    throw ApiError{409, "the axis has no power", where, "switch it on: POST .../power {\"action\": \"on\"}"};
  }
  AbortCode abort{};
  const Entry* entry = axis.device().dictionary().find(index, sub, abort);
  if (entry == nullptr) refuse_access(abort, where);
  return {axis, *entry, std::move(where)};
}

}  // namespace

// A list of a thousand objects takes some milliseconds, so it is generated in parts, with other events in between.
Json LineBench::list_objects(Call& call) {
  constexpr std::size_t objects_at_once = 16;
  const auto part = [&axis = axis_of(call), at = std::size_t{0}, ended = false]() mutable -> std::string {
    if (ended) return {};
    const auto table = axis.device().dictionary().table();
    std::string text = at == 0 ? R"({"objects":[)" : "";
    for (const std::size_t end = std::min(at + objects_at_once, table.size()); at < end; ++at) {
      if (at > 0) text += ',';
      text += api::to_text(listed(table[at], axis.device(), axis.settings().product->name));
    }
    ended = at >= table.size();
    if (ended) text += "]}";
    return text;
  };
  call.content = api::Content{"application/json", {}, part};
  return nullptr;
}

Json LineBench::read_object(Call& call) {
  const Object object = object_argument(axis_of(call), call);
  dictionary::ReadValue value;
  const AbortCode abort = object.axis.device().dictionary().read(object.entry, value);
  if (abort != AbortCode::none) refuse_access(abort, object.where);
  return shown(object.entry, value.bytes);
}

// Reads several objects at once, for clients that poll them. The value is null if an object cannot be read now.
Json LineBench::read_values(Call& call) {
  Axis& axis = axis_of(call);
  Json values = Json::object();
  for (const auto& [text, address] : object_list(api::query_value(call, "objects").value_or(""))) {
    Json& value = values[text] = nullptr;
    if (!axis.powered()) continue;
    AbortCode abort{};
    const Entry* entry = axis.device().dictionary().find(address.index, address.sub, abort);
    dictionary::ReadValue read;
    if (entry == nullptr || axis.device().dictionary().read(*entry, read) != AbortCode::none) continue;
    value = shown(*entry, read.bytes)["value"];
  }
  return Json{{"values", std::move(values)}};
}

Json LineBench::write_object(Call& call) {
  const Object object = object_argument(axis_of(call), call);
  BodyReader body(call.body);
  const Json& value = body.required("value");
  body.finish();
  const std::vector<std::byte> bytes = bytes_of(object.entry, value, object.where);
  const AbortCode abort = object.axis.device().dictionary().write(object.entry, bytes);
  if (abort != AbortCode::none) refuse_access(abort, object.where);
  if (object.entry.index == 0x6040) object.axis.note_command();
  object.axis.send_waiting(line_.now());
  return nullptr;
}

}  // namespace servodrome::line::bench
