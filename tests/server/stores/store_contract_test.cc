// What every store promises.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "core/base/status_macros.h"
#include "tests/server/stores/samples.h"
#include "tests/server/stores/simulated_disk.h"
#include "tests/support/temporary_folder.h"

namespace deform::server {
namespace {

using testing::HasSubstr;

const StoreKey kLive = Key("live");

// A kind of store, on a disk of its own or on the machine's.
struct Place {
  const StoreKind* kind;
  bool simulated;
};

std::vector<Place> Places() {
  std::vector<Place> places;
  for (const StoreKind* kind : AllStoreKinds()) {
    places.push_back({kind, false});
    places.push_back({kind, true});
  }
  return places;
}

class StoreContract : public testing::TestWithParam<Place> {
 protected:
  StoreContract() {
    options_.directory =
        GetParam().simulated ? "/data" : Temporary().Path(Name());
    if (GetParam().simulated) {
      options_.files = &disk_;
      options_.sqlite_vfs = disk_.vfs();
    }
    Open();
    PutChain(*store_);
  }

  void Open() {
    auto store = GetParam().kind->Open(options_);
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
  }
  // Nothing to do where nothing survives.
  void Reopen() {
    if (!store_->survives_restart()) return;
    store_.reset();
    Open();
  }
  static std::string Name() {
    std::string name =
        testing::UnitTest::GetInstance()->current_test_info()->name();
    std::replace(name.begin(), name.end(), '/', '_');
    return name;
  }

  absl::Status Append(const PoseAppend& append) {
    absl::Status told = absl::InternalError("not told");
    const absl::Status accepted = store_->Append(
        append, [&](const absl::Status& status) { told = status; });
    if (!accepted.ok()) return accepted;
    store_->Sync().IgnoreError();
    return told;
  }
  absl::StatusOr<uint64_t> TakeOver(const StoreKey& key) {
    DEFORM_ASSIGN_OR_RETURN(const std::vector<uint64_t> epochs,
                            store_->TakeOver({&key, 1}));
    return epochs.at(0);
  }
  SessionPose Pose(const StoreKey& key = kLive) {
    const auto pose = store_->LoadSession(key);
    EXPECT_TRUE(pose.ok()) << pose.status();
    return pose.value_or(SessionPose{});
  }

