#include "studio/traffic.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <fmt/format.h>

#include "api/query.hpp"
#include "links/can/log.hpp"
#include "links/pcap.hpp"
#include "links/serial/log.hpp"
#include "master/error.hpp"
#include "studio/line_traffic.hpp"
#include "studio/route_names.hpp"
#include "tools/sniff/summary.hpp"

namespace servodrome::studio {
namespace {

// Limits per piece of an answer; the line continues between two pieces.
constexpr unsigned frames_at_once = 32;
constexpr unsigned rows_looked_at_at_once = 256;
constexpr unsigned rows_at_once = 64;
constexpr std::size_t capture_bytes_at_once = std::size_t{64} * 1024;
constexpr std::size_t most_rows_of_an_answer = 5000;
constexpr std::size_t usual_rows = 1000;

Traffic& traffic_of(const Call& call) { return *static_cast<Traffic*>(call.context); }

std::shared_ptr<TrafficView> view_argument(Call& call) { return traffic_of(call).view_of(call); }

std::string lower(std::string_view text) {
  std::string small(text);
  std::transform(small.begin(), small.end(), small.begin(),
                 [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
  return small;
}

// Selects the rows that a request wants.
struct RowFilter {
  master::SniffFilter words{};
  std::string text{};  // in lower case
  bool errors = false;

  static RowFilter of(const Call& call) {
    RowFilter filter;
    for (const std::string_view key : {"node", "kind", "object"}) {
      const auto value = query_value(call, key);
      if (!value || value->empty()) continue;
      try {
        filter.words.add(fmt::format("{}={}", key, *value), master::ObjectCatalogue::standard());
      } catch (const master::MasterError& error) {
        throw ApiError{400, error.happened(), error.where(), error.remedy()};
      }
    }
    if (const auto value = query_value(call, "text")) filter.text = lower(*value);
    filter.errors = query_flag(call, "errors");
    return filter;
  }
  bool passes(const TrafficRow& row) const {
    const master::Decoded& decoded = row.decoded;
    if (errors && !decoded.error) return false;
    if (!words.passes(decoded)) return false;
    if (text.empty()) return true;
    return lower(decoded.text).find(text) != std::string::npos ||
           lower(decoded.source).find(text) != std::string::npos ||
           lower(decoded.raw).find(text) != std::string::npos || lower(row.from).find(text) != std::string::npos;
  }
};

std::string row_text(const TrafficRow& row) {
  const master::Decoded& decoded = row.decoded;
  Json json{{"number", row.number},  {"time_ns", decoded.time.count()},
            {"from", row.from},      {"kind", master::name(decoded.kind)},
            {"node", nullptr},       {"about", decoded.source},
            {"bytes", decoded.raw},  {"text", decoded.text},
            {"error", decoded.error}};
  if (decoded.node) json["node"] = *decoded.node;
  json["values"] = Json::array();
  for (const master::DecodedValue& value : decoded.values) {
    json["values"].push_back({{"object", master::text_of(value.object)}, {"name", value.name}, {"value", value.text}});
  }
  return api::to_text(json);
}

// Makes the answer to GET .../traffic piece by piece: first decodes the new frames, then selects the wanted rows, then
// writes them.
class RowsAnswer {
 public:
  RowsAnswer(std::shared_ptr<TrafficView> view, RowFilter filter, std::uint64_t since, std::size_t limit, bool newest)
      : view_(std::move(view)), filter_(std::move(filter)), since_(since), limit_(limit), newest_(newest) {
    view_->flush();
    until_ = view_->ring().newest();
  }

  std::string operator()() {
    if (is_over_) return {};
    if (view_->decoded() < until_) {
      const auto left = static_cast<unsigned>(std::min<std::uint64_t>(frames_at_once, until_ - view_->decoded()));
      view_->decode_some(left);
      return " ";  // a long answer must send something between its pieces
    }
    if (!is_chosen_) {
      choose_some();
      return " ";
    }
    std::string part;
    for (unsigned i = 0; i < rows_at_once && !wanted_.empty(); ++i) {
      part += (any_written_ ? ",\n" : "\n") + row_text(wanted_.front());
      any_written_ = true;
      wanted_.pop_front();
    }
    if (!wanted_.empty()) return part;
    is_over_ = true;
    const std::uint64_t kept = view_->first_kept();
    const std::uint64_t lost = since_ + 1 < kept && since_ != 0 ? kept - since_ - 1 : 0;
    return part +
           fmt::format("\n],\"next\":{},\"left_out\":{},\"lost\":{},\"missed\":{},\"frames\":{},\"recording\":{}}}",
                       std::max(since_, goes_on_at_), left_out_, lost, view_->missed(), view_->ring().newest(),
                       view_->recording());
  }

 private:
  // Examines some more rows. Copies the wanted ones, because the view may drop them before they are written.
  void choose_some() {
    const auto& rows = view_->rows();
    if (at_ == 0) {
      const auto after = [](std::uint64_t number, const TrafficRow& row) { return number < row.number; };
      const auto begin = std::upper_bound(rows.begin(), rows.end(), since_, after);
      at_ = view_->forgotten_rows() + static_cast<std::uint64_t>(begin - rows.begin());
      goes_on_at_ = until_;
    }
    at_ = std::max(at_, view_->forgotten_rows());
    for (unsigned i = 0; i < rows_looked_at_at_once; ++i, ++at_) {
      const std::uint64_t place = at_ - view_->forgotten_rows();
      is_chosen_ = place >= rows.size() || rows[place].number > until_;
      if (is_chosen_) return;
      const TrafficRow& row = rows[place];
      if (!filter_.passes(row)) continue;
      if (wanted_.size() >= limit_) {
        if (newest_) {
          if (!wanted_.empty()) wanted_.pop_front();
          ++left_out_;
          if (limit_ == 0) continue;
        } else if (wanted_.empty() || row.number != wanted_.back().number) {  // keep the rows of a frame together
          goes_on_at_ = wanted_.empty() ? since_ : wanted_.back().number;
          is_chosen_ = true;
          return;
        }
      }
      wanted_.push_back(row);
    }
  }

  std::shared_ptr<TrafficView> view_;
  RowFilter filter_;
  std::uint64_t since_;
  std::size_t limit_;
  bool newest_;
  std::uint64_t until_ = 0;
  bool is_chosen_ = false;
  bool is_over_ = false;
  bool any_written_ = false;
  std::deque<TrafficRow> wanted_{};
  std::uint64_t at_ = 0;  // next row to examine, counted over all rows ever decoded
  std::uint64_t goes_on_at_ = 0;
  std::uint64_t left_out_ = 0;
};

Json show_traffic(Call& call) {
  const auto view = view_argument(call);
  const std::uint64_t since = query_integer(call, "since", 0, UINT64_MAX).value_or(0);
  const std::uint64_t limit = query_integer(call, "limit", 0, most_rows_of_an_answer).value_or(usual_rows);
  const bool newest = query_flag(call, "newest");
  const auto answer =
      std::make_shared<RowsAnswer>(view, RowFilter::of(call), since, static_cast<std::size_t>(limit), newest);
  call.content = {"application/json", "{\"rows\":[", [answer] { return (*answer)(); }};
  return nullptr;
}

Json view_json(const TrafficView& view) {
  return Json{{"bus", view.source().name()},
              {"recording", view.recording()},
              {"frames", view.ring().newest()},
              {"first", view.ring().oldest()},
              {"most_bytes", TrafficView::ring_bytes}};
}

Json record_traffic(Call& call) {
  const auto view = view_argument(call);
  BodyReader body(call.body);
  const auto record = body.boolean("record");
  body.finish();
  if (!record) throw ApiError{400, "the key is missing", "record", "send {\"record\": true} or false"};
  view->record(*record);
  return view_json(*view);
}

Json clear_traffic(Call& call) {
  const auto view = view_argument(call);
  BodyReader(call.body, true).finish();
  view->clear();
  return view_json(*view);
}

// Makes a capture of the ring's content, piece by piece.
class CaptureAnswer {
 public:
  CaptureAnswer(std::shared_ptr<TrafficView> view, line::Time epoch, bool is_pcap)
      : view_(std::move(view)), epoch_(epoch), is_pcap_(is_pcap) {
    view_->flush();
    cursor_ = view_->ring().begin();
    until_ = view_->ring().newest();
  }

  std::string head() const {
    if (!is_pcap_) return {};
    if (view_->source().medium() == Medium::can) return links::can_pcap_header();
    if (view_->source().medium() == Medium::serial) return links::SerialPcapng::header();
    const links::PcapFileHeader header{.link_type = links::PcapLink::ethernet};
    return {reinterpret_cast<const char*>(&header), sizeof header};
  }

  std::string operator()() {
    std::string part;
    while (part.size() < capture_bytes_at_once && cursor_.number <= until_) {
      const auto frame = view_->ring().next(cursor_);
      if (!frame) break;
      part += packet(*frame);
    }
    return part;
  }

 private:
  std::string packet(const line::TrafficFrame& frame) {
    const line::Time at = frame.at + epoch_;
    const std::string& name = view_->source().name();
    switch (frame.kind) {
      case line::TrafficKind::can:
      case line::TrafficKind::can_dropped:
      case line::TrafficKind::can_error: {
        using Kind = links::BusEvent::Kind;
        links::BusEvent event;
        event.kind = frame.kind == line::TrafficKind::can_error ? Kind::error : Kind::frame;
        std::memcpy(&event.frame, frame.bytes.data(), std::min(frame.bytes.size(), sizeof event.frame));
        return is_pcap_ ? links::can_pcap_packet(event, at) : links::candump_line(event, at, name) + "\n";
      }
      case line::TrafficKind::serial:
      case line::TrafficKind::modbus_tcp: {
        links::SerialMessage message;
        message.side = frame.from_master ? links::SerialSender::master : links::SerialSender::drive;
        message.is_tcp = frame.kind == line::TrafficKind::modbus_tcp;
        message.bytes = frame.bytes;
        return is_pcap_ ? pcapng_.packet(message, at) : links::serial_log_line(message, at, name) + "\n";
      }
      case line::TrafficKind::ethernet_out:
      case line::TrafficKind::ethernet_in: {
        const auto header = links::PcapPacketHeader::of(at, frame.bytes.size());
        std::string text(reinterpret_cast<const char*>(&header), sizeof header);
        text.append(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
        return text;
      }
    }
    return {};
  }

  std::shared_ptr<TrafficView> view_;
  line::Time epoch_;
  bool is_pcap_;
  line::TrafficRing::Cursor cursor_{};
  std::uint64_t until_ = 0;
  links::SerialPcapng pcapng_{};
};

Json show_capture(Call& call) {
  const auto view = view_argument(call);
  const bool is_ethercat = view->source().medium() == Medium::ethercat;
  const bool is_can = view->source().medium() == Medium::can;
  const std::string format = query_value(call, "format").value_or("pcap");
  const std::string_view text_format = is_can ? "candump" : "text";
  if (format != "pcap" && (is_ethercat || format != text_format)) {
    throw ApiError{400, fmt::format("there is no capture in the format \"{}\" of this bus", format.substr(0, 40)),
                   "format", is_ethercat ? "pcap" : fmt::format("pcap or {}", text_format)};
  }
  const bool is_pcap = format == "pcap";
  const auto answer = std::make_shared<CaptureAnswer>(view, traffic_of(call).epoch(), is_pcap);
  call.content = {is_pcap ? "application/vnd.tcpdump.pcap" : "text/plain; charset=utf-8", answer->head(),
                  [answer] { return (*answer)(); }};
  return nullptr;
}

constexpr std::array traffic_table{
    Route{Method::get, "/api/v1/buses/{}/traffic?since&limit&newest&node&kind&object&text&errors", show_traffic},
    Route{Method::put, "/api/v1/buses/{}/traffic", record_traffic},
    Route{Method::delete_, "/api/v1/buses/{}/traffic", clear_traffic},
    Route{Method::get, "/api/v1/buses/{}/capture?format", show_capture},
};

}  // namespace

api::RouteGroup Traffic::routes() { return {traffic_table, this}; }

const std::shared_ptr<TrafficView>& Traffic::view_of(Call& call) {
  std::unique_ptr<TrafficSource> source = find_(call);
  std::shared_ptr<TrafficView>& view = views_[source->name()];
  if (!view) view = std::make_shared<TrafficView>(std::move(source));
  return view;
}

void Traffic::flush() {
  for (const auto& [name, view] : views_) view->flush();
}

std::unique_ptr<TrafficSource> find_line_traffic(line::Line& line, const Call& call) {
  return std::make_unique<LineTraffic>(line, line::bench::bus_argument(line, call));
}

}  // namespace servodrome::studio
