#include "client/load/load_run.h"

#include <sys/prctl.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <thread>

#include "absl/strings/str_cat.h"
#include "client/load/load_session.h"
#include "client/load/pose_schedule.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kLook{50};  // Between looks at the run.
constexpr std::chrono::milliseconds kProgress{500};
constexpr std::chrono::milliseconds kServerLook{1000};
constexpr std::chrono::seconds kJoinPatience{30};
constexpr std::chrono::milliseconds kRunUp{50};  // Before the first pose.
constexpr std::chrono::milliseconds kLate{1};
constexpr int64_t kIntervals = 300;  // At most.
// What one thread sends with ease.
constexpr double kPosesPerSender = 10000;
constexpr int64_t kMaxSenders = 4;

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) +
         1e-9 * static_cast<double>(time.tv_nsec);
}

double InSeconds(std::chrono::nanoseconds duration) {
  return std::chrono::duration<double>(duration).count();
}

class Run {
 public:
  Run(std::vector<Client>& clients, const std::vector<LoadTarget>& targets,
      const LoadOptions& options, const LoadControl& control)
      : clients_(clients),
        targets_(targets),
        options_(options),
        control_(control),
        checker_([this](const FrameToCheck& item) { return Judge(item); },
                 [this] {
                   wrong_ = true;
                   changed_.NotifyAll();
                 }) {
    const bool checks = targets.front().judge != nullptr;
    room_.now = [] { return Clock::now(); };
    if (checks) room_.check_interval = options.check_interval;
    room_.check = [this](FrameToCheck item) { Check(std::move(item)); };
    room_.changed = [this] { changed_.NotifyAll(); };
    room_.fail = [this](const absl::Status& status) { Fail(status); };
  }

  ~Run() {
    stop_ = true;
    for (std::thread& sender : senders_) sender.join();
    sessions_.clear();
    DeleteSessions();
  }

  absl::StatusOr<LoadReport> Do() {
    DEFORM_RETURN_IF_ERROR(CreateSessions());
    DEFORM_RETURN_IF_ERROR(Join());
    StartSending();
    DEFORM_RETURN_IF_ERROR(Watch());
    if (!wrong_) DEFORM_RETURN_IF_ERROR(Drain());
    return Report();
  }

 private:
  const LoadTarget& TargetOf(int64_t session) const {
    return targets_[session % static_cast<int64_t>(targets_.size())];
  }

  FrameJudge::Verdict Judge(const FrameToCheck& item) const {
    const LoadTarget& target = TargetOf(item.session);
    return target.judge->Judge(
        item.frame, target.pattern->Merged(item.session, item.sequences));
  }

  void Check(FrameToCheck item) {
    {
      MutexLock lock(mutex_);
      checked_.insert(item.session);
    }
    const int64_t points = TargetOf(item.session).judge->points();
    checker_.Check(std::move(item), points);
  }

  void Fail(const absl::Status& status) {
    {
      MutexLock lock(mutex_);
      failure_.Update(status);
    }
    changed_.NotifyAll();
  }

  // Why the run is to end now; OK: it is not.
  absl::Status Trouble() {
    if (control_.interrupted != nullptr && *control_.interrupted) {
      return absl::CancelledError("interrupted");
    }
    MutexLock lock(mutex_);
    return failure_;
  }

  absl::Status CreateSessions() {
    for (int64_t s = 0; s < options_.sessions; ++s) {
      DEFORM_RETURN_IF_ERROR(Trouble());
      const LoadTarget& target = TargetOf(s);
      DEFORM_ASSIGN_OR_RETURN(
          const SessionInfo info,
          clients_.front().CreateSession(target.binding_id));
      created_.push_back(info.session_id);
      sessions_.push_back(std::make_unique<LoadSession>(
          room_, s, options_.sessions, info.session_id, *target.pattern,
          options_.viewers));
    }
    return absl::OkStatus();
  }

