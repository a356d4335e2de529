// Sessions that outlive their server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "tests/server/sessions/session_life.h"

namespace deform::server {
namespace {

using Kind = SimulatedDisk::Fault::Kind;
using testing::HasSubstr;
using testing::IsEmpty;

// Float weights and frames; D of the cube is 3.5.
constexpr double kFrameTolerance = 1e-6 * 3.5;

// A life with a session "s", posed twice: all of the cage, then a vertex of it.
void LiveAndPose(SessionLife& life) {
  ASSERT_TRUE(life.Create(life.BindBall().value(), "s").ok());
  FakeStream& stream = life.Join("s");
  life.Run();
  stream.participant->Submit(1, MovedBy({1, 0, 0}));
  life.Run();
  stream.participant->Submit(2, MoveVertex(3, {5, 6, 7}));
  life.Run();
}

TEST(StoredSessions, AreWhereTheyWereInTheNextLife) {
  SimulatedDisk disk;
  Session::Posed posed;
  Positions frame;
  absl::Time created;
  {
    SessionLife life(disk);
    LiveAndPose(life);
    EXPECT_TRUE(life.Sync().ok());
    const SessionState state = life.Find("s")->state();
    EXPECT_EQ(state.revision, 2u);
    EXPECT_EQ(state.durable_revision, 2u);
    EXPECT_EQ(state.epoch, 1u);
    created = state.create_time;
    posed = life.Find("s")->posed();
    FakeStream& stream = life.Join("s");
    life.Run();
    frame = Decoded(*stream.TakeFrame().frame);
  }
  SessionLife life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  const SessionState state = life.Find("s")->state();
  EXPECT_EQ(state.revision, 2u);
  EXPECT_EQ(state.durable_revision, 2u);
  EXPECT_EQ(state.epoch, 2u);
  EXPECT_EQ(state.create_time, created);
  EXPECT_EQ(state.binding_id, posed.binding_id);
  FakeStream& stream = life.Join("s");
  EXPECT_EQ(stream.pose.vertices, posed.pose.vertices);
  life.Run();
  const FrameToSend sent = stream.TakeFrame();
  EXPECT_EQ(sent.frame->info.revision, 2u);
  EXPECT_LT((Decoded(*sent.frame) - frame).cwiseAbs().maxCoeff(),
            kFrameTolerance);
}

TEST(StoredSessions, SleepUntilTheyAreWanted) {
  SimulatedDisk disk;
  {
    SessionLife life(disk);
    LiveAndPose(life);
    life.life().RunAll();
  }
  SessionLife life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  const auto binding = life.life().Find(life.Find("s")->state().binding_id);
  EXPECT_EQ(life.patient().waiting(), 0u);
  EXPECT_FALSE(binding->weights->state().resident);
  EXPECT_EQ(DetailOf(life.life().bindings().Remove("t", binding->id)).reason,
            "BINDING_IN_USE");
  // Many want it; one fetches.
  life.Join("s");
  FakeStream& stream = life.Join("s");
  EXPECT_TRUE(stream.participant->Submit(1, MoveVertex(0, {9, 9, 9})));
  EXPECT_EQ(life.patient().waiting(), 1u);
  life.Run();
  EXPECT_EQ(life.life().computed, 0) << "the weights were stored";
  EXPECT_TRUE(binding->weights->state().resident);
  EXPECT_EQ(life.Find("s")->state().revision, 3u);
}

TEST(StoredSessions, GoOnWithTheNextRevision) {
  SimulatedDisk disk;
  {
    SessionLife life(disk);
    LiveAndPose(life);
  }
  Positions pose;
  {
    SessionLife life(disk);
    EXPECT_THAT(life.Load().value(), IsEmpty());
    FakeStream& stream = life.Join("s");
    stream.participant->Submit(1, MoveVertex(0, {9, 9, 9}));
    life.Run();
    stream.participant->Submit(2, MoveVertex(1, {8, 8, 8}));
    life.Run();
    pose = life.Find("s")->posed().pose.vertices;
  }
  SessionLife life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  EXPECT_EQ(life.Find("s")->state().epoch, 3u);
  EXPECT_EQ(life.Find("s")->state().revision, 4u);
  EXPECT_EQ(life.Find("s")->posed().pose.vertices, pose);
}

TEST(StoredSessions, WithoutAPoseAreAtRest) {
  SimulatedDisk disk;
  {
    SessionLife life(disk);
    ASSERT_TRUE(life.Create(life.BindBall().value(), "s").ok());
  }
  SessionLife life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  EXPECT_EQ(life.Find("s")->state().revision, 0u);
  EXPECT_EQ(life.Find("s")->posed().pose.vertices, BallCage().vertices());
}

TEST(StoredSessions, AreGoneWhenTheyWereDeleted) {
  SimulatedDisk disk;
  {
    SessionLife life(disk);
    LiveAndPose(life);
    EXPECT_TRUE(life.sessions().Delete("t", "s").ok());
  }
  SessionLife life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  EXPECT_EQ(life.sessions().catalogue().size(), 0);
}

TEST(StoredSessions, ThatTheDiskRefusesAreNotThere) {
  SimulatedDisk disk;
  SessionLife life(disk);
  const std::string binding = life.BindBall().value();
  disk.Inject({.kind = Kind::kError, .at = 0, .error = ENOSPC});
  const absl::Status full = life.Create(binding, "s");
  EXPECT_EQ(DetailOf(full).reason, "DISK_FULL");
  EXPECT_EQ(life.sessions().catalogue().size(), 0);
  EXPECT_TRUE(life.life().bindings().Remove("t", binding).ok())
      << "it is still in use";
}

TEST(StoredSessions, GoOnWhenTheDiskCannotDeleteThem) {
  SimulatedDisk disk;
  SessionLife life(disk);
  LiveAndPose(life);
  EXPECT_TRUE(life.Sync().ok());
  disk.Inject({.kind = Kind::kError, .at = 0, .error = EIO});
  EXPECT_EQ(DetailOf(life.sessions().Delete("t", "s")).reason, "STORE_FAILED");
  FakeStream& stream = life.Join("s");
  stream.participant->Submit(1, MoveVertex(0, {9, 9, 9}));
  life.Run();
  EXPECT_EQ(life.Find("s")->state().revision, 3u);
}

TEST(StoredSessions, GoOnWithoutTheDiskAndAreDurableAsSoonAsItIs) {
  SimulatedDisk disk;
  SessionLife life(disk);
  LiveAndPose(life);
  EXPECT_TRUE(life.Sync().ok());
  FakeStream& stream = life.Join("s");
  disk.Inject({.kind = Kind::kError, .at = 0, .error = ENOSPC});
  stream.participant->Submit(1, MoveVertex(0, {9, 9, 9}));
  life.Run();
  EXPECT_EQ(DetailOf(life.Sync()).reason, "DISK_FULL");
  EXPECT_EQ(life.Find("s")->state().revision, 3u);
  EXPECT_EQ(life.Find("s")->state().durable_revision, 2u);
  ASSERT_EQ(life.reported.all().size(), 1u);
  EXPECT_THAT(std::string(life.reported.all()[0].message()),
              HasSubstr("session s of tenant t is not durable for now"));
  stream.participant->Submit(2, MoveVertex(1, {8, 8, 8}));
  life.Run();
  EXPECT_TRUE(life.Sync().ok());
  EXPECT_EQ(life.Find("s")->state().durable_revision, 4u);
}

TEST(StoredSessions, EndWhenAnotherServerHasTakenThemOver) {
  SimulatedDisk disk;
  SessionLife life(disk);
  LiveAndPose(life);
  FakeStream& stream = life.Join("s");
  life.Run();
  stream.TakeFrame();
  const std::vector<StoreKey> key = {{"t", "s"}};
  EXPECT_EQ(life.life().store().TakeOver(key).value()[0], 2u);
  stream.participant->Submit(1, MoveVertex(0, {9, 9, 9}));
  life.Run();
  const absl::Status end = stream.TakeEnd();
  EXPECT_EQ(end.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(DetailOf(end).reason, "SESSION_TAKEN_OVER");
}

TEST(StoredSessions, SleepOnWhenTheirWeightsCannotBeHad) {
  SimulatedDisk disk;
  {
    SessionLife life(disk);
    LiveAndPose(life);
  }
  SessionLife life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  MemoryBudget& budget = life.life().bindings().budget();
  auto others = budget.Reserve(budget.limit() - budget.used(), "others need");
  FakeStream& early = life.Join("s");
  life.Run();
  EXPECT_EQ(DetailOf(early.TakeEnd()).reason, "MEMORY_LIMIT");
  others = MemoryBudget::Reservation();
  FakeStream& late = life.Join("s");
  life.Run();
  EXPECT_EQ(late.TakeFrame().frame->info.revision, 2u);
}

TEST(StoredSessions, ThatAreDamagedAreLostUntilTheyAreCreatedAgain) {
  SimulatedDisk disk;
  std::string model;
  std::string binding;
  {
    SessionLife life(disk);
    LiveAndPose(life);
    binding = life.Find("s")->state().binding_id;
    model = life.life().Find(binding)->model_id;
  }
  disk.Replace("/data/models/t/" + model, "cut");
  SessionLife life(disk);
  EXPECT_EQ(life.Load().value().size(), 3u);
  const absl::Status lost = life.sessions().catalogue().Find("t", "s").status();
  EXPECT_EQ(DetailOf(lost).reason, "SESSION_DAMAGED");
  ASSERT_EQ(life.BindBall().value(), binding);
  EXPECT_TRUE(life.Create(binding, "s").ok());
  EXPECT_EQ(life.Find("s")->state().revision, 0u);
}

// The corners of the cube as handles, and the middle of a side if `more`.
BindSpec OfHandles(const std::string& model_id, bool more) {
  Positions handles = BallCage().vertices();
  if (more) {
    handles.conservativeResize(9, 3);
    handles.row(8) << 1, 0, 0;
  }
  return {.tenant = "t",
          .model_id = model_id,
          .rig = Handles::Create(3, handles).value(),
          .scheme = "t_cc"};
}

TEST(StoredSessions, KeepTheRigThatTheyMovedTo) {
  SimulatedDisk disk;
  std::string larger;
  Positions pose;
  {
    SessionLife life(disk);
    const std::string model =
        life.life().Register(MeshOf(Icosphere(0.5, 1))).value();
    const auto few = life.life().Create(OfHandles(model, false)).value().record;
    const auto more = life.life().Create(OfHandles(model, true)).value().record;
    larger = more->id;
    ASSERT_TRUE(life.Create(few->id, "s").ok());
    FakeStream& stream = life.Join("s");
    life.Run();
    stream.participant->Submit(1, MoveVertex(3, {1, 2, 1}));
    life.Run();
    RigMoves moves;
    life.sessions().Move(*few, *more, {0, 1, 2, 3, 4, 5, 6, 7, -1}, {"s"},
                         moves);
    life.Run();
    ASSERT_TRUE(moves.outcomes()[0].moved.ok())
        << moves.outcomes()[0].moved.status();
    pose = life.Find("s")->posed().pose.vertices;
  }
  SessionLife life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  EXPECT_EQ(life.Find("s")->state().binding_id, larger);
  EXPECT_EQ(life.Find("s")->state().revision, 2u);
  EXPECT_EQ(life.Find("s")->posed().pose.vertices, pose);
}

// What a life with a fault acknowledged.
struct Told {
  absl::Status created;
  uint64_t durable = 0;
  std::vector<Positions> poses;  // By revision.
  int64_t calls = 0;             // To the disk.
};

// Creates a session and poses it three times, while the disk has this fault.
Told LiveWith(SimulatedDisk& disk,
              const std::optional<SimulatedDisk::Fault>& fault) {
  Told told;
  SessionLife life(disk);
  const std::string binding = life.BindBall().value();
  const int64_t before = disk.calls();
  if (fault) disk.Inject(*fault);
  told.created = life.Create(binding, "s");
  if (told.created.ok()) {
    told.poses = {life.Find("s")->posed().pose.vertices};
    FakeStream& stream = life.Join("s");
    life.Run();
    for (uint64_t i = 1; i <= 3; ++i) {
      stream.participant->Submit(
          i, i == 2 ? MoveVertex(3, {5, 6, 7})
                    : MovedBy({static_cast<double>(i), 0, 0}));
      life.Run();
      told.poses.push_back(life.Find("s")->posed().pose.vertices);
      life.Sync().IgnoreError();
    }
    const SessionState state = life.Find("s")->state();
    EXPECT_EQ(state.revision, 3u);
    told.durable = state.durable_revision;
  }
  told.calls = disk.calls() - before;
  return told;
}

void ExpectKept(SimulatedDisk& disk, const Told& told) {
  SessionLife life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  if (!told.created.ok()) {
    EXPECT_THAT(DetailOf(told.created).reason,
                testing::AnyOf("STORE_FAILED", "DISK_FULL"));
    return;
  }
  const SessionState state = life.Find("s")->state();
  EXPECT_GE(state.revision, told.durable);
  ASSERT_LT(state.revision, told.poses.size());
  EXPECT_EQ(life.Find("s")->posed().pose.vertices, told.poses[state.revision]);
}

TEST(StoredSessions, AreWholeWhicheverCallToTheDiskFails) {
  SimulatedDisk sound;
  const Told all = LiveWith(sound, std::nullopt);
  EXPECT_EQ(all.durable, 3u);
  EXPECT_GT(all.calls, 10);
  for (const Kind kind :
       {Kind::kError, Kind::kTorn, Kind::kShort, Kind::kPowerLoss}) {
    for (const int error : {EIO, ENOSPC}) {
      for (int64_t at = 0; at < all.calls; ++at) {
        SCOPED_TRACE(absl::StrCat("call ", at, " of ", all.calls, ", kind ",
                                  static_cast<int>(kind), ", errno ", error));
        SimulatedDisk disk;
        const Told told =
            LiveWith(disk, {{.kind = kind, .at = at, .error = error}});
        if (kind == Kind::kPowerLoss) {
          disk.Restart(static_cast<uint64_t>(at));
        } else {
          disk.EndProcess();
        }
        ExpectKept(disk, told);
        if (HasFailure()) return;
      }
    }
  }
}

}  // namespace
}  // namespace deform::server
