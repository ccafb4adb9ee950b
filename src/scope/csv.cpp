#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <utility>

#include "scope/files.hpp"

namespace servodrome::scope {
namespace {

constexpr std::size_t rows_at_a_time = 1024;

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

void append_number(std::string& text, double number) {
  constexpr double exact = 9007199254740992.0;  // 2^53
  if (std::isnan(number)) return;
  if (std::abs(number) < exact && number == std::floor(number)) {
    fmt::format_to(std::back_inserter(text), "{}", static_cast<std::int64_t>(number));
  } else {
    fmt::format_to(std::back_inserter(text), "{}", number);
  }
}

class CsvWriter {
 public:
  CsvWriter(Table table, CsvFormat format) : table_(std::move(table)), format_(std::move(format)) {
    for (std::size_t i = 0; i < table_.channels.size(); ++i) order_.push_back(i);
    std::stable_sort(order_.begin(), order_.end(),
                     [this](std::size_t a, std::size_t b) { return table_.groups[a] < table_.groups[b]; });
  }

  std::string next() {
    std::string text = has_head_ ? "" : head();
    has_head_ = true;
    const std::size_t end = std::min(row_ + rows_at_a_time, table_.rows);
    for (; row_ < end; ++row_) append_row(text);
    return text;
  }

 private:
  bool begins_group(std::size_t place) const {
    return place == 0 || table_.groups[order_[place]] != table_.groups[order_[place - 1]];
  }

  std::string head() const {
    std::string text = format_.tick ? "tick," : "";
    text += format_.time_name;
    for (std::size_t place = 0; place < order_.size(); ++place) {
      const Channel& channel = table_.channels[order_[place]];
      if (place != 0 && begins_group(place)) text += fmt::format(",{}_{}", format_.time_name, channel.name);
      text += ',' + csv_field(channel.unit.empty() ? channel.name : fmt::format("{} [{}]", channel.name, channel.unit));
    }
    return text.append(format_.line_end);
  }

  void append_row(std::string& text) const {
    if (format_.tick) fmt::format_to(std::back_inserter(text), "{},", format_.tick(row_));
    for (std::size_t place = 0; place < order_.size(); ++place) {
      const std::size_t channel = order_[place];
      if (begins_group(place)) {
        const std::chrono::duration<double> time = table_.time(row_, table_.groups[channel]);
        if (place != 0) text += ',';
        fmt::format_to(std::back_inserter(text), "{:.{}f}", time.count(), format_.time_decimals);
      }
      text += ',';
      append_number(text, table_.value(row_, channel));
    }
    text.append(format_.line_end);
  }

  Table table_;
  CsvFormat format_;
  std::vector<std::size_t> order_;  // the channels, group by group
  std::size_t row_ = 0;
  bool has_head_ = false;
};

}  // namespace

std::function<std::string()> csv_parts_of(Table table, CsvFormat format) {
  return [writer = CsvWriter(std::move(table), std::move(format))]() mutable { return writer.next(); };
}

std::string csv_of(const Recording& recording) { return joined(csv_parts_of(table_of(recording))); }

std::string joined(const std::function<std::string()>& parts) {
  std::string file;
  for (std::string part = parts(); !part.empty(); part = parts()) file += part;
  return file;
}

}  // namespace servodrome::scope
