#include "server/sessions/batch_scheduler.h"

#include <gtest/gtest.h>

#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

// float32 relative to an origin within D / 4 = 0.9 of the ball.
constexpr double kFrameTolerance = 2e-6;

// A session with one stream, which has seen the rest pose.
struct Posed {
  std::shared_ptr<Session> session;
  FakeStream stream;

  void MoveTo(double x) {
    stream.participant->Submit(++sequence, MovedBy({x, 0, 0}));
  }
  uint64_t revision() const { return session->state().revision; }
  uint64_t sequence = 0;
};

class BatchSchedulerTest : public testing::Test {
 protected:
  Posed Open(const std::string& id, const std::string& binding_id,
             Delivery delivery = Delivery::kLatest) {
    Posed posed;
    posed.session = Session::Create(
        id, rooms_.bindings().Use("t", binding_id, "session " + id).value(), {},
        rooms_.Environment());
    posed.stream.participant =
        posed.session->Join(delivery, FrameWishes{}, posed.stream.receiver)
            .value()
            .participant;
    rooms_.executor.RunAll();
    posed.stream.TakeFrame();
    return posed;
  }
  Posed Open(const std::string& id) { return Open(id, rooms_.binding_id); }

  SessionRooms rooms_;  // Batches of at most three sessions.
};

double OffBy(const Frame& frame, double x) {
  Positions expected = Icosphere(0.5, 1).positions;
  expected.col(0).array() += x;
  return (Decoded(frame) - expected).cwiseAbs().maxCoeff();
}

TEST_F(BatchSchedulerTest, SessionsOfABindingThatWaitGoTogether) {
  Posed a = Open("a"), b = Open("b"), c = Open("c");
  a.MoveTo(0.1);
  b.MoveTo(0.2);
  c.MoveTo(0.3);
  EXPECT_EQ(rooms_.executor.RunAll(), 1);
  // Each gets its own.
  EXPECT_LT(OffBy(*a.stream.TakeFrame().frame, 0.1), kFrameTolerance);
  EXPECT_LT(OffBy(*b.stream.TakeFrame().frame, 0.2), kFrameTolerance);
  EXPECT_LT(OffBy(*c.stream.TakeFrame().frame, 0.3), kFrameTolerance);
}

TEST_F(BatchSchedulerTest, NobodyWaitsForOthersToCome) {
  Posed a = Open("a"), b = Open("b");
  a.MoveTo(0.1);
  EXPECT_TRUE(rooms_.executor.RunOne());
  EXPECT_EQ(a.revision(), 1u);
  EXPECT_EQ(b.revision(), 0u);
}

TEST_F(BatchSchedulerTest, BindingsTakeTurns) {
  std::vector<Posed> many;
  for (const char* id : {"a", "b", "c", "d", "e", "f", "g"}) {
    many.push_back(Open(id));
  }
  Posed other = Open("other", rooms_.AnotherBinding());
  for (Posed& posed : many) posed.MoveTo(0.1);
  other.stream.participant->Submit(1, MoveVertex(0, {-3, -3, -3}));
  rooms_.executor.RunOne();
  EXPECT_EQ(many[2].revision(), 1u);
  EXPECT_EQ(many[3].revision(), 0u);
  EXPECT_EQ(other.revision(), 0u);
  // Who has just been served and wants more waits behind the others.
  many[0].MoveTo(0.2);
  rooms_.executor.RunOne();
  EXPECT_EQ(other.revision(), 1u);
  EXPECT_EQ(many[3].revision(), 0u);
  rooms_.executor.RunOne();
  EXPECT_EQ(many[5].revision(), 1u);
  EXPECT_EQ(many[0].revision(), 1u);
  rooms_.executor.RunOne();
  EXPECT_EQ(many[6].revision(), 1u);
  EXPECT_EQ(many[0].revision(), 2u);
  EXPECT_FALSE(rooms_.executor.RunOne());
}

TEST_F(BatchSchedulerTest, StepsOfASessionStayInOrderOneAtATime) {
  Posed every = Open("a", rooms_.binding_id, Delivery::kEvery);
  for (const double x : {0.1, 0.2, 0.3}) every.MoveTo(x);
  EXPECT_EQ(rooms_.executor.RunAll(), 3);
  for (const double x : {0.1, 0.2, 0.3}) {
    EXPECT_LT(OffBy(*every.stream.TakeFrame().frame, x), kFrameTolerance);
  }
}

TEST_F(BatchSchedulerTest, AReceiverThatDoesNotReadHoldsUpItsSessionOnly) {
  Posed stuck = Open("stuck", rooms_.binding_id, Delivery::kEvery);
  Posed quick = Open("quick");
  for (size_t i = 1; i <= 2 * Outbox::kMaxFrames; ++i) {
    if (stuck.stream.participant->WantsPoses()) stuck.MoveTo(0.1);
    quick.MoveTo(0.1);
    rooms_.executor.RunAll();
    EXPECT_EQ(quick.revision(), i);
  }
  EXPECT_EQ(stuck.revision(), Outbox::kMaxFrames);
}

