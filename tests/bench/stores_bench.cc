// What it costs to keep things: appends of 100 sessions at 60 Hz, and weights
// as large as those of 173,000 points and 326 columns.
//
//   stores_bench DIRECTORY     on the disk to be measured; must not exist
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/mutex.h"
#include "server/stores/bytes.h"
#include "server/stores/store.h"

namespace deform::server {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kSessions = 100;
constexpr int kRows = 60;
constexpr int kFrames = 300;  // Five seconds of 60 Hz.

double Seconds(Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

double CpuSeconds() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec +
                                    usage.ru_stime.tv_usec);
}

double Percentile(std::vector<double>& values, double part) {
  if (values.empty()) return 0;
  const size_t at = static_cast<size_t>(part * (values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[at];
}

void PutSessions(Store& store) {
  store.PutModel({.key = {"t", "m"}}, {}).IgnoreError();
  store.PutBinding({.key = {"t", "b"}, .model_id = "m"}).IgnoreError();
  for (int s = 0; s < kSessions; ++s) {
    store
        .PutSession(
            {.key = {"t", absl::StrCat("s", s)}, .binding_id = "b", .epoch = 1})
        .IgnoreError();
  }
}

// Every session appends a whole pose each sixtieth of a second.
void MeasureAppends(const char* name, Store& store) {
  PutSessions(store);
  Mutex mutex;
  std::vector<double> durable_ms;
  std::vector<double> append_us;
  const double cpu = CpuSeconds();
  const auto begin = Clock::now();
  for (int frame = 0; frame < kFrames; ++frame) {
    std::this_thread::sleep_until(begin +
                                  frame * std::chrono::microseconds(16667));
    for (int s = 0; s < kSessions; ++s) {
      PoseAppend append{.session = {"t", absl::StrCat("s", s)},
                        .epoch = 1,
                        .revision = static_cast<uint64_t>(frame) + 1,
                        .positions = Positions::Constant(kRows, 3, frame),
                        .answers = {{"client", frame}}};
      const auto now = Clock::now();
      const absl::Status status =
          store.Append(std::move(append), [&, now](const absl::Status& done) {
            if (!done.ok()) std::abort();
            MutexLock lock(mutex);
            durable_ms.push_back(1e3 * Seconds(Clock::now() - now));
          });
      if (!status.ok()) std::abort();
      append_us.push_back(1e6 * Seconds(Clock::now() - now));
    }
  }
  store.Sync().IgnoreError();
  const double wall = Seconds(Clock::now() - begin);
  std::printf(
      "%s: %d appends in %.1f s, CPU %.1f us each; Append() p50 %.1f us, "
      "p99 %.1f us; durable after p50 %.1f ms, p99 %.1f ms\n",
      name, kSessions * kFrames, wall,
      1e6 * (CpuSeconds() - cpu) / (kSessions * kFrames),
      Percentile(append_us, 0.5), Percentile(append_us, 0.99),
      Percentile(durable_ms, 0.5), Percentile(durable_ms, 0.99));
}

void MeasureWeights(Store& store) {
  std::vector<float> weights(int64_t{173000} * 326);
  for (size_t i = 0; i < weights.size(); ++i) {
    weights[i] = static_cast<float>(i % 8191) * 1e-4f;
  }
  const StoredArrays arrays{
      .arrays = {{"weights", std::as_bytes(std::span(weights))}}};
  const double mib = static_cast<double>(weights.size()) * 4 / (1 << 20);
  for (uint32_t pass = 0; pass < 3; ++pass) {
    auto begin = Clock::now();
    if (!store.PutWeights({"t", "b"}, {"tiles", pass}, arrays).ok()) {
      std::abort();
    }
    const double put = Seconds(Clock::now() - begin);
    double cpu = CpuSeconds();
    begin = Clock::now();
    const auto read = store.Weights({"t", "b"});
    if (!read.ok()) std::abort();
    const double got = Seconds(Clock::now() - begin);
    cpu = CpuSeconds() - cpu;
    begin = Clock::now();
    const auto bytes = read->arrays.Find("weights");
    unsigned sum = 0;
    for (size_t i = 0; i < bytes.size(); i += 4096) {
      sum += static_cast<unsigned>(bytes[i]);
    }
    const double touched = Seconds(Clock::now() - begin);
    std::printf(
        "%.0f MiB of weights: put and synced %.2f s; verified and mapped %.3f "
        "s (CPU %.3f s); every page touched %.3f s (%u)\n",
        mib, put, got, cpu, touched, sum);
  }
}

}  // namespace

int Main(int count, char** arguments) {
  if (count != 2) {
    std::fprintf(stderr, "usage: stores_bench DIRECTORY\n");
    return 2;
  }
  StoreOptions options;
  options.directory = arguments[1];
  for (const StoreKind* kind : AllStoreKinds()) {
    auto store = kind->Open(options);
    if (!store.ok()) {
      std::fprintf(stderr, "%s\n", store.status().ToString().c_str());
      return 1;
    }
    MeasureAppends(std::string(kind->id()).c_str(), **store);
    if ((*store)->survives_restart()) MeasureWeights(**store);
    const auto begin = Clock::now();
    store->reset();
    std::printf("%s: closed in %.3f s\n", std::string(kind->id()).c_str(),
                Seconds(Clock::now() - begin));
  }
  const auto begin = Clock::now();
  const auto store = (*FindStoreKind("sqlite"))->Open(options);
  std::printf("opened again in %.3f s\n", Seconds(Clock::now() - begin));
  return store.ok() ? 0 : 1;
}

}  // namespace deform::server

int main(int count, char** arguments) {
  return deform::server::Main(count, arguments);
}
