// deformctl load: puts load on a server and measures what comes back.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/cli/command.h"
#include "client/cli/duration.h"
#include "client/cli/exit_code.h"
#include "client/cli/frame_options.h"
#include "client/cli/load_picture.h"
#include "client/cli/load_stage.h"
#include "client/cli/load_text.h"
#include "client/load/find_limit.h"
#include "client/load/load_run.h"
#include "client/pictures/image.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

constexpr int64_t kMaxSessions = 4096;
constexpr int64_t kMaxParticipants = 10000;
// Participants that share a connection unless --connections says how many
// there are to be; a server takes some hundreds of streams on one.
constexpr int64_t kPerConnection = 16;
constexpr int64_t kMaxConnections = 256;
// Tidying up after a server that is gone is not to take for ever.
constexpr std::chrono::seconds kCallTimeout{10};

struct Options {
  LoadStageOptions stage;
  LoadOptions load;
  FrameOptions frames;
  bool normals = false;
  std::string delivery = "latest";
  std::string duration = "10s";
  std::string warm_up = "1s";
  std::string check = "1s";
  std::string p99;
  int64_t connections = 0;
  bool find_limit = false;
  int64_t most = kMaxSessions;
  double resolution = 0.05;
  std::string png;

  std::chrono::nanoseconds p99_limit{0};
};

// What the options mean together.
absl::Status Complete(Options& options) {
  LoadOptions& load = options.load;
  DEFORM_ASSIGN_OR_RETURN(
      load.duration,
      ParseDuration("--duration", options.duration, "100ms", "1h"));
  DEFORM_ASSIGN_OR_RETURN(
      load.warm_up, ParseDuration("--warm-up", options.warm_up, "0s", "10m"));
  DEFORM_ASSIGN_OR_RETURN(load.check_interval,
                          ParseDuration("--check", options.check, "0s", "1h"));
  if (!options.p99.empty()) {
    DEFORM_ASSIGN_OR_RETURN(options.p99_limit,
                            ParseDuration("--p99", options.p99, "10us", "1m"));
  } else if (options.find_limit) {
    return UsageError("--find-limit needs the limit, such as --p99 5ms");
  }
  DEFORM_ASSIGN_OR_RETURN(
      load.frames,
      options.frames.For(options.delivery == "every" ? Delivery::kEvery
                                                     : Delivery::kLatest));
  if (load.viewer_fps > 0 && options.delivery == "every") {
    return UsageError(
        "--viewer-fps leaves frames out: it needs --delivery latest");
  }
  load.frames.normals = options.normals;
  options.stage.frame_tolerance = options.frames.tolerance;
  options.stage.hold_weights = options.frames.Need(Needs::kWeights);
  options.stage.hold_basis = options.frames.Need(Needs::kBasis);
  options.stage.check = load.check_interval.count() > 0;
  options.stage.editors = load.editors;
  options.stage.rate = load.rate;
  if (!options.stage.poses.empty()) options.stage.pattern = "recorded";
  if (options.stage.pattern == "recorded" && options.stage.poses.empty()) {
    return UsageError("--pattern recorded needs the poses: --poses FILE");
  }
  const int64_t each = load.editors + load.viewers;
  if (load.sessions * each > kMaxParticipants) {
    return UsageError(absl::StrCat(
        "these are ", Thousands(load.sessions * each), " participants; ",
        Thousands(kMaxParticipants), " are the most that one client plays"));
  }
  return absl::OkStatus();
}

int64_t Connections(const Options& options, int64_t sessions) {
  const int64_t participants =
      sessions * (options.load.editors + options.load.viewers);
  if (options.connections > 0) {
    return std::min(options.connections, participants);
  }
  return std::clamp<int64_t>(
      (participants + kPerConnection - 1) / kPerConnection, 1, kMaxConnections);
}