  absl::Status Join() {
    size_t next = 0;
    int64_t number = 0;
    for (const auto& session : sessions_) {
      DeformOptions editing = options_.frames;
      const LoadTarget& target = TargetOf(number++);
      editing.weights = target.weights;
      editing.basis = target.basis;
      DeformOptions viewing = editing;
      viewing.max_fps = options_.viewer_fps;
      for (int p = 0; p < session->participants(); ++p) {
        session->Start(clients_[next++ % clients_.size()], p,
                       p < options_.editors ? editing : viewing);
      }
    }
    const auto deadline = Clock::now() + kJoinPatience;
    while (!All(
        [](const LoadSession& s) { return s.joined() == s.participants(); })) {
      DEFORM_RETURN_IF_ERROR(Trouble());
      if (Clock::now() > deadline) {
        return absl::DeadlineExceededError(
            absl::StrCat("not all participants have joined within ",
                         kJoinPatience.count(), " s"));
      }
      Pause();
    }
    return absl::OkStatus();
  }

  bool All(absl::FunctionRef<bool(const LoadSession&)> is) const {
    return std::all_of(sessions_.begin(), sessions_.end(),
                       [&](const auto& session) { return is(*session); });
  }

  // Until something changes, or a moment later.
  void Pause() {
    MutexLock lock(mutex_);
    changed_.WaitFor(mutex_, kLook);
  }

  void StartSending() {
    const int64_t editors = options_.sessions * options_.editors;
    const std::chrono::nanoseconds period(
        static_cast<int64_t>(std::lround(1e9 / options_.rate)));
    const auto total = options_.warm_up + options_.duration;
    const int64_t each = std::max<int64_t>(1, (total + period / 2) / period);
    const auto start = Clock::now() + kRunUp;
    begin_ = start + options_.warm_up;
    end_ = begin_ + options_.duration;
    const auto interval = std::max<std::chrono::nanoseconds>(
        std::chrono::seconds(1), options_.duration / kIntervals);
    recorder_.emplace(begin_, end_, interval);
    timing_.emplace(LoadRoom::Timing{PoseSchedule(start, period, editors, each),
                                     &*recorder_});
    room_.timing = &*timing_;
    const auto threads =
        static_cast<int64_t>(std::clamp<double>(
            options_.rate * static_cast<double>(editors) / kPosesPerSender, 0,
            kMaxSenders - 1)) +
        1;
    for (int64_t t = 0; t < threads; ++t) {
      senders_.emplace_back([this, t, threads] { Send(t, threads); });
    }
  }

  void Send(int64_t first, int64_t step) {
    // The kernel may otherwise wake this thread 50 us late to save power.
    prctl(PR_SET_TIMERSLACK, 1);
    const PoseSchedule& schedule = timing_->schedule;
    Pace(schedule, first, step,
         {[] { return Clock::now(); },
          [this](Clock::time_point time) {
            // So that an interruption is not overslept.
            std::this_thread::sleep_until(
                std::min(time, Clock::now() + Clock::duration(kLook)));
            return !stop_;
          }},
         [&](const PoseSchedule::Due& due, std::chrono::nanoseconds lateness) {
           if (stop_) return false;
           LoadSession& session = *sessions_[due.editor % options_.sessions];
           const bool held = session.Due(
               static_cast<int>(due.editor / options_.sessions), due.sequence);
           recorder_->Sent(due.time, lateness, held);
           return true;
         });
  }

  // Until no more poses are due.
  absl::Status Watch() {
    auto next_progress = Clock::now() + kProgress;
    auto next_server = begin_;
    while (!wrong_) {
      DEFORM_RETURN_IF_ERROR(Trouble());
      const auto now = Clock::now();
      if (now >= end_) break;
      if (now >= next_server) {
        LookAtServer();
        next_server = now + kServerLook;
      }
      if (control_.progress && now >= next_progress) {
        next_progress = now + kProgress;
        control_.progress({InSeconds(now - timing_->schedule.start()),
                           InSeconds(end_ - timing_->schedule.start()),
                           recorder_->figures(), server_});
      }
      MutexLock lock(mutex_);
      changed_.WaitFor(mutex_,
                       std::min<std::chrono::nanoseconds>(kLook, end_ - now));
    }
    LookAtServer();
    return absl::OkStatus();
  }

