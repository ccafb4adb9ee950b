#include "studio/recorded_objects.hpp"

#include <exception>

#include "studio/task.hpp"

namespace servodrome::studio {

void RecordedObjects::download(master::ObjectAddress object, std::span<const std::byte> data) {
  if (api::ChangeLog::is_motion(object.index)) return target().download(object, data);
  Bytes before;
  const bool cleans_up = std::uncaught_exceptions() != 0;
  try {
    before = target().upload(object);
  } catch (const master::ObjectError& error) {
    if (!error.answered()) throw;  // the write would time out, too
  } catch (const Task::Ended&) {
    if (!cleans_up) throw;  // a task that is being ended restores a value: it writes without the read
  }
  target().download(object, data);
  record_(object, before, {data.begin(), data.end()});
}

}  // namespace servodrome::studio
