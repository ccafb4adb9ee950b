#pragma once

#include <string>
#include <variant>

#include "line/bench/routes.hpp"

// What the API shows of buses and does to them, for each kind of bus.
namespace servodrome::line::bench {

using AnyBus = std::variant<NamedBus*, NamedSerialBus*, NamedEthercatBus*>;

// The bus that an argument names. Throws 404.
AnyBus bus_argument(Call& call);

Json view_of(const Line& line, const NamedBus& named);
Json view_of(const Line& line, const NamedSerialBus& named);
Json view_of(const Line& line, const NamedEthercatBus& named);

// Replaces what was disturbed before. Throws ApiError and changes nothing.
void disturb(Call& call, NamedBus& named);
void disturb(Call& call, NamedSerialBus& named);
void disturb(Call& call, NamedEthercatBus& named);

void calm(const Line& line, NamedBus& named);
void calm(const Line& line, NamedSerialBus& named);
void calm(const Line& line, NamedEthercatBus& named);

Json view_of_link(const std::string& name, const links::LinkCounters& traffic);

}  // namespace servodrome::line::bench
