#pragma once

#include "scope/recorder.hpp"
#include "tools/sampling/sampler.hpp"

namespace servodrome::master::sampling {

// Records the samples of a sampler for as long as it exists.
class SamplerRecorder {
 public:
  // `sampler` must outlive this.
  SamplerRecorder(Sampler& sampler, const scope::RecorderOptions& options);
  ~SamplerRecorder() { sampler_.on_sample({}); }
  SamplerRecorder(const SamplerRecorder&) = delete;
  SamplerRecorder& operator=(const SamplerRecorder&) = delete;

  bool waits_for_trigger() const { return recorder_.waits_for_trigger(); }
  bool done() const { return recorder_.done(); }
  bool is_full() const { return recorder_.is_full(); }
  // The recording so far, with the sampler's period and names.
  scope::Recording recording() const;

 private:
  Sampler& sampler_;
  scope::Recorder recorder_;
};

}  // namespace servodrome::master::sampling