absl::StatusOr<std::vector<Client>> ConnectAll(Context& context,
                                               int64_t count) {
  const Globals& globals = context.globals;
  const ClientOptions options{
      .tenant = globals.tenant,
      .connect_timeout = std::chrono::milliseconds(
          static_cast<int64_t>(1000 * globals.connect_timeout_s)),
      .call_timeout = kCallTimeout,
      .own_connection = true};
  std::vector<Client> clients;
  for (int64_t i = 0; i < count; ++i) {
    DEFORM_ASSIGN_OR_RETURN(Client client,
                            Client::Connect(globals.server, options));
    clients.push_back(std::move(client));
  }
  return clients;
}

// Redrawn on a terminal, and gone at the end; nothing elsewhere.
class LiveView {
 public:
  explicit LiveView(Console& console) : console_(console) {}
  ~LiveView() { Clear(); }
  void Show(const std::string& line) {
    if (!console_.terminal() || console_.json()) return;
    console_.err() << "\r\x1b[K" << line << std::flush;
    shown_ = true;
  }
  void Clear() {
    if (std::exchange(shown_, false))
      console_.err() << "\r\x1b[K" << std::flush;
  }

 private:
  Console& console_;
  bool shown_ = false;
};

class LoadCommandRun {
 public:
  LoadCommandRun(const Options& options, Context& context)
      : options_(options), context_(context) {}

  absl::Status Do() {
    context_.interruption.expected = true;
    DEFORM_ASSIGN_OR_RETURN(std::vector<Client> clients,
                            ConnectAll(context_, 1));
    LoadStage stage(clients.front());
    DEFORM_RETURN_IF_ERROR(stage.Prepare(context_, options_.stage));
    stage_ = &stage;
    const absl::Status status = options_.find_limit ? FindIt() : RunOnce();
    const absl::Status closed = stage.Close();
    return status.ok() ? closed : status;
  }

 private:
  LoadSubject SubjectOf(int64_t sessions) const {
    LoadSubject subject{
        .options = options_.load,
        .pattern = options_.stage.pattern,
        .scheme = stage_->scheme(),
        .models = static_cast<int64_t>(stage_->targets().size()),
        .points = stage_->targets().front().point_count,
        .columns = stage_->columns(),
        .tolerance = options_.stage.tolerance,
        .p99_limit = options_.p99_limit};
    subject.options.sessions = sessions;
    return subject;
  }

  absl::StatusOr<LoadReport> Trial(const LoadSubject& subject) {
    DEFORM_ASSIGN_OR_RETURN(
        std::vector<Client> clients,
        ConnectAll(context_, Connections(options_, subject.options.sessions)));
    LiveView view(context_.console);
    const LoadControl control{.interrupted = &context_.interruption.requested,
                              .progress = [&](const LoadProgress& progress) {
                                view.Show(LiveLine(progress));
                              }};
    return RunLoad(clients, stage_->targets(), subject.options, control);
  }

  absl::Status RunOnce() {
    const LoadSubject subject = SubjectOf(options_.load.sessions);
    DEFORM_ASSIGN_OR_RETURN(const LoadReport report, Trial(subject));
    DEFORM_RETURN_IF_ERROR(WritePicture(report));
    context_.console.Result(ToJson(subject, report), [&](std::ostream& out) {
      Describe(subject, report, out);
    });
    return LoadFailure(subject, report).empty() ? absl::OkStatus() : Failed();
  }

  // Whether so many sessions hold; the trial is told, and kept if it is the
  // best so far. A server that has no room for them does not hold them.
  absl::StatusOr<bool> Try(int64_t sessions) {
    const LoadSubject subject = SubjectOf(sessions);
    absl::StatusOr<LoadReport> report = Trial(subject);
    if (absl::IsResourceExhausted(report.status())) {
      TellTrial(absl::StrCat(Thousands(sessions), " sessions: refused, ",
                             report.status().message()));
      return false;
    }
    DEFORM_RETURN_IF_ERROR(report.status());
    trials_.push_back(ToJson(subject, *report));
    TellTrial(TrialLine(sessions, subject, *report));
    if (report->checks.wrong) return Failed();
    const bool holds = LoadFailure(subject, *report).empty();
    if (holds) best_.emplace(subject, *std::move(report));
    return holds;
  }

