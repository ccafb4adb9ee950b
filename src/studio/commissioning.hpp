#pragma once

#include <memory>

#include "api/routes.hpp"
#include "master/error.hpp"
#include "studio/service_objects.hpp"
#include "tools/parameters/list.hpp"
#include "tools/parameters/values.hpp"

// Access to an axis for commissioning, besides its jobs. It uses an `ObjectClient`: for a virtual drive over its
// service port between two ticks, for a drive on a bus over that bus. docs/bench-api.md, "Parameters" and the sections
// after it.
namespace servodrome::studio {

// An axis as the commissioning routes use it.
struct Subject {
  std::unique_ptr<master::ObjectClient> client;
  master::ObjectClient& objects = *client;
  master::NodeId node_id{};  // of a CANopen drive
  std::string product;
  std::span<const dictionary::Entry> table{};  // objects of its bus; without a fieldbus all objects
  bool has_process_data = true;
  // Runs `action` in a state in which the drive accepts changes of its process data. Runs `undo` if the bus does not
  // operate with the change. Both may run in another thread, and after the caller has left, so they must own their
  // data. Empty: the drive accepts such changes through `objects` at any time.
  using Action = std::function<void(master::ObjectClient& objects)>;
  std::function<void(const Action& action, const Action& undo)> configure{};
  // The values that the drive has after the next power-on. Empty: they cannot be read while the drive runs.
  std::function<std::vector<master::ParameterValue>(const master::ParameterList& list)> stored{};
  // The parameters that `servodrome params` lists: those of `table`.
  master::ParameterList parameters(bool with_connection = false) const;
};

// Provides the subjects of a server.
class Subjects {
 public:
  virtual ~Subjects() = default;
  // Opens the axis that the first argument names. Throws ApiError: 404, or 409 if the drive does not communicate.
  virtual Subject open(api::Call& call) = 0;
};

// The axes of a line.
class LineSubjects final : public Subjects {
 public:
  // `line` must outlive this object.
  explicit LineSubjects(line::Line& line) : line_(line) {}
  Subject open(api::Call& call) override;

 private:
  line::Line& line_;
};

inline Subject subject_of(api::Call& call) { return static_cast<Subjects*>(call.context)->open(call); }

// `subjects` must outlive the group.
api::RouteGroup parameter_routes(Subjects& subjects);
api::RouteGroup pdo_routes(Subjects& subjects);

// Converts an error to the API's form: `status`, what happened, where, and what to do.
api::ApiError api_error(const master::MasterError& error, unsigned status = 409);

}  // namespace servodrome::studio
