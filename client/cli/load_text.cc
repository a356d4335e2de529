#include "client/cli/load_text.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace deform::cli {
namespace {

constexpr struct {
  const char* name;
  double part;
} kParts[] = {{"p50", 0.5}, {"p90", 0.9}, {"p99", 0.99}, {"p99.9", 0.999}};

double Ms(const LatencyHistogram& latency, double part) {
  return Milliseconds(latency.Percentile(part));
}

double PerSecond(int64_t count, double seconds) {
  return static_cast<double>(count) / std::max(seconds, 1e-9);
}

std::string RatePerSecond(int64_t count, double seconds) {
  return Thousands(static_cast<int64_t>(PerSecond(count, seconds) + 0.5));
}

std::string BytesPerSecond(int64_t bytes, double seconds) {
  return absl::StrCat(Bytes(static_cast<int64_t>(PerSecond(bytes, seconds))),
                      "/s");
}

// "1 session", "2 sessions".
std::string Counted(int64_t count, const char* what) {
  return absl::StrCat(Thousands(count), " ", what, count == 1 ? "" : "s");
}

Json LatencyJson(const LatencyHistogram& latency) {
  Json json = {{"count", latency.count()}};
  for (const auto& [name, part] : kParts) json[name] = Ms(latency, part);
  json["max"] = Milliseconds(latency.max());
  return json;
}

std::string LatencyText(const LatencyHistogram& latency) {
  std::string text;
  for (const auto& [name, part] : kParts) {
    absl::StrAppendFormat(&text, "%s %.2f, ", name, Ms(latency, part));
  }
  absl::StrAppendFormat(&text, "max %.2f ms", Milliseconds(latency.max()));
  return text;
}

Json ChecksJson(const LoadSubject& subject, const LoadReport& report) {
  Json json = {{"frames", report.checks.frames},
               {"points", report.checks.points},
               {"dropped", report.checks.dropped},
               {"sessions_unchecked", report.sessions_unchecked},
               {"tolerance", subject.tolerance},
               {"worst", report.checks.worst}};
  if (const auto& wrong = report.checks.wrong) {
    json["wrong"] = {{"session", report.wrong_session},
                     {"revision", wrong->revision},
                     {"vertex", wrong->vertex},
                     {"error", wrong->error}};
  }
  return json;
}

Json ClientJson(const LoadReport& report) {
  return {{"kept_schedule", report.kept_schedule()},
          {"late_part", report.LatePart()},
          {"lateness_ms", LatencyJson(report.figures.lateness)},
          {"held_back", report.figures.held_back},
          {"processors_used", report.client_cpus}};
}

Json SamplesJson(const LoadReport& report) {
  Json samples = Json::array();
  for (const ServerSample& sample : report.server_over_time) {
    samples.push_back({{"begin", sample.seconds},
                       {"resident_bytes", sample.resident_bytes},
                       {"open_files", sample.open_files}});
  }
  return samples;
}

// Of one thing that the server told over time.
struct Course {
  int64_t begin = 0, most = 0, end = 0;
};
Course CourseOf(const LoadReport& report, int64_t ServerSample::*what) {
  const auto& samples = report.server_over_time;
  if (samples.empty()) return {};
  Course course{.begin = samples.front().*what, .end = samples.back().*what};
  for (const ServerSample& sample : samples) {
    course.most = std::max(course.most, sample.*what);
  }
  return course;
}

Json CourseJson(const LoadReport& report, int64_t ServerSample::*what) {
  const Course course = CourseOf(report, what);
  return {{"begin", course.begin}, {"most", course.most}, {"end", course.end}};
}

Json ServerJson(const LoadReport& report) {
  return {{"processors_used", report.server_cpus},
          {"processors", report.server_processors},
          {"resident_bytes", CourseJson(report, &ServerSample::resident_bytes)},
          {"open_files", CourseJson(report, &ServerSample::open_files)},
          {"over_time", SamplesJson(report)}};
}

std::string ServerText(const LoadReport& report) {
  const Course memory = CourseOf(report, &ServerSample::resident_bytes);
  const Course files = CourseOf(report, &ServerSample::open_files);
  return absl::StrFormat(
      "%.2f of %d processors; %s resident, at most %s, in the end %s; %d files "
      "open, at most %d, in the end %d",
      report.server_cpus, report.server_processors, Bytes(memory.begin),
      Bytes(memory.most), Bytes(memory.end), files.begin, files.most,
      files.end);
}

double BytesPerFrame(const LoadFigures& figures) {
  return static_cast<double>(figures.bytes) /
         static_cast<double>(std::max<int64_t>(1, figures.frames));
}

std::string LateWarning(const LoadReport& report) {
  return absl::StrFormat(
      "THE CLIENT WAS LATE: it sent %.1f %% of the poses more than 1 ms after "
      "they were due (p99 %.1f ms), so these figures are about the client and "
      "its machine as much as about the server",
      100 * report.LatePart(), Ms(report.figures.lateness, 0.99));
}

}  // namespace

