#include "tools/parameters/loader.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "axis/axis402.hpp"
#include "catalogue/product.hpp"
#include "dictionary/dictionary.hpp"
#include "drive/power/power_state.hpp"
#include "tools/parameters/writer.hpp"

namespace servodrome::master {
namespace {

using dictionary::Type;

constexpr std::size_t most_problems = 10;  // maximum of problems reported at once

std::string place_of(const std::string& file, const ParameterValue& value) {
  return fmt::format("{}:{}:{}", file, value.line, value.column);
}

bool same_type(Type a, Type b) { return short_word(a) == short_word(b); }

// Checks a value without access to the drive; returns the problem, or "" if there is none.
std::string objection(const ParameterValue& value, const Parameter& parameter) {
  if (!same_type(value.type, parameter.type)) {
    return fmt::format("its type is {}, not {}", short_word(parameter.type), short_word(value.type));
  }
  if (dictionary::size_of(value.type) == 0 || value.adds_node_id) return {};
  if (value.type == Type::real32) {
    float number = 0;
    std::memcpy(&number, value.bytes.data(), sizeof number);
    return std::isfinite(number) ? "" : "it is not a finite number";
  }
  const std::int64_t number = dictionary::decode_number(value.type, value.bytes);
  if (parameter.minimum && number < *parameter.minimum) {
    return fmt::format("{} is below the minimum, {}", number, *parameter.minimum);
  }
  if (parameter.maximum && number > *parameter.maximum) {
    return fmt::format("{} is above the maximum, {}", number, *parameter.maximum);
  }
  return {};
}

void require_product(const ParameterFile& file, const std::string& file_name, const DriveIdentity& drive) {
  const auto same = file.identity.is_same_product(drive);
  if (same == true) return;
  throw MasterError(same ? fmt::format("the parameters are of another product, {}; the drive is {}",
                                       file.identity.text(), drive.text())
                         : fmt::format("it is not known whether the parameters, of {}, fit the drive, {}",
                                       file.identity.text(), drive.text()),
                    file_name, "give the file of this product, or --force if you know that they fit");
}

// Changing parameters while a motor follows its targets is dangerous, and most drives refuse many of them then.
void require_rest(ObjectClient& objects) {
  const auto word = objects.read_if_present<std::uint16_t>(0x6041);
  if (!word) return;
  const PowerState state = state_of(*word);
  if (state != PowerState::operation_enabled && state != PowerState::quick_stop_active) return;
  throw MasterError(fmt::format("the drive is in state {}", drive::name(state)), objects.where(),
                    "disable it before its parameters are loaded");
}

struct Plan {
  WantedValues wanted;
  std::vector<ObjectAddress> skipped;
};

// Makes all checks that need no write.
Plan plan_of(ObjectClient& objects, const ParameterFile& file, const std::string& file_name, const ParameterList& list,
             const LoadOptions& options) {
  Plan plan;
  std::vector<std::string> problems;
  std::size_t done = 0;
  const auto complain = [&](const ParameterValue& value, const std::string& problem) {
    const std::string name = value.name.empty() ? "" : " " + value.name;
    problems.push_back(fmt::format("{}: {}{}: {}", place_of(file_name, value), text_of(value.address), name, problem));
  };
  for (const ParameterValue& value : file.values) {
    if (options.progress) options.progress("checking", done++, file.values.size());
    const Parameter* parameter = list.find(value.address);
    if (parameter == nullptr && list.rules().is_connection(value.address)) {
      complain(value, "it is a communication setting; give --connection to load it as well");
    } else if (parameter == nullptr && !options.skip_absent) {
      complain(value, "it is not a parameter of this drive");
    } else if (parameter == nullptr) {
      plan.skipped.push_back(value.address);
    } else if (const std::string problem = objection(value, *parameter); !problem.empty()) {
      complain(value, problem);
    } else if (read_parameter(objects, value.address, parameter->type)) {
      plan.wanted[value.address] = {parameter->type, bytes_for(value, options.node_id)};
    } else if (options.skip_absent) {
      plan.skipped.push_back(value.address);
    } else {
      complain(value, "the drive does not have it, or not on this bus; give --skip-absent to skip it");
    }
  }
  if (problems.empty()) return plan;
  std::string first;
  for (std::size_t i = 0; i < std::min(problems.size(), most_problems); ++i) first += "\n  " + problems[i];
  if (problems.size() > most_problems) first += fmt::format("\n  and {} more", problems.size() - most_problems);
  throw MasterError(fmt::format("{} of {} values cannot be loaded:{}\n", problems.size(), file.values.size(), first),
                    objects.where(), "nothing was written");
}

// True if the drive still answers. Otherwise each attempt to restore a value would end in a timeout.
bool answers(ObjectClient& objects, ObjectAddress address) {
  try {
    objects.upload(address);
    return true;
  } catch (const ObjectError& error) {
    return error.answered();
  } catch (const MasterError&) {
    return false;
  }
}

// Restores the values from before the load, and throws LoadError with the result.
[[noreturn]] void take_back(ObjectClient& objects, const ParameterWriter& writer, const MasterError& cause) {
  const std::vector<ObjectAddress> written = writer.written();
  if (written.empty()) throw cause;
  if (!answers(objects, written.front())) {
    throw LoadError(
        cause,
        fmt::format("the drive does not answer any more; {} objects were written: {}; when it answers again, load the "
                    "file again; if the drive has a store command, it also returns to the stored values when it is "
                    "switched off and on",
                    written.size(), text_of(written)),
        LoadError::Outcome::bus_lost, written, written);
  }
  WantedValues before = writer.before();
  std::erase_if(before,
                [](const auto& one) { return one.second.bytes.empty() && dictionary::size_of(one.second.type) != 0; });
  ParameterWriter back(objects, {}, {});
  std::vector<ObjectAddress> not_restored;
  std::string why;
  try {
    back.bring_to(before);
  } catch (const MasterError& error) {
    why = error.what();
    for (const auto& [address, value] : before) {
      try {
        if (read_parameter(objects, address, value.type) != value.bytes) not_restored.push_back(address);
      } catch (const MasterError&) {
        not_restored.push_back(address);
      }
    }
  }
  if (not_restored.empty()) {
    throw LoadError(cause,
                    fmt::format("{}; the previous values of all {} objects written before were restored",
                                cause.remedy(), written.size()),
                    LoadError::Outcome::rolled_back, written, {});
  }
  throw LoadError(cause,
                  fmt::format("of {} objects written before, these previous values could not be restored: {} ({}); "
                              "load a file that is known to be good",
                              written.size(), text_of(not_restored), why),
                  LoadError::Outcome::partly, written, not_restored);
}

}  // namespace

LoadError::LoadError(const MasterError& cause, const std::string& remedy, Outcome outcome,
                     std::vector<ObjectAddress> written, std::vector<ObjectAddress> not_restored)
    : MasterError(cause.happened(), cause.where(), remedy),
      outcome_(outcome),
      written_(std::move(written)),
      not_restored_(std::move(not_restored)) {}

LoadReport load_parameters(ObjectClient& objects, const ParameterFile& file, const std::string& file_name,
                           const ParameterList& list, const DriveIdentity& drive, const LoadOptions& options) {
  if (!options.force) require_product(file, file_name, drive);
  require_rest(objects);
  Plan plan = plan_of(objects, file, file_name, list, options);
  ParameterWriter writer(objects, options.before_communication, options.progress);
  try {
    writer.bring_to(plan.wanted);
  } catch (const MasterError& error) {
    take_back(objects, writer, error);
  }
  LoadReport report{.compared = plan.wanted.size(), .skipped = std::move(plan.skipped)};
  for (const auto& [address, before] : writer.before()) {
    const auto wanted = plan.wanted.find(address);
    if (wanted == plan.wanted.end() || wanted->second.bytes == before.bytes) continue;
    report.written.push_back(address);
    if (list.rules().acts_after_restart(address)) report.after_restart.push_back(address);
    if (!list.find(address)->retained) report.volatile_ones.push_back(address);
  }
  return report;
}

bool store_parameters(ObjectClient& objects, const catalogue::ParameterRules& rules) {
  bool stored = false;
  for (const catalogue::StoreCommand& command : rules.store) {
    // Uses the size that the drive reports, because makers' commands may be 8 or 16 bits wide.
    std::size_t size = sizeof command.value;
    try {
      size = std::clamp<std::size_t>(objects.upload(command.object).size(), 1, size);
    } catch (const ObjectError& error) {
      if (error.object_is_absent()) continue;
      if (!error.answered()) throw;
    }
    objects.download(command.object, std::as_bytes(std::span(&command.value, 1)).first(size));
    stored = true;
  }
  return stored;
}

std::string text_of(std::span<const ObjectAddress> objects, std::size_t at_most) {
  std::string text;
  const std::size_t shown = std::min(objects.size(), at_most);
  for (std::size_t i = 0; i < shown; ++i) {
    const bool last = i + 1 == shown && shown == objects.size();
    text += fmt::format("{}{}", i == 0 ? "" : last ? " and " : ", ", text_of(objects[i]));
  }
  if (shown < objects.size()) text += fmt::format(" and {} more", objects.size() - shown);
  return text;
}

}  // namespace servodrome::master
