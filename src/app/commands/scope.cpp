// `scope`: records objects of a drive, with a trigger, while a script or another master moves it.
#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <iterator>
#include <nlohmann/json.hpp>

#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/number_options.hpp"
#include "app/object_names.hpp"
#include "app/script_file.hpp"
#include "app/whole_file.hpp"
#include "links/time.hpp"
#include "scope/files.hpp"
#include "scope/measurements.hpp"
#include "tools/sampling/sampler_recorder.hpp"
#include "tools/script/run.hpp"

namespace servodrome::app {
namespace scope_command {

using nlohmann::ordered_json;
namespace sampling = master::sampling;

struct Options {
  BusOptions bus{.timeout_s = 60.0, .timeout_is_for_motion = true};
  std::vector<std::string> channels;
  std::string eds;
  std::optional<double> rate_hz;
  std::optional<double> duration_s;
  double pre_s = 0;
  std::string trigger;
  bool polls = false;
  std::string script;
  std::vector<std::string> script_lines;
  bool disable = false;
  std::vector<std::string> files;
  bool plot = false;

  bool moves() const { return !script.empty() || !script_lines.empty(); }
  // Standard output is a text, neither JSON nor a file.
  bool prints_text() const { return !bus.json && std::find(files.begin(), files.end(), "-") == files.end(); }
};

constexpr double usual_duration_s = 1.0;
constexpr master::Time patience = std::chrono::milliseconds(10);  // period of checks for Ctrl-C

master::Time time_of(double seconds) { return links::from_seconds(seconds); }

// ---- Before the bus is opened ----

struct FileFormat {
  std::string_view ending;
  std::string (*text)(const scope::Recording&);
};
constexpr std::array file_formats{FileFormat{".csv", scope::csv_of}, FileFormat{".mcap", scope::mcap_of},
                                  FileFormat{".svg", scope::svg_of}};

const FileFormat& format_of(const std::string& file) {
  if (file == "-") return file_formats[0];
  for (const FileFormat& format : file_formats) {
    if (file.ends_with(format.ending)) return format;
  }
  throw Failure::wrong_use(fmt::format("-o {}: unknown file type; the name must end in .csv, .mcap or .svg", file));
}

std::string script_text(const Options& options) {
  std::string text;
  for (const std::string& line : options.script_lines) text += line + '\n';
  if (options.script.empty()) return text;
  return read_text_file(options.script, fmt::format("--run {}", options.script));
}

// The axis of the script may give the node and the product of the drive.
std::optional<master::script::Script> parsed_script(Options& options, const master::ObjectCatalogue* sheet) {
  if (!options.moves()) return std::nullopt;
  const std::string name = options.script.empty() ? "--do" : options.script;
  master::script::Script script = parse_script(script_text(options), name, options.bus, sheet);
  if (script.axes.size() != 1) {
    throw Failure::wrong_use(
        fmt::format("{}: it has {} axes, but only one drive is recorded and can be moved", name, script.axes.size()));
  }
  const master::script::AxisDeclaration& axis = script.axes.front();
  if (axis.node != 0 && options.bus.node_id != 0 && axis.node != options.bus.node_id) {
    throw Failure::wrong_use(
        fmt::format("{}: its axis is node {}, but --node {} is recorded", name, axis.node, options.bus.node_id));
  }
  if (axis.node != 0) options.bus.node_id = axis.node;
  if (!axis.product.empty()) options.bus.product = axis.product;
  return script;
}

// ---- Channels ----

sampling::Channel channel_of(const std::string& text, const master::ObjectCatalogue& own) {
  try {
    return sampling::named_channel(text, own);
  } catch (const master::MasterError&) {
    try {
      return sampling::named_channel(text, master::ObjectCatalogue::standard());
    } catch (const master::MasterError& error) {
      throw Failure::wrong_use(error.what());
    }
  }
}

// The channels if none are given: those of the usual ones that the drive has on this bus.
std::vector<sampling::Channel> usual_channels(DriveLink& link, const master::ObjectCatalogue& catalogue) {
  std::vector<sampling::Channel> channels;
  const auto add_if_present = [&](const char* name) {
    sampling::Channel channel = channel_of(name, catalogue);
    try {
      sampling::complete(channel, link.objects());
      sampling::add_channel(channels, std::move(channel));
    } catch (const master::ObjectError& error) {
      if (!error.object_is_absent()) throw;
    }
  };
  add_if_present("6064");
  if (channels.empty()) add_if_present("6063");  // Modbus registers of an iSMK
  add_if_present("606C");
  add_if_present("6077");
  if (channels.empty()) throw Failure::wrong_use("scope: give the objects to record, e.g. `scope position velocity`");
  return channels;
}

std::size_t put(std::vector<sampling::Channel>& channels, sampling::Channel channel) {
  try {
    return sampling::add_channel(channels, std::move(channel));
  } catch (const master::MasterError& error) {
    throw Failure::wrong_use(error.what());
  }
}

// ---- Recording ----

struct Outcome {
  scope::Recording recording{};
  std::vector<sampling::Channel> channels{};
  std::string remark{};
  std::string noun{};
  unsigned address = 0;
  std::vector<std::string> said{};      // output of the script, for JSON
  std::vector<std::string> problems{};  // reasons for an early end, and errors after it
  bool interrupted = false;
};

class Session {
 public:
  Session(const Options& options, const std::optional<scope::TriggerText>& trigger,
          const std::optional<master::script::Script>& script, const std::optional<master::ObjectCatalogue>& sheet)
      : options_(options), script_(script), link_(options.bus, options.moves()) {
    const master::ObjectCatalogue& catalogue = sheet ? *sheet : link_.catalogue();
    std::vector<sampling::Channel> channels;
    for (const std::string& text : options.channels) put(channels, channel_of(text, catalogue));
    if (options.channels.empty()) channels = usual_channels(link_, catalogue);
    recorder_options_.pre = time_of(options.pre_s);
    if (options.duration_s || !script) {
      recorder_options_.duration = time_of(options.duration_s.value_or(usual_duration_s));
    }
    if (trigger) {
      recorder_options_.trigger = trigger->trigger;
      recorder_options_.trigger_channel = put(channels, channel_of(trigger->channel, catalogue));
    }
    for (sampling::Channel& channel : channels) sampling::complete(channel, link_.objects());
    sampling::SamplerOptions sampler_options{
        .polls = options.polls, .moves = script.has_value(), .distributed_clocks = options.bus.clocks};
    if (options.rate_hz) sampler_options.period = time_of(1.0 / *options.rate_hz);
    sampler_ = link_.open_sampler(std::move(channels), sampler_options);
  }

