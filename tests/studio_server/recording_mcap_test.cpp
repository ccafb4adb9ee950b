// Recordings of a line as MCAP.
#include <cstring>
#include <gmock/gmock.h>
#include <map>

#include "commissioning_rig.hpp"
#include "line/bench/scope/line_scope.hpp"

// Third-party readers of these files: tests/interop/test_studio_drives.py, test_scope.py.
namespace servodrome::studio {
namespace recording_mcap_test {
namespace {

using api::Method;
using api::Response;
using testing::HasSubstr;
using namespace std::chrono_literals;

constexpr std::int64_t epoch_ns = 1'700'000'000'000'000'000;
constexpr unsigned message_record = 0x05;
constexpr unsigned chunk_record = 0x06;

class Export : public CommissioningRig {
 protected:
  Response ask_here(Method method, const std::string& target, const std::string& body = {}) {
    const std::vector groups{api::RouteGroup{api::recording_routes(), &scope_.scope()}};
    return line::bench::begin(line_, {.method = method, .target = "/api/v1/" + target, .body = body}, groups);
  }
  std::string record(const std::string& channels, double ms, double rate_hz = 1000) {
    const Response begun =
        ask_here(Method::post, "recordings",
                 fmt::format(R"({{"channels": [{}], "duration_ms": {}, "rate_hz": {}}})", channels, ms, rate_hz));
    EXPECT_EQ(begun.status, 201U) << begun.body;
    pass(std::chrono::milliseconds(static_cast<int>(ms) + 100));
    return fmt::format("recordings/{}", nlohmann::json::parse(begun.body)["id"].get<int>());
  }
  // The parts in which the server sends it.
  std::vector<std::string> parts(const std::string& recording) {
    const Response response = ask_here(Method::get, recording + "/data.mcap");
    EXPECT_EQ(response.status, 200U) << response.body;
    std::vector<std::string> parts{response.body};
    if (!response.more) return parts;
    for (std::string part = response.more(); !part.empty(); part = response.more()) parts.push_back(part);
    return parts;
  }
  static std::string join(const std::vector<std::string>& parts) {
    std::string all;
    for (const std::string& part : parts) all += part;
    return all;
  }
  struct Message {
    unsigned channel;
    std::uint64_t time_ns;
    nlohmann::json fields;
  };
  // The format by the specification (mcap.dev/spec): records, and those within chunks.
  static std::vector<Message> messages_of(std::string_view file) {
    std::vector<Message> messages;
    const auto number = [&file](std::size_t at, std::size_t size) {
      std::uint64_t value = 0;
      std::memcpy(&value, file.data() + at, size);
      return value;
    };
    std::size_t at = 8;
    std::size_t end = file.size() - 8;
    while (at < end) {
      const unsigned kind = static_cast<unsigned char>(file[at]);
      const std::uint64_t length = number(at + 1, 8);
      const std::size_t content = at + 9;
      at = content + length;
      if (kind == chunk_record) {
        const std::size_t records = content + 8 + 8 + 8 + 4 + 4 + 8;  // compression is ""
        for (std::size_t inner = records; inner < at;) {
          const unsigned inner_kind = static_cast<unsigned char>(file[inner]);
          const std::uint64_t inner_length = number(inner + 1, 8);
          if (inner_kind == message_record) {
            const std::size_t begin = inner + 9;
            messages.push_back({static_cast<unsigned>(number(begin, 2)), number(begin + 6, 8),
                                nlohmann::json::parse(file.substr(begin + 22, inner_length - 22))});
          }
          inner += 9 + inner_length;
        }
      }
    }
    return messages;
  }

  line::bench::LineScope scope_{line_, [] { return links::Time(epoch_ns); }};
};

TEST_F(Export, HasATopicForEachAxisAndAFieldForEachChannel) {
  const std::string recording = record(
      R"({"axis": "ismc", "signal": "velocity_rpm"}, {"axis": "pronet", "object": "6041:00"},
         {"axis": "ismc", "object": "606C:00"})",
      20);
  const std::string file = join(parts(recording));
  EXPECT_EQ(file.substr(0, 8), "\x89MCAP0\r\n");
  EXPECT_EQ(file.substr(file.size() - 8), "\x89MCAP0\r\n");
  EXPECT_THAT(file, HasSubstr("/ismc"));
  EXPECT_THAT(file, HasSubstr("/pronet"));
  const auto view = nlohmann::json::parse(ask_here(Method::get, recording).body);
  const auto messages = messages_of(file);
  ASSERT_EQ(messages.size(), 2 * view["samples"].get<std::size_t>());
  EXPECT_EQ(messages[0].time_ns, epoch_ns + view["first_tick"].get<std::uint64_t>() * 62'500);
  EXPECT_EQ(messages[2].time_ns - messages[0].time_ns, 1'000'000U);
  EXPECT_EQ(messages[0].fields.size(), 2U);
  EXPECT_TRUE(messages[0].fields["velocity_rpm"].is_number()) << messages[0].fields;
  EXPECT_EQ(messages[1].fields.size(), 1U);
  const auto statusword = value("pronet", "6041/0").get<double>();
  EXPECT_EQ(messages[1].fields.begin().value().get<double>(), statusword);
  EXPECT_EQ(messages[1].fields.begin().key(), "statusword_6041_00");
  EXPECT_TRUE(messages[0].fields.contains("velocity_actual_value_606C_00")) << messages[0].fields;
}

TEST_F(Export, IsLaidOutPieceByPiece) {
  const auto sent = parts(record(R"({"axis": "ismc", "signal": "velocity_rpm"})", 2000, 16000));
  EXPECT_GT(sent.size(), 5U);
  for (const std::string& part : sent) EXPECT_LT(part.size(), 1'500'000U);
  EXPECT_EQ(messages_of(join(sent)).size(), 32'000U);
}

TEST_F(Export, OutlivesTheRecording) {
  const std::string recording = record(R"({"axis": "ismc", "signal": "velocity_rpm"})", 1000, 16000);
  Response response = ask_here(Method::get, recording + "/data.mcap");
  std::string file = response.body + response.more();
  EXPECT_EQ(ask_here(Method::delete_, recording).status, 204U);
  for (std::string part = response.more(); !part.empty(); part = response.more()) file += part;
  EXPECT_EQ(messages_of(file).size(), 16'000U);
}

TEST_F(Export, OfWhatIsNotThereIsRefused) {
  EXPECT_EQ(ask_here(Method::get, "recordings/7/data.mcap").status, 404U);
  EXPECT_EQ(ask_here(Method::get, "recordings/x/data.mcap").status, 404U);
  const Response begun = ask_here(Method::post, "recordings",
                                  R"({"channels": [{"axis": "ismc", "signal": "velocity_rpm"}], "duration_ms": 1000})");
  ASSERT_EQ(begun.status, 201U);
  const Response early = ask_here(Method::get, "recordings/1/data.mcap");
  EXPECT_EQ(early.status, 409U);
  EXPECT_THAT(early.body, HasSubstr("has not ended"));
}

}  // namespace
}  // namespace recording_mcap_test
}  // namespace servodrome::studio