TEST_F(BatchSchedulerTest, ASessionThatEndsWhileItWaitsIsNotMissed) {
  Posed a = Open("a"), b = Open("b");
  a.MoveTo(0.1);
  b.MoveTo(0.2);
  a.session->End(absl::NotFoundError("gone"));
  rooms_.executor.RunAll();
  EXPECT_EQ(a.stream.TakeEnd().message(), "gone");
  EXPECT_LT(OffBy(*b.stream.TakeFrame().frame, 0.2), kFrameTolerance);
}

TEST_F(BatchSchedulerTest, NewcomersAreShownWhatIsWithTheStepsOfOthers) {
  Posed a = Open("a"), b = Open("b");
  a.MoveTo(0.1);
  FakeStream late;
  late.participant =
      b.session->Join(Delivery::kLatest, FrameWishes{}, late.receiver)
          .value()
          .participant;
  rooms_.executor.RunAll();
  EXPECT_LT(OffBy(*late.TakeFrame().frame, 0), kFrameTolerance);
  EXPECT_EQ(a.revision(), 1u);
}

TEST(SessionsPerPass, AreFewerTheLargerTheBindingIs) {
  const auto facts = [](int64_t points, int64_t columns) {
    return BindingFacts(
        {.request =
             {.model = std::make_shared<const Mesh>(
                  Mesh::Create(3, Positions::Zero(points, 3), {}).value()),
              .rig = BallCage()},
         .columns = columns});
  };
  EXPECT_EQ(BatchScheduler::SessionsPerPass(facts(1000, 20)),
            BatchScheduler::kMaxSessions);
  EXPECT_EQ(BatchScheduler::SessionsPerPass(facts(100'000, 500)), 10);
  EXPECT_EQ(BatchScheduler::SessionsPerPass(facts(1000, 1 << 20)), 1);
}

// Answers every frame with the next pose, from whatever thread it comes.
class Echo : public Receiver {
 public:
  static constexpr uint64_t kPoses = 200;

  void Begin(std::unique_ptr<Participant> participant) {
    MutexLock lock(mutex_);
    participant_ = std::move(participant);
    Continue();
  }
  void Wake() override {
    MutexLock lock(mutex_);
    if (participant_ != nullptr) Continue();
  }
  void AwaitEnd() {
    MutexLock lock(mutex_);
    while (sent_ < kPoses || revisions_ <= kPoses) changed_.Wait(mutex_);
    participant_ = nullptr;
  }
  int wrong() {
    MutexLock lock(mutex_);
    return wrong_;
  }

 private:
  void Continue() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    while (const auto next = participant_->Take()) {
      const auto* frame = std::get_if<FrameToSend>(&*next);
      wrong_ += frame == nullptr || frame->frame->info.revision != revisions_;
      ++revisions_;
    }
    while (sent_ < kPoses && participant_->WantsPoses()) {
      ++sent_;
      participant_->Submit(sent_, MovedBy({0.001 * sent_, 0, 0}));
    }
    changed_.NotifyAll();
  }

  Mutex mutex_;
  CondVar changed_;
  std::unique_ptr<Participant> participant_ ABSL_GUARDED_BY(mutex_);
  uint64_t sent_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t revisions_ ABSL_GUARDED_BY(mutex_) = 0;
  int wrong_ ABSL_GUARDED_BY(mutex_) = 0;
};

TEST_F(BatchSchedulerTest, SessionsGetEveryFrameInOrderFromManyThreads) {
  auto pool = std::make_unique<ThreadPool>(ThreadPool::Options{.threads = 3});
  BatchScheduler scheduler(
      {.executor = [&pool](auto task) { pool->Submit(std::move(task)); },
       .pool = pool.get(),
       .concurrent = 3,
       .max_sessions = 3});
  SessionEnvironment environment = rooms_.Environment();
  environment.scheduler = &scheduler;
  environment.clock = [] { return std::chrono::steady_clock::now(); };
  std::vector<std::shared_ptr<Echo>> echoes;
  const std::string other = rooms_.AnotherBinding();
  for (int i = 0; i < 8; ++i) {
    const auto session = Session::Create(
        "s",
        rooms_.bindings()
            .Use("t", i % 4 == 0 ? other : rooms_.binding_id, "session s")
            .value(),
        {}, environment);
    echoes.push_back(std::make_shared<Echo>());
    echoes.back()->Begin(
        session->Join(Delivery::kEvery, FrameWishes{}, echoes.back())
            .value()
            .participant);
  }
  for (const auto& echo : echoes) {
    echo->AwaitEnd();
    EXPECT_EQ(echo->wrong(), 0);
  }
  pool.reset();  // What runs holds sessions.
}

}  // namespace
}  // namespace deform::server