  Outcome run() {
    Outcome outcome{.channels = sampler_->channels(),
                    .remark = sampler_->remark(),
                    .noun = link_.noun(),
                    .address = link_.objects().address()};
    const auto attempt = [&](auto&& call) {
      try {
        call();
      } catch (const std::runtime_error& error) {
        outcome.problems.emplace_back(error.what());
      }
    };
    {
      sampling::SamplerRecorder recorder(*sampler_, recorder_options_);
      attempt([&] { script_ ? move(recorder, outcome) : look(recorder, outcome); });
      outcome.recording = recorder.recording();
      if (recorder.is_full())
        outcome.problems.emplace_back("the recording ended early: it reached its limit of 160 MB");
    }
    // Wall-clock time of the trigger.
    const master::Time ago = link_.objects().now() - outcome.recording.zero;
    outcome.recording.zero_unix_ns = (links::wall_now() - ago).count();
    attempt([&] { sampler_->close(); });
    return outcome;
  }

 private:
  void look(sampling::SamplerRecorder& recorder, Outcome& outcome) {
    const master::Time give_up = link_.objects().now() + options_.bus.timeout();
    while (!recorder.done()) {
      if ((outcome.interrupted = InterruptGuard::interrupted())) return;
      if (recorder.waits_for_trigger() && link_.objects().now() >= give_up) {
        throw std::runtime_error(
            fmt::format("the trigger \"{}\" did not occur within {:g} s", options_.trigger, options_.bus.timeout_s));
      }
      sampler_->objects().wait(patience);
      sampler_->check();
    }
  }

  // Runs the script; then records until a given duration is over.
  void move(sampling::SamplerRecorder& recorder, Outcome& outcome) {
    link_.be_watched(options_.bus);
    const auto axis = link_.open_axis(sampler_->objects(), {});
    master::Axis402* const axes[] = {axis.get()};
    master::script::Cancellation cancellation(InterruptGuard::interrupted);
    master::script::RunOptions run_options;
    run_options.cancellation = &cancellation;
    run_options.done = [&](const master::script::Step& step, master::Time, const std::string& said) {
      const bool speaks = step.verb == master::script::Verb::print || step.verb == master::script::Verb::get ||
                          step.verb == master::script::Verb::wait_probe;
      if (speaks) outcome.said.push_back(said);
      if (speaks && options_.prints_text()) fmt::print("{}\n", said);
      if (std::fflush(stdout) != 0) throw Failure::lost_output();
      sampler_->check();
    };
    // A slave that leaves OP while its motor is on goes to fault.
    const bool ends_operation = bus_kind(options_.bus).kind == BusKind::ethercat;
    try {
      master::script::run(*script_, axes, run_options);
      if (recorder.waits_for_trigger()) {
        throw std::runtime_error(
            fmt::format("the trigger \"{}\" did not occur while the script ran", options_.trigger));
      }
      if (recorder_options_.duration) look(recorder, outcome);
      if (ends_operation || options_.disable) {
        axis->stop();
        axis->disable();
      }
    } catch (const std::runtime_error&) {
      outcome.interrupted = InterruptGuard::interrupted();
      axis->try_to_switch_off();
      throw;
    }
  }

