// Disks that fail, power that goes, processes that die: what was acknowledged
// is there, what was refused is there whole or not at all.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "tests/server/stores/samples.h"
#include "tests/server/stores/simulated_disk.h"
#include "tests/server/stores/steps.h"
#include "tests/support/temporary_folder.h"

namespace deform::server {
namespace {

using Kind = SimulatedDisk::Fault::Kind;
using testing::AnyOf;
using testing::Eq;

absl::StatusOr<std::unique_ptr<Store>> OpenOn(SimulatedDisk& disk) {
  StoreOptions options;
  options.directory = "/data";
  options.files = &disk;
  options.sqlite_vfs = disk.vfs();
  return (*FindStoreKind("sqlite"))->Open(options);
}

// What the script made of a disk.
struct Outcome {
  Reference held;       // All that was acknowledged.
  std::string perhaps;  // With the one that failed last, if nothing followed.
  std::vector<absl::Status> failures;
  bool opened = false;
};

// The whole script, whatever fails in between.
Outcome RunScript(SimulatedDisk& disk) {
  Outcome outcome;
  const auto store = OpenOn(disk);
  if (!store.ok()) {
    outcome.failures.push_back(store.status());
    return outcome;
  }
  outcome.opened = true;
  for (const Step& step : Script()) {
    Reference after = outcome.held;
    const bool possible = after.Apply(step);
    const absl::Status status = Do(step, outcome.held, **store);
    EXPECT_TRUE(possible || !status.ok());
    if (status.ok()) {
      outcome.held = after;
      if (step.kind != Step::Kind::kCollectOrphans) outcome.perhaps.clear();
    } else if (possible) {
      outcome.failures.push_back(status);
      outcome.held.Fail(step);
      if (outcome.perhaps.empty()) outcome.perhaps = after.Describe();
    }
  }
  const std::string found = Describe(**store);
  if (!disk.Struck()) {
    EXPECT_EQ(found, outcome.held.Describe());
  }
  return outcome;
}

// What a new server finds.
void ExpectHeld(SimulatedDisk& disk, const Outcome& outcome) {
  const auto store = OpenOn(disk);
  ASSERT_TRUE(store.ok()) << store.status();
  EXPECT_THAT(Describe(**store),
              AnyOf(Eq(outcome.held.Describe()), Eq(outcome.perhaps)));
  EXPECT_EQ(*(*store)->CollectOrphans(), 0) << "they went at the start";
}

int64_t CallsOfScript() {
  SimulatedDisk disk;
  const Outcome outcome = RunScript(disk);
  EXPECT_TRUE(outcome.failures.empty()) << outcome.failures.front();
  return disk.calls();
}

// Faults at every `stride`-th call; `check` judges each outcome.
template <typename Check>
void FailEachCall(Kind kind, int error, int64_t stride, Check check) {
  const int64_t calls = CallsOfScript();
  ASSERT_GT(calls, 200);
  for (int64_t at = 0; at < calls; at += stride) {
    SCOPED_TRACE(absl::StrCat("call ", at, " of ", calls, ", errno ", error));
    SimulatedDisk disk;
    disk.Inject({.kind = kind, .at = at, .error = error});
    const Outcome outcome = RunScript(disk);
    check(outcome);
    if (kind == Kind::kPowerLoss) {
      disk.Restart(static_cast<uint64_t>(at));
    } else {
      disk.EndProcess();
    }
    ExpectHeld(disk, outcome);
    if (testing::Test::HasFailure()) return;
  }
}

void ExpectClear(const Outcome& outcome) {
  for (const absl::Status& failure : outcome.failures) {
    EXPECT_THAT(ReasonOf(failure),
                AnyOf(Eq("STORE_FAILED"), Eq("DISK_FULL"), Eq("REVISION_GAP")))
        << failure;
  }
  EXPECT_LE(outcome.failures.size(), 4u) << "the store did not recover";
}

TEST(StoreOnAFailingDisk, SurvivesAnErrorOfEveryCall) {
  FailEachCall(Kind::kError, EIO, 1, ExpectClear);
}

TEST(StoreOnAFailingDisk, SurvivesEveryErrorCode) {
  for (const int error : {EACCES, EBUSY, EDQUOT, EFBIG, EINVAL, EMFILE, ENFILE,
                          ENOMEM, EPERM, EROFS}) {
    FailEachCall(Kind::kError, error, 29, ExpectClear);
  }
}

TEST(StoreOnAFailingDisk, SaysThatTheDiskIsFull) {
  FailEachCall(Kind::kError, ENOSPC, 3, [](const Outcome& outcome) {
    ExpectClear(outcome);
    if (outcome.failures.empty()) return;
    EXPECT_EQ(outcome.failures[0].code(), absl::StatusCode::kResourceExhausted)
        << outcome.failures[0];
  });
}

TEST(StoreOnAFailingDisk, SurvivesTornWrites) {
  FailEachCall(Kind::kTorn, EIO, 1, ExpectClear);
}

TEST(StoreOnAFailingDisk, GoesOnAfterShortReadsAndWrites) {
  FailEachCall(Kind::kShort, 0, 1, [](const Outcome& outcome) {
    EXPECT_TRUE(outcome.failures.empty()) << outcome.failures[0];
  });
}

TEST(StoreOnAFailingDisk, TriesAgainWhatASignalInterrupted) {
  FailEachCall(Kind::kError, EINTR, 3, [](const Outcome& outcome) {
    EXPECT_TRUE(outcome.failures.empty()) << outcome.failures[0];
  });
}

TEST(StoreOnAFailingDisk, KeepsWhatWasAcknowledgedWhenPowerGoes) {
  FailEachCall(Kind::kPowerLoss, 0, 1, [](const Outcome&) {});
}

// The judge judged: a sync that was left out would have been found out.
TEST(StoreOnAFailingDisk, LosesWhatADiskOnlySaysItSynced) {
  const int64_t calls = CallsOfScript();
  for (const auto sync :
       {SimulatedDisk::Lie::kFiles, SimulatedDisk::Lie::kNames}) {
    int lost = 0;
    for (int64_t at = 0; at < calls; at += 5) {
      SimulatedDisk disk;
      disk.LieAboutSyncsOf(sync);
      disk.Inject({.kind = Kind::kPowerLoss, .at = at});
      const Outcome outcome = RunScript(disk);
      disk.Restart(static_cast<uint64_t>(at));
      const auto store = OpenOn(disk);
      const std::string found = store.ok() ? Describe(**store) : "nothing";
      if (found != outcome.held.Describe() && found != outcome.perhaps) ++lost;
    }
    EXPECT_GT(lost, 20);
  }
}

// Random steps, with ends of all kinds in between.
void RunRandomly(uint64_t seed) {
  SCOPED_TRACE(absl::StrCat("seed ", seed));
  std::mt19937_64 random(seed);
  SimulatedDisk disk;
  Reference reference;
  for (int life = 0; life < 6; ++life) {
    auto store = OpenOn(disk);
    ASSERT_TRUE(store.ok()) << store.status();
    reference.Reopen();
    ASSERT_EQ(Describe(**store), reference.Describe()) << "life " << life;
    for (int i = 0; i < 30; ++i) {
      const Step step = RandomStep(random);
      Reference after = reference;
      const bool expected = after.Apply(step);
      const absl::Status status = Do(step, reference, **store);
      ASSERT_EQ(status.ok(), expected) << status;
      reference = after;
    }
    ASSERT_EQ(Describe(**store), reference.Describe());
    const uint64_t end = random() % 3;
    if (end == 0) continue;  // It closes.
    disk.Inject({.kind = Kind::kPowerLoss});
    store->reset();
    if (end == 1) disk.Restart(random());
    if (end == 2) disk.Restart(0);
  }
}

TEST(Store, IsWhatItsReferenceIsAfterRandomSteps) {
  for (uint64_t seed = 1; seed <= 30; ++seed) {
    RunRandomly(seed);
    if (testing::Test::HasFailure()) return;
  }
}

// DEFORM_KILLS=200 is the long form.
int Kills() {
  const char* kills = std::getenv("DEFORM_KILLS");
  return kills != nullptr ? std::atoi(kills) : 20;
}

// Steps at random for ever; a byte into `acknowledged` after each. It is
// killed.
[[noreturn]] void Live(const StoreOptions& options, uint64_t seed,
                       Reference reference, int acknowledged) {
  auto store = (*FindStoreKind("sqlite"))->Open(options);
  if (!store.ok()) _exit(1);
  std::mt19937_64 random(seed);
  reference.Reopen();
  while (true) {
    const Step step = RandomStep(random);
    Reference after = reference;
    const bool expected = after.Apply(step);
    // The reference would take for acknowledged what was not.
    if (Do(step, reference, **store).ok() != expected) _exit(3);
    reference = after;
    if (write(acknowledged, "x", 1) != 1) _exit(2);
  }
}

// Kills it somewhere after `steps` steps; returns how many were acknowledged.
int64_t KillAfter(int64_t steps, uint64_t spins, pid_t child,
                  int acknowledged) {
  int64_t count = 0;
  char bytes[256];
  while (count < steps) {
    const ssize_t read_now = read(
        acknowledged, bytes,
        std::min<size_t>(sizeof(bytes), static_cast<size_t>(steps - count)));
    EXPECT_GT(read_now, 0) << "the process ended by itself";
    if (read_now <= 0) break;
    count += read_now;
  }
  for (volatile uint64_t spin = 0; spin < spins;) spin = spin + 1;
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  while (true) {
    const ssize_t late = read(acknowledged, bytes, sizeof(bytes));
    if (late <= 0) return count;
    count += late;
  }
}

TEST(Store, KeepsWhatWasAcknowledgedWhenItsProcessIsKilled) {
  StoreOptions options;
  options.directory = Temporary().Path("killed");
  Reference reference;
  std::mt19937_64 random(7);
  for (int life = 0; life < Kills(); ++life) {
    SCOPED_TRACE(absl::StrCat("life ", life));
    const uint64_t seed = random();
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) Live(options, seed, reference, ends[1]);
    close(ends[1]);
    const int64_t steps = 1 + static_cast<int64_t>(random() % 12);
    const int64_t count = KillAfter(steps, random() % 3000000, child, ends[0]);
    close(ends[0]);

    std::mt19937_64 again(seed);
    reference.Reopen();
    for (int64_t i = 0; i < count; ++i) reference.Apply(RandomStep(again));
    Reference perhaps = reference;
    perhaps.Apply(RandomStep(again));
    auto store = (*FindStoreKind("sqlite"))->Open(options);
    ASSERT_TRUE(store.ok()) << store.status();
    const std::string found = Describe(**store);
    ASSERT_THAT(found, AnyOf(Eq(reference.Describe()), Eq(perhaps.Describe())));
    if (found != reference.Describe()) reference = perhaps;
  }
}

}  // namespace
}  // namespace deform::server