  void LookAtServer() {
    const auto status = clients_.front().GetServerStatus();
    if (!status.ok()) return;  // An older server; or it will show elsewhere.
    const auto now = Clock::now();
    if (!server_) {
      first_server_ = *status;
      first_look_ = now;
      client_cpu_ = CpuSeconds();
    }
    last_look_ = now;
    last_client_cpu_ = CpuSeconds();
    server_ = *status;
    samples_.push_back({.seconds = InSeconds(now - begin_),
                        .resident_bytes = status->resident_bytes,
                        .open_files = status->open_files});
  }

  // Editors end when their poses are answered, then viewers.
  absl::Status Drain() {
    for (std::thread& sender : senders_) sender.join();
    senders_.clear();
    const auto deadline = Clock::now() + options_.patience;
    for (const auto& session : sessions_) session->CloseEditors();
    const int editors = options_.editors;
    while (Clock::now() < deadline &&
           !All([&](const LoadSession& s) { return s.ended() >= editors; })) {
      DEFORM_RETURN_IF_ERROR(Trouble());
      Pause();
    }
    for (const auto& session : sessions_) session->CloseViewers();
    while (Clock::now() < deadline && !All([](const LoadSession& s) {
             return s.ended() == s.participants();
           })) {
      DEFORM_RETURN_IF_ERROR(Trouble());
      Pause();
    }
    return Trouble();
  }

  LoadReport Report() {
    LoadReport report;
    report.figures = recorder_->figures();
    report.seconds =
        std::max(0.0, InSeconds(std::min(Clock::now(), end_) - begin_));
    report.connections = static_cast<int64_t>(clients_.size());
    report.poses_due = timing_->schedule.size();
    for (const auto& session : sessions_) {
      const LoadSession::Counts counts = session->counts();
      report.poses_sent += counts.sent;
      report.poses_answered += counts.answered;
    }
    report.checks = checker_.Finish();
    if (const auto& wrong = report.checks.wrong) {
      report.wrong_session = created_[wrong->session];
    }
    if (room_.check_interval.count() > 0) {
      MutexLock lock(mutex_);
      report.sessions_unchecked =
          options_.sessions - static_cast<int64_t>(checked_.size());
    }
    if (server_ && last_look_ > first_look_) {
      const double seconds = InSeconds(last_look_ - first_look_);
      report.server_cpus =
          (server_->cpu_seconds - first_server_.cpu_seconds) / seconds;
      report.client_cpus = (last_client_cpu_ - client_cpu_) / seconds;
      report.server_over_time = samples_;
      report.server_processors = server_->processors;
    }
    return report;
  }

  // Goes on after a session that is gone, not after a server that is.
  void DeleteSessions() {
    for (const std::string& id : created_) {
      const absl::Status status = clients_.front().DeleteSession(id);
      if (absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status)) {
        return;
      }
    }
  }

  std::vector<Client>& clients_;
  const std::vector<LoadTarget>& targets_;
  const LoadOptions& options_;
  const LoadControl& control_;

  Mutex mutex_;
  CondVar changed_;
  absl::Status failure_ ABSL_GUARDED_BY(mutex_);
  std::set<int64_t> checked_ ABSL_GUARDED_BY(mutex_);
  std::atomic<bool> wrong_{false};
  std::atomic<bool> stop_{false};

  // Of the thread that runs Do().
  Clock::time_point begin_, end_;
  std::optional<ServerStatus> server_;
  ServerStatus first_server_;
  Clock::time_point first_look_, last_look_;
  double client_cpu_ = 0, last_client_cpu_ = 0;
  std::vector<ServerSample> samples_;

  // What the participants use outlives them.
  LoadRoom room_;
  std::optional<LoadRecorder> recorder_;
  std::optional<LoadRoom::Timing> timing_;
  FrameChecker checker_;
  std::vector<std::string> created_;
  std::vector<std::unique_ptr<LoadSession>> sessions_;
  std::vector<std::thread> senders_;
};

}  // namespace

double LoadReport::LatePart() const {
  const int64_t count = figures.lateness.count();
  if (count == 0) return 0;
  return static_cast<double>(figures.lateness.CountAbove(kLate)) /
         static_cast<double>(count);
}

absl::StatusOr<LoadReport> RunLoad(std::vector<Client>& clients,
                                   const std::vector<LoadTarget>& targets,
                                   const LoadOptions& options,
                                   const LoadControl& control) {
  return Run(clients, targets, options, control).Do();
}

}  // namespace deform