  void TellTrial(const std::string& line) {
    if (!context_.console.json()) context_.console.out() << line << std::endl;
  }

  absl::Status FindIt() {
    const absl::StatusOr<FoundLimit> found =
        FindLimit({.first = options_.load.sessions,
                   .most = std::min(options_.most, MostSessions()),
                   .resolution = options_.resolution},
                  [&](int64_t sessions) { return Try(sessions); });
    // A wrong frame has been told.
    const bool wrong = DetailOf(found.status()).reason == "CHECK_FAILED";
    if (!found.ok() && !wrong) return found.status();
    const FoundLimit limit = found.value_or(FoundLimit());
    if (best_) DEFORM_RETURN_IF_ERROR(WritePicture(best_->second));
    context_.console.Result({{"ok", limit.holds > 0},
                             {"sessions", limit.holds},
                             {"fails_with", limit.fails},
                             {"p99_limit_ms", Milliseconds(options_.p99_limit)},
                             {"resolution", options_.resolution},
                             {"trials", trials_}},
                            [&](std::ostream& out) {
                              if (!wrong) out << LimitText(limit);
                              if (best_ && !wrong)
                                Describe(best_->first, best_->second, out);
                            });
    return limit.holds > 0 ? absl::OkStatus() : Failed();
  }

  int64_t MostSessions() const {
    return kMaxParticipants / (options_.load.editors + options_.load.viewers);
  }

  std::string LimitText(const FoundLimit& found) const {
    if (found.holds == 0) {
      return absl::StrFormat("not even one session holds p99 %s\n",
                             options_.p99);
    }
    return absl::StrFormat(
        "%s sessions hold p99 %s; %s\n", Thousands(found.holds), options_.p99,
        found.fails == 0 ? "more were not tried"
                         : absl::StrCat(Thousands(found.fails), " do not"));
  }

  absl::Status WritePicture(const LoadReport& report) const {
    if (options_.png.empty()) return absl::OkStatus();
    const absl::Status status = WritePng(DrawLoad(report), options_.png);
    return status.ok() ? status : WithExit(kBadFile, status);
  }

  // What failed is in the result.
  static absl::Status Failed() {
    return WithExit(kCheckFailed,
                    MakeError(absl::StatusCode::kFailedPrecondition,
                              "the run failed", {.reason = "CHECK_FAILED"}));
  }

  const Options& options_;
  Context& context_;
  const LoadStage* stage_ = nullptr;
  Json trials_ = Json::array();
  std::optional<std::pair<LoadSubject, LoadReport>> best_;
};

void AddModelOptions(CLI::App& app, LoadStageOptions& stage) {
  auto* const binding =
      app.add_option("--binding", stage.binding,
                     "Pose this binding; without it models are generated, and "
                     "deleted at the end")
          ->type_name("BINDING");
  app.add_option("--points", stage.points, "Points of a generated model, about")
      ->check(CLI::Range(int64_t{100}, int64_t{1000000}))
      ->capture_default_str()
      ->excludes(binding);
  auto* const faces = app.add_option("--cage-faces", stage.cage_faces,
                                     "Triangles of its cage, about")
                          ->check(CLI::Range(20, 10000))
                          ->capture_default_str()
                          ->excludes(binding);
  app.add_option("--handles", stage.handles,
                 "Instead of a cage: so many free handles")
      ->check(CLI::Range(1, 1000))
      ->type_name("N")
      ->excludes(binding)
      ->excludes(faces);
  app.add_option("--models", stage.models,
                 "Different models, shared out among the sessions: sessions of "
                 "one are deformed together")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str()
      ->excludes(binding);
  app.add_option("--pattern", stage.pattern,
                 "drag: a vertex along a smooth path; jitter: all at random; "
                 "whole: the rig bends; recorded: --poses")
      ->check(CLI::IsMember(LoadPatterns()))
      ->capture_default_str();
  app.add_option("--poses", stage.poses,
                 "Posed cages or handles, or folders of them, sent in turn")
      ->type_name("FILE");
  app.add_option("--tolerance", stage.tolerance,
                 "What a position may be off, as a part of the rig's diagonal, "
                 "beside the tolerances of compressed weights and of frames")
      ->check(CLI::Range(1e-9, 1.0))
      ->capture_default_str();
}

