#include "scope/recording.hpp"

namespace servodrome::scope {

Table table_of(const Recording& recording) {
  Table table{.channels = recording.channels,
              .groups = recording.groups,
              .topics = std::vector<std::string>(recording.group_count),
              .rows = recording.rows(),
              .source = recording.source,
              .way = recording.way,
              .zero_unix_ns = recording.zero_unix_ns};
  for (std::size_t i = 0; i < recording.channels.size(); ++i) {
    std::string& topic = table.topics[recording.groups[i]];
    topic = topic.empty() ? "/scope/" + recording.channels[i].name : "/scope";
  }
  table.value = [&recording](std::size_t row, std::size_t channel) { return recording.value(row, channel); };
  table.time = [&recording](std::size_t row, std::size_t group) { return recording.time_of_group(row, group); };
  return table;
}

}  // namespace servodrome::scope
