#pragma once

#include <memory>
#include <vector>

#include "host/error.hpp"
#include "host/parameters/list.hpp"
#include "host/parameters/values.hpp"
#include "line/bench/routes.hpp"
#include "studio/service_objects.hpp"

// What commissioning asks of an axis beside its jobs, by the host library: of a virtual drive over its service port,
// between two ticks, of one on a bus over that. docs/bench-api.md, "Parameters" and what follows.
namespace servodrome::studio {

// An axis as these routes see it.
struct Subject {
  std::unique_ptr<host::ObjectClient> client;
  host::ObjectClient& objects = *client;
  host::NodeId node_id{};  // of a CANopen drive
  std::string product;
  std::span<const dictionary::Entry> table{};  // what its bus sees; of an axis without a fieldbus, all
  bool has_process_data = true;
  // Does something where the drive takes changes of its process data, and undoes it if the bus does not operate with
  // it; maybe in another thread, and maybe when the caller has left, so both keep what they need. Empty: it takes
  // them by `objects`.
  using Action = std::function<void(host::ObjectClient& objects)>;
  std::function<void(const Action& action, const Action& undo)> configure{};
  // The parameters as `servodrome params` has them: those of `table`.
  host::ParameterList parameters(bool with_connection = false) const;
};

// Where a server gets them from.
class Subjects {
 public:
  virtual ~Subjects() = default;
  // The axis that the first argument names. Throws ApiError: 404, or 409 if it cannot be spoken to.
  virtual Subject open(line::bench::Call& call) = 0;
};
// Those of the call's line.
Subjects& line_subjects();

inline Subject subject_of(line::bench::Call& call) { return static_cast<Subjects*>(call.context)->open(call); }

// `subjects` outlives the group.
line::bench::RouteGroup parameter_routes(Subjects& subjects);
line::bench::RouteGroup pdo_routes(Subjects& subjects);

// All of them, for a line.
std::vector<line::bench::RouteGroup> commissioning_routes();

// As the API tells it: `status`, and what, where and what to do.
line::bench::ApiError api_error(const host::HostError& error, unsigned status = 409);

// Of the query: absent or "false" is false, "true" is true. Throws ApiError 400.
bool flag(const line::bench::Call& call, std::string_view key);

}  // namespace servodrome::studio
