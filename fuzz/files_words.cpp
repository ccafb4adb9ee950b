#include "files_words.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <fmt/format.h>

#include "axis/axis_units.hpp"
#include "axis/jog_keys.hpp"
#include "axis/object_catalogue.hpp"
#include "describe/esi_document.hpp"
#include "fit/error.hpp"
#include "fit/signals.hpp"
#include "line/config.hpp"
#include "links/can/link_name.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/link_error.hpp"
#include "links/serial/format_text.hpp"
#include "links/serial/link_name.hpp"
#include "master/error.hpp"
#include "master/ethercat/al_state.hpp"
#include "scope/trigger.hpp"
#include "tools/sampling/channel.hpp"

namespace servodrome::fuzz {
namespace {

constexpr std::array types{
    dictionary::Type::boolean,        dictionary::Type::integer8,     dictionary::Type::integer16,
    dictionary::Type::integer32,      dictionary::Type::integer64,    dictionary::Type::unsigned8,
    dictionary::Type::unsigned16,     dictionary::Type::unsigned32,   dictionary::Type::unsigned64,
    dictionary::Type::real32,         dictionary::Type::octet_string, dictionary::Type::domain,
    dictionary::Type::visible_string,
};

void read_trigger(Bytes input) {
  try {
    const scope::TriggerText read = scope::parse_trigger(text_of(input));
    const scope::Trigger& trigger = read.trigger;
    require(!read.channel.empty() && std::isfinite(trigger.value));
    require(scope::condition_of(scope::word_of(trigger.condition)) == trigger.condition);
    const double before = trigger.value - 1;
    require(!trigger.fires(before, std::nan("")));
    trigger.fires(before, trigger.value);
    trigger.fires(std::nullopt, -trigger.value);
  } catch (const scope::TriggerError&) {
  }
}

// A name that was parsed and printed parses to the same name.
template <typename Parse>
void read_link_name(std::string_view text, const Parse& parse) {
  try {
    const std::string printed = to_string(parse(text));
    try {
      require(to_string(parse(printed)) == printed);
    } catch (const links::LinkError&) {
      std::abort();
    }
  } catch (const links::LinkError& error) {
    require(error.code() == std::errc::invalid_argument);
  }
}

void read_link_names(Bytes input) {
  read_link_name(text_of(input), [](std::string_view text) { return links::parse_can_link(text); });
  read_link_name(text_of(input), [](std::string_view text) { return links::parse_ethercat_link(text); });
  read_link_name(text_of(input), [](std::string_view text) { return links::parse_serial_link(text); });
}

void read_object_name(Bytes input) {
  const master::ObjectCatalogue& catalogue = master::ObjectCatalogue::standard();
  try {
    const master::ObjectAddress address = catalogue.resolve(text_of(input));
    require(catalogue.resolve(text_of(address)) == address && !catalogue.title(address).empty());
  } catch (const master::MasterError&) {
  }
}

// The value in the hexadecimal form, which gives the same bytes again.
std::string hexadecimal(const std::vector<std::byte>& bytes) {
  std::string digits;
  for (const std::byte byte : bytes) digits.insert(0, fmt::format("{:02X}", std::to_integer<unsigned>(byte)));
  return "0x" + digits;
}

void read_value(Bytes input) {
  const dictionary::Type type = types[take_byte(input) % types.size()];
  try {
    const std::vector<std::byte> bytes = master::parse_value(text_of(input), type);
    const std::string shown = master::text_of_value(bytes, type);
    const std::size_t size = dictionary::size_of(type);
    require(size == 0 || bytes.size() == size);
    if (size != 0 && type != dictionary::Type::real32) {
      require(master::parse_value(hexadecimal(bytes), type) == bytes);
    } else if (type == dictionary::Type::octet_string && !bytes.empty()) {
      require(master::parse_value(shown, type) == bytes);
    }
    if (type == dictionary::Type::real32) {
      float number = 0;
      std::memcpy(&number, bytes.data(), sizeof number);
      require(std::isnan(number) || master::parse_value(shown, type) == bytes);
    }
  } catch (const master::MasterError&) {
  }
}

// The bytes of an answer as text, with and without a type.
void show_value(Bytes input) {
  const std::uint8_t choice = take_byte(input);
  const auto type = choice < types.size() ? std::optional(types[choice]) : std::nullopt;
  const std::string shown = master::text_of_value(std::as_bytes(input), type);
  for (const char c : shown) require(static_cast<unsigned char>(c) >= 0x20 && c != 0x7F);
}

void read_channel(Bytes input) {
  try {
    const auto channel = master::sampling::named_channel(text_of(input), master::ObjectCatalogue::standard());
    require(!channel.name.empty());
  } catch (const master::MasterError&) {
  }
}

void read_assignment(Bytes input) {
  try {
    const fit::Assignment assignment = fit::parse_assignment(text_of(input));
    const std::string printed =
        fmt::format("{}={}@{}", fit::word_of(assignment.role), assignment.column, assignment.unit);
    const fit::Assignment again = fit::parse_assignment(printed);
    require(again.role == assignment.role && again.column == assignment.column && again.unit == assignment.unit);
  } catch (const fit::Error&) {
  }
}

void read_keys(Bytes input) {
  constexpr std::int32_t velocity = 1000;
  master::JogKeys keys(velocity);
  links::Time now{0};
  while (!input.empty()) {
    const std::uint8_t head = take_byte(input);
    keys.feed(text_of(take_bytes(input, head & 0x0F)), now);
    now += std::chrono::milliseconds(10) * (head >> 4);
    const auto wanted = keys.velocity(now);
    require(!wanted || std::abs(*wanted) <= 16 * velocity);
    require(keys.speed() >= velocity / 16 && keys.speed() <= 16 * velocity);
  }
}

void read_single_words(Bytes input) {
  const std::string_view text = text_of(input);
  if (const auto format = links::parse_character_format(text, 9600)) require(links::to_string(*format) == text);
  if (const auto type = master::parse_type(text)) {
    require(master::parse_type(master::short_word(*type)).has_value());
  }
  if (const auto system = master::unit_system_named(text)) require(master::names_of(*system).word == text);
  if (const auto state = master::parse_al_state(text)) {
    require(master::parse_al_state(master::short_name(*state)) == state);
  }
  if (const auto number = describe::parse_xml_number(text)) {
    require(describe::parse_xml_number(fmt::format("{}", *number)) == number);
  }
  if (const auto number = describe::parse_file_number(text)) {
    require(describe::parse_file_number(fmt::format("{}", *number)) == number);
  }
  line::ApiSettings api;
  line::parse_api_address(text, api);
}

constexpr Parser parsers[] = {read_trigger, read_link_names, read_object_name, read_value,       show_value,
                              read_channel, read_assignment, read_keys,        read_single_words};

}  // namespace

void read_words(Bytes input) { parse_with(parsers, input); }

}  // namespace servodrome::fuzz
