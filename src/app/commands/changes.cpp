// `changes`: lists the change log of a running server, and undoes changes.
#include <fmt/format.h>

#include "app/api_client.hpp"
#include "app/commands.hpp"
#include "app/number_options.hpp"

namespace servodrome::app {
namespace changes_command {

using Json = nlohmann::ordered_json;

constexpr double most_number = 9'007'199'254'740'992;  // 2^53: greater integers are not exact in JSON

struct Options {
  ApiOptions api;
  std::string axis;
  std::string who;
  std::uint64_t since = 0;
  std::uint64_t undo = 0;
  bool undo_all = false;
  bool all_axes = false;
  bool preview = false;
  bool json = false;
};

std::string escaped(const std::string& text) {
  std::string plain;
  for (const char each : text) {
    const bool safe = std::isalnum(static_cast<unsigned char>(each)) != 0 || each == '-' || each == '_' || each == '.';
    plain += safe ? std::string(1, each) : fmt::format("%{:02X}", static_cast<unsigned char>(each));
  }
  return plain;
}

// All changes that the server has after `since`, from as many answers as needed.
Json changes_of(const Options& options) {
  Json all;
  std::uint64_t since = options.since;
  for (;;) {
    std::string path = fmt::format("changes?since={}&limit=1000", since);
    if (!options.axis.empty()) path += "&axis=" + escaped(options.axis);
    Json answer = ask_api(options.api, "GET", path);
    since = answer["next"].get<std::uint64_t>();
    const bool more = answer["left_out"].get<std::uint64_t>() > 0;
    if (all.is_null()) {
      all = std::move(answer);
    } else {
      for (Json& each : answer["changes"]) all["changes"].push_back(std::move(each));
    }
    if (!more) break;
  }
  all["next"] = since;
  all["left_out"] = 0;
  if (!options.who.empty()) {
    Json some = Json::array();
    for (Json& each : all["changes"]) {
      if (each["who"] == options.who) some.push_back(std::move(each));
    }
    all["changes"] = std::move(some);
  }
  return all;
}

std::string text_of(const Json& value) {
  if (value.is_null()) return "not known";
  return value.is_string() ? value.get<std::string>() : value.dump();
}

void print_changes(const Json& answer) {
  for (const Json& each : answer["changes"]) {
    fmt::print("{:>6}  {}  {:<12} {}  {} -> {}  {}  ({})\n", each["number"].get<std::uint64_t>(),
               each["wall"].get<std::string>(), each["axis"].get<std::string>(), each["object"].get<std::string>(),
               text_of(each["before"]), text_of(each["after"]), each["name"].get<std::string>(),
               each["who"].get<std::string>());
  }
  if (const auto dropped = answer["dropped"].get<std::uint64_t>(); dropped > 0) {
    fmt::print("the oldest {} changes are no longer in the log\n", dropped);
  }
}

Json undo(const Options& options) {
  Json body;
  if (options.undo != 0) {
    body["number"] = options.undo;
  } else {
    if (options.all_axes) {
      body["all"] = true;
    } else {
      body["axis"] = options.axis;
    }
    if (options.since != 0) body["since"] = options.since;
    if (!options.who.empty()) body["who"] = options.who;
  }
  if (options.preview) body["preview"] = true;
  return ask_api(options.api, "POST", "changes/undo", body);
}

void print_undo(const Json& report) {
  for (const Json& each : report["undone"]) {
    fmt::print("{} {}  {} -> {}  {}\n", each["axis"].get<std::string>(), each["object"].get<std::string>(),
               text_of(each["from"]), text_of(each["to"]), each["name"].get<std::string>());
  }
  for (const Json& each : report["kept"]) {
    fmt::print("{} {} stays: {}; {}\n", each["axis"].get<std::string>(), each["object"].get<std::string>(),
               each["what"].get<std::string>(), each["hint"].get<std::string>());
  }
}

void run(const Options& options) {
  if (options.undo != 0 && options.undo_all)
    throw Failure::wrong_use("changes: give --undo N or --undo-all, one of them");
  const bool undoes = options.undo != 0 || options.undo_all;
  if (options.undo_all && options.axis.empty() != options.all_axes)
    throw Failure::wrong_use("changes: --undo-all needs --axis NAME or --all-axes, one of them");
  if (options.all_axes && !options.undo_all) throw Failure::wrong_use("changes: --all-axes needs --undo-all");
  if (options.preview && !undoes) throw Failure::wrong_use("changes: --preview needs --undo N or --undo-all");
  const Json answer = undoes ? undo(options) : changes_of(options);
  if (options.json) {
    fmt::print("{}\n", answer.dump(2));
  } else if (undoes) {
    print_undo(answer);
  } else {
    print_changes(answer);
  }
  if (undoes && !answer["kept"].empty()) throw Failure::did_not_work("some values stay as they are");
}

}  // namespace changes_command

void add_changes(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "changes", "List what was written to the drives of a running server, and undo it", changes_command::run);
  command->add_option("--axis", options->axis, "Changes of this axis only");
  command->add_option("--who", options->who, "Changes of this author only, as the list shows it");
  command->add_option("--since", options->since, "Changes after this number only")
      ->check(number_within(0, changes_command::most_number));
  command->add_option("--undo", options->undo, "Undo the change with this number")
      ->check(number_within(1, changes_command::most_number))
      ->excludes("--axis", "--who", "--since");
  command->add_flag("--undo-all", options->undo_all,
                    "Undo all changes of --axis or --all-axes, the newest first; with --who and --since only these");
  command->add_flag("--all-axes", options->all_axes, "With --undo-all: in all drives of the server");
  command->add_flag("--preview", options->preview, "Print what an undo would write, and write nothing");
  command->add_flag("--json", options->json, "Print one JSON object");
  add_api_options(*command, options->api);
}

}  // namespace servodrome::app
