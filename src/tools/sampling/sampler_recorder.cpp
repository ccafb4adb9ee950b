#include "tools/sampling/sampler_recorder.hpp"

namespace servodrome::master::sampling {
namespace {

std::vector<scope::Channel> shown(const std::vector<Channel>& channels) {
  std::vector<scope::Channel> result;
  for (const Channel& channel : channels) result.push_back({channel.name, channel.unit});
  return result;
}

}  // namespace

SamplerRecorder::SamplerRecorder(Sampler& sampler, const scope::RecorderOptions& options)
    : sampler_(sampler), recorder_(shown(sampler.channels()), sampler.groups(), sampler.group_count(), options) {
  sampler.on_sample([this](const scope::Sample& sample) { recorder_.take(sample); });
}

scope::Recording SamplerRecorder::recording() const {
  scope::Recording recording = recorder_.recording();
  recording.period = sampler_.period();
  recording.way = sampler_.way();
  recording.source = sampler_.objects().where();
  return recording;
}

}  // namespace servodrome::master::sampling