  const Options& options_;
  const std::optional<master::script::Script>& script_;
  DriveLink link_;
  scope::RecorderOptions recorder_options_;
  std::unique_ptr<sampling::Sampler> sampler_;
};

// ---- Results ----

unsigned terminal_columns() {
  const unsigned width = terminal_width();
  return width > 30 ? width : 80;
}

std::string step_text(const std::string& name, const scope::StepResponse& step) {
  return fmt::format(
      "{}: step from {} to {} at {:.4g} s: rise {:.4g} s, overshoot {:.3g} %, within 2 % after {:.4g} s\n", name,
      scope::text_of_number(step.from), scope::text_of_number(step.to), step.begin_s, step.rise_s,
      step.overshoot_percent, step.settling_s);
}

std::string text_of(const Options& options, const Outcome& outcome) {
  const scope::Recording& recording = outcome.recording;
  std::string text;
  if (options.plot || on_terminal()) {
    constexpr unsigned scale_and_edge = 14;
    text += scope::terminal_plot_of(recording, terminal_columns() - scale_and_edge, 6);
  }
  const double span = recording.seconds(recording.rows() - 1, 0) - recording.seconds(0, 0);
  text +=
      fmt::format("{} {}: {} samples of {} {} in {:.3f} s, {:.1f} Hz, by {}{}\n", outcome.noun, outcome.address,
                  recording.rows(), recording.channels.size(), recording.channels.size() == 1 ? "channel" : "channels",
                  span, recording.rate_hz(), recording.way, recording.triggered ? ", triggered" : "");
  if (recording.missed != 0) {
    text += fmt::format("{} samples were missed; choose a lower --rate\n", recording.missed);
  }
  if (!outcome.remark.empty()) text += outcome.remark + '\n';
  text += fmt::format("{:<28} {:<8} {:>13} {:>13} {:>13} {:>13}\n", "channel", "unit", "min", "max", "mean", "RMS");
  std::string steps;
  for (std::size_t i = 0; i < recording.channels.size(); ++i) {
    const scope::Channel& channel = recording.channels[i];
    const scope::Measurement measured = scope::measure(recording, i);
    text += fmt::format("{:<28} {:<8} {:>13} {:>13} {:>13.6g} {:>13.6g}\n", channel.name, channel.unit,
                        scope::text_of_number(measured.least), scope::text_of_number(measured.greatest), measured.mean,
                        measured.rms);
    if (measured.step) steps += step_text(channel.name, *measured.step);
  }
  return text + steps;
}

ordered_json json_of_channel(const Outcome& outcome, std::size_t i, bool samples) {
  const scope::Recording& recording = outcome.recording;
  const sampling::Channel& channel = outcome.channels[i];
  ordered_json json{{"name", channel.name},
                    {"object", master::text_of(channel.object)},
                    {"type", master::short_word(*channel.type)},
                    {"unit", channel.unit}};
  if (recording.rows() == 0) return json;
  const scope::Measurement measured = scope::measure(recording, i);
  json.update(
      {{"least", measured.least}, {"greatest", measured.greatest}, {"mean", measured.mean}, {"rms", measured.rms}});
  json["step"] = nullptr;
  if (measured.step) {
    json["step"] = {{"from", measured.step->from},
                    {"to", measured.step->to},
                    {"begin_s", measured.step->begin_s},
                    {"rise_s", measured.step->rise_s},
                    {"overshoot_percent", measured.step->overshoot_percent},
                    {"settling_s", measured.step->settling_s}};
  }
  if (!samples) return json;
  ordered_json seconds = ordered_json::array();
  ordered_json values = ordered_json::array();
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    seconds.push_back(recording.seconds(row, i));
    values.push_back(recording.value(row, i));
  }
  json["seconds"] = std::move(seconds);
  json["values"] = std::move(values);
  return json;
}

ordered_json json_of(const Options& options, const Outcome& outcome, const std::vector<std::string>& written) {
  const scope::Recording& recording = outcome.recording;
  ordered_json json{{"node", outcome.address},
                    {"rows", recording.rows()},
                    {"rate_hz", recording.rate_hz()},
                    {"missed", recording.missed},
                    {"way", recording.way},
                    {"remark", outcome.remark},
                    {"trigger", options.trigger},
                    {"triggered", recording.triggered},
                    {"interrupted", outcome.interrupted},
                    {"said", outcome.said},
                    {"problems", outcome.problems},
                    {"files", written}};
  json["channels"] = ordered_json::array();
  for (std::size_t i = 0; i < recording.channels.size(); ++i) {
    json["channels"].push_back(json_of_channel(outcome, i, options.files.empty()));
  }
  return json;
}

void record(const Options& given) {
  Options options = given;
  for (const std::string& file : options.files) {
    format_of(file);
    if (file != "-") require_writable(file);
  }
  std::optional<scope::TriggerText> trigger;
  try {
    if (!options.trigger.empty()) trigger = scope::parse_trigger(options.trigger);
  } catch (const scope::TriggerError& error) {
    throw Failure::wrong_use(fmt::format("{}; {}", error.what(), error.hint()));
  }
  const auto sheet = data_sheet(options.eds);
  const auto script = parsed_script(options, sheet ? &*sheet : nullptr);

  const InterruptGuard guard;
  Outcome outcome = Session(options, trigger, script, sheet).run();
  std::vector<std::string> written;
  std::string to_output;
  if (outcome.recording.rows() != 0) {
    for (const std::string& file : options.files) {
      const std::string text = format_of(file).text(outcome.recording);
      if (file == "-") {
        to_output += text;
        continue;
      }
      try {
        write_whole_file(file, text);
        written.push_back(file);
      } catch (const Failure& failure) {
        outcome.problems.emplace_back(failure.what());
      }
    }
  }
  if (options.bus.json) {
    fmt::print("{}\n", json_of(options, outcome, written).dump(2));
  } else if (!to_output.empty()) {
    fmt::print("{}", to_output);
  } else if (outcome.recording.rows() != 0) {
    fmt::print("{}", text_of(options, outcome));
    for (const std::string& file : written) fmt::print("written: {}\n", file);
  }
  std::fflush(stdout);
  if (outcome.recording.rows() == 0 && outcome.problems.empty()) outcome.problems.emplace_back("nothing was recorded");
  if (outcome.problems.empty()) return;
  std::string message;
  for (const std::string& problem : outcome.problems) message += (message.empty() ? "" : "\n") + problem;
  throw Failure::did_not_work(message);
}

}  // namespace scope_command