std::string LoadFailure(const LoadSubject& subject, const LoadReport& report) {
  if (const auto& wrong = report.checks.wrong) {
    return absl::StrFormat(
        "session %s, revision %d: vertex %d is off by %.3g D, more than %.3g D",
        report.wrong_session, wrong->revision, wrong->vertex, wrong->error,
        subject.tolerance);
  }
  if (!report.complete()) {
    return absl::StrFormat(
        "%s of %s poses were not answered within %s",
        Thousands(report.poses_due - report.poses_answered),
        Thousands(report.poses_due),
        Seconds(
            std::chrono::duration<double>(subject.options.patience).count()));
  }
  const auto p99 = report.figures.Latency().Percentile(0.99);
  if (subject.p99_limit.count() > 0 && p99 > subject.p99_limit) {
    return absl::StrFormat("p99 is %.2f ms, more than %.2f ms",
                           Milliseconds(p99), Milliseconds(subject.p99_limit));
  }
  return "";
}

Json ToJson(const LoadSubject& subject, const LoadReport& report) {
  const LoadOptions& options = subject.options;
  const LoadFigures& figures = report.figures;
  Json seconds = Json::array();
  for (const LoadFigures::Interval& interval : figures.intervals) {
    Json one = {{"begin", interval.begin}};
    one.update(LatencyJson(interval.latency));
    seconds.push_back(std::move(one));
  }
  const std::string failure = LoadFailure(subject, report);
  return {{"ok", failure.empty()},
          {"failure", failure},
          {"sessions", options.sessions},
          {"editors", options.editors},
          {"viewers", options.viewers},
          {"viewer_fps", options.viewer_fps},
          {"rate", options.rate},
          {"delivery",
           options.frames.delivery == Delivery::kEvery ? "every" : "latest"},
          {"pattern", subject.pattern},
          {"scheme", subject.scheme},
          {"models", subject.models},
          {"point_count", subject.points},
          {"column_count", subject.columns},
          {"connections", report.connections},
          {"seconds", report.seconds},
          {"latency_ms", LatencyJson(figures.Latency())},
          {"latency_ms_over_time", std::move(seconds)},
          {"poses",
           {{"due", report.poses_due},
            {"sent", report.poses_sent},
            {"answered", report.poses_answered}}},
          {"frames", figures.frames},
          {"frames_per_second", PerSecond(figures.frames, report.seconds)},
          {"bytes", figures.bytes},
          {"bytes_per_frame", BytesPerFrame(figures)},
          {"frame_tolerance", options.frames.tolerance_fraction.value_or(0)},
          {"normals", options.frames.normals},
          {"bytes_per_second", PerSecond(figures.bytes, report.seconds)},
          {"skipped_revisions", figures.skipped},
          {"deform_us_mean",
           static_cast<double>(figures.deform_us) /
               static_cast<double>(std::max<int64_t>(1, figures.answering))},
          {"server", ServerJson(report)},
          {"client", ClientJson(report)},
          {"checks", ChecksJson(subject, report)}};
}

