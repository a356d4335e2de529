#include "client/cli/progress.h"

#include <algorithm>

#include "absl/strings/str_format.h"

namespace deform::cli {
namespace {

constexpr std::chrono::milliseconds kPatience(500);
constexpr std::chrono::milliseconds kRedraw(100);
constexpr std::chrono::milliseconds kLine(5000);
constexpr int kBarWidth = 30;

}  // namespace

Progress::Progress(Console& console, std::string label,
                   const Interruption* interruption, Clock now)
    : console_(console),
      label_(std::move(label)),
      interruption_(interruption),
      now_(std::move(now)),
      start_(now_()),
      next_(start_ + (console.terminal() ? kPatience : kLine)) {}

Progress::~Progress() {
  if (drawn_) console_.err() << "\r\x1b[K" << std::flush;
}

void Progress::Show(int64_t done, int64_t total) {
  const auto now = now_();
  if (now < next_ || total <= 0) return;
  next_ = now + (console_.terminal() ? kRedraw : kLine);
  const double part = std::clamp(
      static_cast<double>(done) / static_cast<double>(total), 0., 1.);
  const double seconds = std::chrono::duration<double>(now - start_).count();
  if (!console_.terminal()) {
    console_.Note(absl::StrFormat("%s: %.0f %% after %.0f s", label_,
                                  100 * part, seconds));
    return;
  }
  const int filled = static_cast<int>(part * kBarWidth);
  std::string left;
  if (part > 0.02) {
    left = absl::StrFormat("  %.0f s left", seconds / part * (1 - part));
  }
  console_.err() << absl::StrFormat("\r\x1b[K%s [%s%s] %3.0f %%%s", label_,
                                    std::string(filled, '#'),
                                    std::string(kBarWidth - filled, '.'),
                                    100 * part, left)
                 << std::flush;
  drawn_ = true;
}

ProgressCallback Progress::callback() {
  return [this](int64_t done, int64_t total) {
    Show(done, total);
    return interruption_ == nullptr || !interruption_->requested;
  };
}

}  // namespace deform::cli