void add_scope(CLI::App& app) {
  const auto [command, options] =
      add_command(app, "scope",
                  "Record objects of a drive, by process data if the bus has them, else by reading; with "
                  "trigger, measurements, files and a plot. Ctrl-C ends the recording and keeps its samples",
                  scope_command::record);
  command->add_option(
      "CHANNEL", options->channels,
      "Up to 16 objects: INDEX[:SUB], a name, or position, velocity, torque, current, following_error, inputs, mode, "
      "voltage; append @TYPE if the type is not known. Position, velocity and torque if none is given");
  command
      ->add_option("--rate", options->rate_hz,
                   "Samples per second: up to 4000 on EtherCAT (500 if not given), up to 1000 on CAN (250), otherwise "
                   "as fast as the drive answers")
      ->check(number_within(0.01, 1e4));
  add_seconds_option(*command, options->duration_s,
                     "Duration in seconds, from the trigger if there is one; if not given 1, or with --run or --do "
                     "until the script ends")
      ->check(number_within(0.001, 1e6));
  command->add_option(
      "--trigger", options->trigger,
      "Start when CHANNEL rises|falls|becomes|sets|has|lacks VALUE, CHANNEL ==|!=|<|<=|>|>= VALUE, CHANNEL "
      "changes|appears, or fault");
  command->add_option("--pre", options->pre_s, "Seconds to record before the trigger")
      ->check(number_within(0.0, 1e6))
      ->capture_default_str();
  command->add_option("--run", options->script, "Motion script (docs/script.md) to run during the recording");
  command
      ->add_option("--do", options->script_lines,
                   "A line of such a script, e.g. --do enable --do 'move by 1000'; several are run in order")
      ->allow_extra_args(false)
      ->excludes("--run");
  command->add_flag("--disable", options->disable, "Disable the drive when the script has ended (on EtherCAT always)");
  command->add_flag("--poll", options->polls, "Read the objects without changing process data");
  command->add_option("-o,--output", options->files, "File to write: .csv, .mcap or .svg; - for CSV to the output")
      ->allow_extra_args(false);
  command->add_flag("--plot", options->plot, "Plot also if the output is not a terminal");
  command->add_option("--eds", options->eds, "Electronic data sheet with the drive's own objects, names and types");
  add_drive_options(*command, options->bus, "Seconds to wait for the trigger");
  add_watch_option(*command, options->bus);
  command->add_flag("--clocks", options->bus.clocks, "EtherCAT: distributed clocks with SYNC0, instead of free run");
}

}  // namespace servodrome::app