void Describe(const LoadSubject& subject, const LoadReport& report,
              std::ostream& out) {
  const LoadOptions& options = subject.options;
  const LoadFigures& figures = report.figures;
  const auto line = [&](const char* name, const std::string& text) {
    out << absl::StrFormat("%-14s %s\n", name, text);
  };
  line("load",
       absl::StrFormat(
           "%s, each %s at %g Hz (%s, %s) and %s, over %s",
           Counted(options.sessions, "session"),
           Counted(options.editors, "editor"), options.rate, subject.pattern,
           options.frames.delivery == Delivery::kEvery ? "every" : "latest",
           Counted(options.viewers, "viewer"),
           Counted(report.connections, "connection")));
  line("models",
       absl::StrFormat("%s of %s points, %s, %s weight columns",
                       Thousands(subject.models), Thousands(subject.points),
                       subject.scheme, Thousands(subject.columns)));
  line("measured",
       absl::StrFormat(
           "%s, after %s of warm-up", Seconds(report.seconds),
           Seconds(std::chrono::duration<double>(options.warm_up).count())));
  line("pose to frame", LatencyText(figures.Latency()));
  line("frames",
       absl::StrCat(RatePerSecond(figures.frames, report.seconds), "/s, ",
                    BytesPerSecond(figures.bytes, report.seconds), ", ",
                    Bytes(static_cast<int64_t>(BytesPerFrame(figures))),
                    " each, ", Thousands(figures.skipped),
                    " revisions skipped"));
  line("poses", absl::StrCat(Thousands(report.poses_due), " due, ",
                             Thousands(report.poses_sent), " sent, ",
                             Thousands(report.poses_answered), " answered"));
  if (!report.server_over_time.empty()) line("server", ServerText(report));
  line("client",
       absl::StrFormat("%.2f processors, %.2f %% of the poses sent late, %s "
                       "held back by the connection",
                       report.client_cpus, 100 * report.LatePart(),
                       Thousands(figures.held_back)));
  line("checked",
       absl::StrFormat("%s frames, %s points: at most %.2g D off%s",
                       Thousands(report.checks.frames),
                       Thousands(report.checks.points), report.checks.worst,
                       report.sessions_unchecked == 0
                           ? ""
                           : absl::StrCat("; none of ",
                                          Thousands(report.sessions_unchecked),
                                          " sessions")));
  if (!report.kept_schedule()) out << LateWarning(report) << "\n";
  const std::string failure = LoadFailure(subject, report);
  if (!failure.empty()) out << "FAILED: " << failure << "\n";
}

std::string LiveLine(const LoadProgress& progress) {
  // The last interval that is likely to be answered.
  const auto& intervals = progress.figures.intervals;
  const LoadFigures::Interval* last = nullptr;
  for (const auto& interval : intervals) {
    if (interval.latency.count() > 0) last = &interval;
  }
  std::string text =
      absl::StrFormat("%.0f of %.0f s", progress.seconds, progress.total);
  if (last == nullptr) return text + "  warming up";
  absl::StrAppendFormat(&text, "  p50 %.2f  p99 %.2f  max %.2f ms",
                        Ms(last->latency, 0.5), Ms(last->latency, 0.99),
                        Milliseconds(last->latency.max()));
  absl::StrAppend(&text, "  ", Thousands(progress.figures.frames), " frames, ",
                  Bytes(progress.figures.bytes));
  if (progress.server) {
    absl::StrAppend(&text, "  server ", Bytes(progress.server->resident_bytes));
  }
  return text;
}

std::string TrialLine(int64_t sessions, const LoadSubject& subject,
                      const LoadReport& report) {
  const std::string failure = LoadFailure(subject, report);
  return absl::StrFormat(
      "%s: %s; server %.2f, client %.2f processors: %s%s",
      Counted(sessions, "session"), LatencyText(report.figures.Latency()),
      report.server_cpus, report.client_cpus,
      failure.empty() ? "holds" : absl::StrCat("fails, ", failure),
      report.kept_schedule() ? "" : " (the client was late itself)");
}

}  // namespace deform::cli
