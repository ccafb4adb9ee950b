// On Windows no link needs this wait: Asio's completion port serves all of them. So nothing is ever added.
#include "links/descriptor_watch.hpp"

#include <thread>

#include "links/link_error.hpp"

namespace servodrome::links {

DescriptorWatch::DescriptorWatch() = default;

void DescriptorWatch::add(Descriptor /*descriptor*/, Ready /*ready*/) {
  throw LinkError(std::make_error_code(std::errc::not_supported),
                  "links that wait outside of Asio are not available on Windows; use udp:127.0.0.1:34980");
}

void DescriptorWatch::remove(Descriptor /*descriptor*/) {}
void DescriptorWatch::pause() { paused_ = true; }
void DescriptorWatch::resume() { paused_ = false; }
void DescriptorWatch::tick_every(Time /*period*/) {}

bool DescriptorWatch::wait(Time longest) {
  if (longest > Time{} && longest != never) std::this_thread::sleep_for(longest);
  return false;
}

}  // namespace servodrome::links