void AddLoadOptions(CLI::App& app, Options& options) {
  LoadOptions& load = options.load;
  app.add_option("--sessions", load.sessions, "Sessions at a time")
      ->check(CLI::Range(int64_t{1}, kMaxSessions))
      ->capture_default_str();
  app.add_option("--editors", load.editors,
                 "Of each session: participants that send poses")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option("--viewers", load.viewers,
                 "Of each session: participants that only watch")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
  app.add_option("--viewer-fps", load.viewer_fps,
                 "Frames a second of each viewer, at most; 0: as they come")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str()
      ->type_name("HZ");
  app.add_option("--rate", load.rate, "Poses a second of each editor")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str()
      ->type_name("HZ");
  app.add_option("--duration", options.duration, "How long to measure")
      ->capture_default_str()
      ->type_name("TIME");
  app.add_option("--warm-up", options.warm_up, "How long to wait before")
      ->capture_default_str()
      ->type_name("TIME");
  app.add_option("--delivery", options.delivery,
                 "latest: the newest state, poses may merge; every: a frame "
                 "for each pose")
      ->check(CLI::IsMember({"latest", "every"}))
      ->capture_default_str();
  options.frames.AddTo(app);
  app.add_flag("--normals", options.normals,
               "Frames with normals of their vertices: two bytes each");
  app.add_option("--connections", options.connections,
                 "Connections that the participants share; 0: one for 16")
      ->check(CLI::Range(int64_t{0}, kMaxConnections))
      ->capture_default_str();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  AddLoadOptions(app, *options);
  AddModelOptions(app, options->stage);
  app.add_option("--check", options->check,
                 "Look at a frame of each session once in this time, and fail "
                 "if it is wrong; 0s: never")
      ->capture_default_str()
      ->type_name("TIME");
  app.add_option("--p99", options->p99,
                 "Fail if the 99th percentile of pose to frame is longer")
      ->type_name("TIME");
  app.add_flag("--find-limit", options->find_limit,
               "Find the largest number of sessions that holds --p99, from "
               "--sessions on; each trial takes --duration");
  app.add_option("--most", options->most, "How many sessions it tries at most")
      ->check(CLI::Range(int64_t{1}, kMaxSessions))
      ->capture_default_str();
  app.add_option("--resolution", options->resolution,
                 "How exactly, as a part of that number")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  app.add_option("--png", options->png,
                 "Also draw it: over time, and how often")
      ->type_name("FILE");
  return [options](Context& context) -> absl::Status {
    DEFORM_RETURN_IF_ERROR(Complete(*options));
    return LoadCommandRun(*options, context).Do();
  };
}

}  // namespace

const Command& LoadCommand() {
  static const Command command = {
      "load", "Put load on a server, measure it, and check what it answers",
      "deformctl load --sessions 100 --rate 60 --duration 20s\n"
      "deformctl load --sessions 4 --points 173000 --pattern whole --png "
      "l.png\n"
      "deformctl load --sessions 4 --points 173000 --frame-tolerance 1e-5\n"
      "deformctl load --sessions 1 --editors 8 --viewers 32 --json\n"
      "deformctl load --binding $binding --poses poses/ --delivery every\n"
      "deformctl load --find-limit --p99 5ms --duration 5s",
      "", Setup};
  return command;
}

}  // namespace deform::cli
