#include "studio/recorded_objects.hpp"

namespace servodrome::studio {

void RecordedObjects::download(master::ObjectAddress object, std::span<const std::byte> data) {
  if (api::ChangeLog::is_motion(object.index)) return objects_.download(object, data);
  Bytes before;
  try {
    before = objects_.upload(object);
  } catch (const master::ObjectError& error) {
    if (!error.answered()) throw;  // the write would time out, too
  }
  objects_.download(object, data);
  record_(object, before, {data.begin(), data.end()});
}

}  // namespace servodrome::studio