  SimulatedDisk disk_;
  StoreOptions options_;
  std::unique_ptr<Store> store_;
};

TEST_P(StoreContract, GivesBackWhatWasPut) {
  Reopen();
  const StoreContents contents = *store_->Load();
  ASSERT_EQ(contents.models.size(), 1u);
  EXPECT_EQ(contents.models[0].key, Key("model"));
  EXPECT_EQ(contents.models[0].display_name, "the model");
  EXPECT_EQ(contents.models[0].create_time, absl::FromUnixSeconds(1700000000));
  ASSERT_EQ(contents.bindings.size(), 1u);
  EXPECT_EQ(contents.bindings[0].key, Key("bound"));
  EXPECT_EQ(contents.bindings[0].model_id, "model");
  EXPECT_EQ(contents.bindings[0].request, "request of bound");
  EXPECT_EQ(contents.bindings[0].facts, "facts of bound");
  ASSERT_EQ(contents.sessions.size(), 1u);
  EXPECT_EQ(contents.sessions[0].key, kLive);
  EXPECT_EQ(contents.sessions[0].binding_id, "bound");
  EXPECT_EQ(contents.sessions[0].resume_token_hash, "hash of live");
  EXPECT_EQ(contents.sessions[0].epoch, 1u);
  EXPECT_TRUE(contents.damaged.empty());
  EXPECT_EQ(TextOf(*store_->ModelArrays(Key("model"))), "mesh");
  EXPECT_TRUE(store_->ModelArrays(Key("model"))->Find("none").empty());
}

TEST_P(StoreContract, KeepsTenantsApart) {
  PutChain(*store_, "bob");
  ASSERT_TRUE(store_->DeleteModel(Key("model", "bob")).ok());
  EXPECT_EQ(TextOf(*store_->ModelArrays(Key("model"))), "mesh");
  EXPECT_EQ(store_->Load()->sessions.size(), 1u);
}

TEST_P(StoreContract, MayPutAModelTwice) {
  EXPECT_TRUE(store_->PutModel(ModelOf(Key("model")), ArraysOf("mesh")).ok());
  EXPECT_EQ(store_->Load()->models.size(), 1u);
  EXPECT_EQ(store_->Load()->sessions.size(), 1u);
}

TEST_P(StoreContract, GivesBackTheWeightsOrNone) {
  ASSERT_TRUE(
      store_->PutWeights(Key("bound"), {"tiles", 1}, ArraysOf("many")).ok());
  Reopen();
  const auto weights = store_->Weights(Key("bound"));
  if (!weights.ok()) {
    EXPECT_EQ(ReasonOf(weights.status()), "WEIGHTS_NOT_STORED");
    EXPECT_FALSE(store_->survives_restart());
    return;
  }
  EXPECT_EQ(weights->form, (WeightsForm{"tiles", 1}));
  EXPECT_EQ(TextOf(weights->arrays), "many");
}

TEST_P(StoreContract, ReplacesWeights) {
  if (!store_->survives_restart()) return;
  const StoreKey bound = Key("bound");
  ASSERT_TRUE(store_->PutWeights(bound, {"tiles", 1}, ArraysOf("old")).ok());
  const StoredWeights old = *store_->Weights(bound);
  ASSERT_TRUE(store_->PutWeights(bound, {"tiles", 1}, ArraysOf("new")).ok());
  EXPECT_EQ(TextOf(store_->Weights(bound)->arrays), "new");
  ASSERT_TRUE(store_->PutWeights(bound, {"small", 2}, ArraysOf("less")).ok());
  EXPECT_EQ(TextOf(store_->Weights(bound)->arrays), "less");
  EXPECT_EQ(store_->Weights(bound)->form, (WeightsForm{"small", 2}));
  EXPECT_EQ(TextOf(old.arrays), "old") << "who has them keeps them";
  EXPECT_EQ(*store_->CollectOrphans(), 0);
}

TEST_P(StoreContract, SaysWhatIsNotThere) {
  const StoreKey none = Key("none");
  EXPECT_EQ(ReasonOf(store_->ModelArrays(none).status()), "MODEL_NOT_FOUND");
  EXPECT_EQ(ReasonOf(store_->DeleteModel(none)), "MODEL_NOT_FOUND");
  EXPECT_EQ(ReasonOf(store_->PutBinding(BindingOf(Key("b"), "none"))),
            "MODEL_NOT_FOUND");
  EXPECT_EQ(ReasonOf(store_->PutWeights(none, {"tiles", 1}, {})),
            "BINDING_NOT_FOUND");
  EXPECT_EQ(ReasonOf(store_->Weights(none).status()), "BINDING_NOT_FOUND");
  EXPECT_EQ(ReasonOf(store_->Weights(Key("bound")).status()),
            "WEIGHTS_NOT_STORED");
  EXPECT_EQ(ReasonOf(store_->DeleteBinding(none)), "BINDING_NOT_FOUND");
  EXPECT_EQ(ReasonOf(store_->PutSession(SessionOf(Key("s"), "none"))),
            "BINDING_NOT_FOUND");
  EXPECT_EQ(ReasonOf(store_->LoadSession(none).status()), "SESSION_NOT_FOUND");
  EXPECT_EQ(ReasonOf(TakeOver(none).status()), "SESSION_NOT_FOUND");
  EXPECT_EQ(ReasonOf(store_->DeleteSession(none)), "SESSION_NOT_FOUND");
  EXPECT_EQ(ReasonOf(Append(Whole(none, 1, 1))), "SESSION_NOT_FOUND");
  EXPECT_EQ(store_->DurableRevision(none), 0u);
}

TEST_P(StoreContract, RefusesNamesThatAreNoNames) {
  for (const char* name : {"", ".", "..", "a/b", "a~", "caf\xc3\xa9"}) {
    const absl::Status status =
        store_->PutModel(ModelOf(Key(name)), ArraysOf("mesh"));
    EXPECT_EQ(ReasonOf(status), "BAD_STORE_KEY") << name;
    EXPECT_THAT(status.message(), HasSubstr("is not 1 to 64 of")) << name;
  }
  EXPECT_EQ(ReasonOf(store_->PutModel(ModelOf(Key("m", "../x")), {})),
            "BAD_STORE_KEY");
  EXPECT_EQ(ReasonOf(store_->PutWeights(Key("bound"), {"a.b", 1}, {})),
            "BAD_STORE_KEY");
}

TEST_P(StoreContract, RefusesASecondSessionOfTheName) {
  const absl::Status status = store_->PutSession(SessionOf(kLive, "bound"));
  EXPECT_EQ(ReasonOf(status), "SESSION_EXISTS");
  EXPECT_THAT(status.message(), HasSubstr("a session \"live\" already"));
}

TEST_P(StoreContract, EpochsBeginWithOne) {
  StoredSession session = SessionOf(Key("early"), "bound");
  session.epoch = 0;
  const absl::Status status = store_->PutSession(session);
  EXPECT_EQ(ReasonOf(status), "BAD_EPOCH");
  EXPECT_THAT(status.message(), HasSubstr("epochs begin with 1"));
}

TEST_P(StoreContract, DeletesBindingsAndSessionsWithTheirModel) {
  ASSERT_TRUE(
      store_->PutWeights(Key("bound"), {"tiles", 1}, ArraysOf("many")).ok());
  ASSERT_TRUE(Append(Whole(kLive, 1, 1)).ok());
  ASSERT_TRUE(store_->DeleteModel(Key("model")).ok());
  EXPECT_EQ(ReasonOf(Append(Whole(kLive, 2, 1))), "SESSION_NOT_FOUND");
  EXPECT_EQ(*store_->CollectOrphans(), 0);
  Reopen();
  const StoreContents contents = *store_->Load();
  EXPECT_TRUE(contents.models.empty());
  EXPECT_TRUE(contents.bindings.empty());
  EXPECT_TRUE(contents.sessions.empty());
}

TEST_P(StoreContract, DeletesSessionsWithTheirBinding) {
  ASSERT_TRUE(store_->DeleteBinding(Key("bound")).ok());
  EXPECT_EQ(ReasonOf(Append(Whole(kLive, 1, 1))), "SESSION_NOT_FOUND");
  Reopen();
  EXPECT_EQ(store_->Load()->models.size(), 1u);
  EXPECT_TRUE(store_->Load()->sessions.empty());
}

TEST_P(StoreContract, ASessionBeginsAtRest) {
  EXPECT_EQ(Pose().revision, 0u);
  EXPECT_EQ(Pose().binding_id, "bound");
  EXPECT_EQ(Pose().pose.vertices.rows(), 0);
}

TEST_P(StoreContract, KeepsTheLastPose) {
  PoseAppend whole = Whole(kLive, 1, 1);
  whole.answers = {{"mouse", 4}, {"pen", 1}};
  ASSERT_TRUE(Append(whole).ok());
  PoseAppend part = Part(kLive, 2, 1, 7);
  part.stretch_blend = 0.5;
  part.answers = {{"mouse", 5}};
  ASSERT_TRUE(Append(part).ok());
  EXPECT_EQ(store_->DurableRevision(kLive), 2u);
  Reopen();
  EXPECT_EQ(store_->DurableRevision(kLive), 2u);
  const SessionPose pose = Pose();
  EXPECT_EQ(pose.revision, 2u);
  EXPECT_EQ(pose.pose.stretch_blend, 0.5);
  EXPECT_EQ(pose.answers, (AnsweredSequences{{"mouse", 5}, {"pen", 1}}));
  Positions expected = Positions::Constant(3, 3, 1);
  expected.row(1).setConstant(7);
  EXPECT_EQ(pose.pose.vertices, expected);
  EXPECT_TRUE(Append(Part(kLive, 3, 0, 9)).ok()) << "and goes on";
}

TEST_P(StoreContract, AWholePoseForgetsClientsThatLeft) {
  PoseAppend first = Whole(kLive, 1, 1);
  first.answers = {{"mouse", 4}};
  ASSERT_TRUE(Append(first).ok());
  PoseAppend second = Whole(kLive, 2, 1);
  second.answers = {{"pen", 1}};
  ASSERT_TRUE(Append(second).ok());
  EXPECT_EQ(Pose().answers, (AnsweredSequences{{"pen", 1}}));
}

TEST_P(StoreContract, FoldsManyChangesWithoutLosingOne) {
  ASSERT_TRUE(Append(Whole(kLive, 1, 0, 100)).ok());
  Positions expected = Positions::Constant(100, 3, 0);
  for (uint64_t revision = 2; revision < 300; ++revision) {
    const int row = static_cast<int>(revision * 7 % 100);
    const double value = static_cast<double>(revision);
    expected.row(row).setConstant(value);
    const PoseAppend part = Part(kLive, revision, row, value);
    // Some alone, some in groups.
    if (revision % 5 == 0) {
      ASSERT_TRUE(Append(part).ok());
    } else {
      ASSERT_TRUE(store_->Append(part, nullptr).ok());
    }
  }
  ASSERT_TRUE(store_->Sync().ok());
  Reopen();
  EXPECT_EQ(Pose().revision, 299u);
  EXPECT_EQ(Pose().pose.vertices, expected);
}

TEST_P(StoreContract, ARowNamedTwiceTakesItsLastPlace) {
  ASSERT_TRUE(Append(Whole(kLive, 1, 0)).ok());
  PoseAppend part = Part(kLive, 2, 1, 5);
  part.rows = {1, 1};
  part.positions = Positions::Constant(2, 3, 5);
  part.positions.row(1).setConstant(6);
  ASSERT_TRUE(Append(part).ok());
  EXPECT_EQ(Pose().pose.vertices(1, 0), 6);
}

TEST_P(StoreContract, RefusesRevisionsThatDoNotFollow) {
  const absl::Status early = Append(Part(kLive, 1, 0, 1));
  EXPECT_EQ(ReasonOf(early), "REVISION_GAP");
  EXPECT_THAT(early.message(), HasSubstr("a whole pose must come"));
  ASSERT_TRUE(Append(Whole(kLive, 5, 1)).ok()) << "may leave some out";
  const absl::Status stale = Append(Whole(kLive, 5, 2));
  EXPECT_EQ(ReasonOf(stale), "STALE_REVISION");
  EXPECT_THAT(stale.message(), HasSubstr("revision 5 does not come after 5"));
  const absl::Status gap = Append(Part(kLive, 7, 0, 3));
  EXPECT_EQ(ReasonOf(gap), "REVISION_GAP");
  EXPECT_THAT(gap.message(),
              HasSubstr("revision 7 changes a part of 6, but the last is 5"));
  EXPECT_EQ(Pose().revision, 5u);
  EXPECT_EQ(Pose().pose.vertices(0, 0), 1);
}

TEST_P(StoreContract, RefusesPosesThatAreNoPoses) {
  ASSERT_TRUE(Append(Whole(kLive, 1, 1)).ok());
  const auto refuses = [&](const PoseAppend& append, const char* message) {
    const absl::Status status = Append(append);
    EXPECT_EQ(ReasonOf(status), "BAD_POSE");
    EXPECT_THAT(status.message(), HasSubstr(message));
  };
  refuses(Whole(kLive, 2, 1, 0), "a whole pose has no row");
  refuses(Part(kLive, 2, 3, 1), "row 3 of 3");
  refuses(Part(kLive, 2, -1, 1), "row -1 of 3");
  PoseAppend uneven = Part(kLive, 2, 0, 1);
  uneven.rows = {0, 1};
  refuses(uneven, "2 rows are named, 1 given");
  PoseAppend named = Whole(kLive, 2, 1);
  named.rows = {0};
  refuses(named, "a whole pose names rows");
  PoseAppend moved = Part(kLive, 2, 0, 1);
  moved.binding_id = "bound";
  refuses(moved, "another rig needs a whole pose");
}

TEST_P(StoreContract, RefusesAStaleWriter) {
  ASSERT_TRUE(Append(Whole(kLive, 1, 1)).ok());
  EXPECT_EQ(*TakeOver(kLive), 2u);
  const absl::Status stale = Append(Whole(kLive, 2, 5));
  EXPECT_EQ(ReasonOf(stale), "STALE_EPOCH");
  EXPECT_THAT(
      stale.message(),
      HasSubstr("written in epoch 1, but it was taken over in epoch 2"));
  EXPECT_EQ(Pose().pose.vertices(0, 0), 1);
  EXPECT_EQ(Pose().epoch, 2u);
  EXPECT_EQ(ReasonOf(Append(Part(kLive, 2, 0, 6, 2))), "REVISION_GAP")
      << "the new owner begins with a whole pose";
  EXPECT_TRUE(Append(Whole(kLive, 2, 6, 3, 2)).ok());
  Reopen();
  EXPECT_EQ(store_->Load()->sessions[0].epoch, 2u);
  EXPECT_EQ(Pose().pose.vertices(0, 0), 6);
  EXPECT_EQ(*TakeOver(kLive), 3u);
}

TEST_P(StoreContract, TakesManySessionsOverTogetherOrNone) {
  ASSERT_TRUE(store_->PutSession(SessionOf(Key("second"), "bound")).ok());
  const std::vector<StoreKey> both = {Key("second"), kLive};
  EXPECT_THAT(*store_->TakeOver(both), testing::ElementsAre(2, 2));
  ASSERT_TRUE(TakeOver(kLive).ok());
  EXPECT_THAT(*store_->TakeOver(both), testing::ElementsAre(3, 4));
  EXPECT_THAT(*store_->TakeOver({}), testing::IsEmpty());
  const std::vector<StoreKey> lost = {Key("second"), Key("none")};
  EXPECT_EQ(ReasonOf(store_->TakeOver(lost).status()), "SESSION_NOT_FOUND");
  Reopen();
  EXPECT_EQ(store_->LoadSession(Key("second"))->epoch, 3u);
  EXPECT_EQ(store_->LoadSession(kLive)->epoch, 4u);
}

TEST_P(StoreContract, ASessionMovesToAnotherRig) {
  ASSERT_TRUE(store_->PutBinding(BindingOf(Key("edited"), "model")).ok());
  ASSERT_TRUE(Append(Whole(kLive, 1, 1)).ok());
  PoseAppend moved = Whole(kLive, 2, 2, 5);
  moved.binding_id = "edited";
  ASSERT_TRUE(Append(moved).ok());
  Reopen();
  EXPECT_EQ(Pose().binding_id, "edited");
  EXPECT_EQ(Pose().pose.vertices.rows(), 5);
  EXPECT_EQ(store_->Load()->sessions[0].binding_id, "edited");
  ASSERT_TRUE(store_->DeleteBinding(Key("bound")).ok());
  EXPECT_EQ(store_->Load()->sessions.size(), 1u);
}

TEST_P(StoreContract, ARigThatIsNotThereFailsAlone) {
  ASSERT_TRUE(store_->PutSession(SessionOf(Key("other"), "bound")).ok());
  PoseAppend moved = Whole(kLive, 1, 1);
  moved.binding_id = "none";
  EXPECT_EQ(ReasonOf(Append(moved)), "BINDING_NOT_FOUND");
  EXPECT_TRUE(Append(Whole(Key("other"), 1, 1)).ok());
  EXPECT_TRUE(Append(Whole(kLive, 1, 1)).ok()) << "and mends it";
  EXPECT_EQ(Pose().binding_id, "bound");
}

TEST_P(StoreContract, ASessionOfAnOldNameIsNew) {
  ASSERT_TRUE(Append(Whole(kLive, 9, 1)).ok());
  ASSERT_TRUE(store_->DeleteSession(kLive).ok());
  ASSERT_TRUE(store_->PutSession(SessionOf(kLive, "bound")).ok());
  EXPECT_EQ(Pose().revision, 0u);
  EXPECT_EQ(store_->DurableRevision(kLive), 0u);
  EXPECT_TRUE(Append(Whole(kLive, 1, 2)).ok());
}

TEST_P(StoreContract, TellsEachAppendOnceAndInOrder) {
  std::vector<uint64_t> told;
  for (uint64_t revision = 1; revision <= 200; ++revision) {
    ASSERT_TRUE(store_
                    ->Append(Whole(kLive, revision, 1),
                             [&told, revision](const absl::Status& status) {
                               EXPECT_TRUE(status.ok()) << status;
                               told.push_back(revision);
                             })
                    .ok());
  }
  ASSERT_TRUE(store_->Sync().ok());
  ASSERT_EQ(told.size(), 200u);
  EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
}

TEST_P(StoreContract, CommitsWhatWaitsWhenItCloses) {
  for (uint64_t revision = 1; revision <= 50; ++revision) {
    ASSERT_TRUE(store_->Append(Whole(kLive, revision, 1), nullptr).ok());
  }
  Reopen();
  EXPECT_EQ(Pose().revision, 50u);
}

TEST_P(StoreContract, ServesManyThreads) {
  constexpr int kThreads = 4;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([this, t] {
      const std::string name = "s" + std::to_string(t);
      const StoreKey session = Key(name);
      EXPECT_TRUE(store_->PutSession(SessionOf(session, "bound")).ok());
      for (uint64_t revision = 1; revision <= 20; ++revision) {
        EXPECT_TRUE(store_->Append(Whole(session, revision, t), nullptr).ok());
        EXPECT_TRUE(store_->LoadSession(session).ok());
        // All put and drop the same model.
        store_->PutModel(ModelOf(Key("shared")), ArraysOf("shared"))
            .IgnoreError();
        const auto arrays = store_->ModelArrays(Key("shared"));
        if (arrays.ok()) {
          EXPECT_EQ(TextOf(*arrays), "shared");
        } else {
          EXPECT_EQ(ReasonOf(arrays.status()), "MODEL_NOT_FOUND");
        }
        if (revision % 3 == 0) {
          store_->DeleteModel(Key("shared")).IgnoreError();
        }
        if (revision % 7 == 0) {
          EXPECT_TRUE(store_->CollectOrphans().ok());
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  Reopen();
  for (int t = 0; t < kThreads; ++t) {
    const SessionPose pose = Pose(Key("s" + std::to_string(t)));
    EXPECT_EQ(pose.revision, 20u);
    EXPECT_EQ(pose.pose.vertices(0, 0), t);
  }
}

TEST_P(StoreContract, TakesNoFileForAnOrphanWhileItIsWritten) {
  constexpr int kModels = 60;
  const auto name = [](int i) { return "new" + std::to_string(i); };
  std::atomic<bool> written = false;
  std::thread writer([&] {
    for (int i = 0; i < kModels; ++i) {
      EXPECT_TRUE(
          store_->PutModel(ModelOf(Key(name(i))), ArraysOf(name(i))).ok());
    }
    written = true;
  });
  while (!written) EXPECT_EQ(store_->CollectOrphans().value(), 0);
  writer.join();
  for (int i = 0; i < kModels; ++i) {
    EXPECT_EQ(TextOf(store_->ModelArrays(Key(name(i))).value()), name(i));
  }
}

INSTANTIATE_TEST_SUITE_P(Every, StoreContract, testing::ValuesIn(Places()),
                         [](const auto& test) {
                           return std::string(test.param.kind->id()) +
                                  (test.param.simulated ? "Simulated" : "");
                         });

TEST(StoreKinds, AreFoundByName) {
  EXPECT_EQ((*FindStoreKind("sqlite"))->id(), "sqlite");
  const absl::Status status = FindStoreKind("redis").status();
  EXPECT_EQ(ReasonOf(status), "UNKNOWN_STORE");
  EXPECT_THAT(status.message(), HasSubstr("there are memory, sqlite"));
}

}  // namespace
}  // namespace deform::server
