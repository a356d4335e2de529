// Random calls on a disk that fails now and then, with crashes in between:
// what was acknowledged is there, what is there was asked for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "tests/server/sessions/session_life.h"

namespace deform::server {
namespace {

using Kind = SimulatedDisk::Fault::Kind;

// What should be true of something after a crash.
enum class Fate { kThere, kGone, kEither };

// The plainest model of what a server holds.
struct Expected {
  struct Posed {
    std::string binding_id;
    std::vector<Positions> poses;  // By revision.
    uint64_t durable = 0;          // Acknowledged.
    uint64_t sent = 0;             // Sequence of the stream.
    FakeStream* stream = nullptr;
  };
  std::map<std::string, Fate> bindings;
  std::map<std::string, Fate> sessions;
  std::map<std::string, Posed> posed;  // Of sessions that are there.
};

class RandomLives {
 public:
  explicit RandomLives(uint64_t seed) : random_(seed) {}

  void Run() {
    for (int life = 0; life < 5; ++life) {
      SCOPED_TRACE(absl::StrCat("life ", life));
      life_.emplace(disk_);
      const auto losses = life_->Load();
      ASSERT_TRUE(losses.ok()) << losses.status();
      ASSERT_TRUE(losses->empty()) << losses->front();
      Compare();
      for (int step = 0; step < 40 && !testing::Test::HasFailure(); ++step) {
        if (Below(12) == 0) {
          disk_.Inject({.kind = Kind::kError,
                        .at = static_cast<int64_t>(Below(20)),
                        .error = Below(2) == 0 ? EIO : ENOSPC});
        }
        Step();
      }
      End();
    }
  }

 private:
  uint64_t Below(uint64_t bound) { return random_() % bound; }

  void Step() {
    const std::string id = absl::StrCat("s", Below(3));
    switch (Below(8)) {
      case 0:
        return Bind();
      case 1:
        return Create(id);
      case 2:
        return Delete(id);
      case 3:
        return Unbind();
      default:
        return Pose(id);
    }
  }

  // What became of a call that should end in `wanted`, and of what it is about.
  static void Note(const absl::Status& status, Fate wanted, Fate& fate) {
    if (status.ok()) {
      fate = wanted;
      return;
    }
    const std::string reason = DetailOf(status).reason;
    ASSERT_TRUE(reason == "STORE_FAILED" || reason == "DISK_FULL") << status;
    if (fate != wanted) fate = Fate::kEither;
  }

  void Bind() {
    const double half_size = 1.0 + static_cast<double>(Below(2));
    const auto id = life_->BindBall(half_size);
    if (id.ok()) {
      Fate& fate = expected_.bindings.emplace(*id, Fate::kThere).first->second;
      // If removing it has failed, nothing was written again.
      if (fate != Fate::kEither) fate = Fate::kThere;
      known_[half_size] = *id;
    } else if (known_.contains(half_size)) {
      Fate& fate = expected_.bindings[known_[half_size]];
      Note(id.status(), Fate::kThere, fate);
    } else {
      Fate ignored = Fate::kGone;  // Its id is not known yet.
      Note(id.status(), Fate::kThere, ignored);
    }
    life_->life().RunAll();
  }

  // A binding that is there now.
  std::optional<std::string> AnyBinding() {
    const auto all = life_->life().bindings().catalogue().All();
    if (all.empty()) return std::nullopt;
    return all[Below(all.size())]->id;
  }

  void Create(const std::string& id) {
    const auto binding = AnyBinding();
    if (!binding || expected_.posed.contains(id)) return;
    const absl::Status status = life_->Create(*binding, id);
    auto [fate, made] = expected_.sessions.emplace(id, Fate::kGone);
    Note(status, Fate::kThere, fate->second);
    if (!status.ok()) return;
    expected_.posed[id] = {.binding_id = *binding,
                           .poses = {life_->Find(id)->posed().pose.vertices}};
  }

  void Delete(const std::string& id) {
    if (!expected_.posed.contains(id)) return;
    const absl::Status status = life_->sessions().Delete("t", id);
    Note(status, Fate::kGone, expected_.sessions[id]);
    if (status.ok()) expected_.posed.erase(id);
  }

  void Unbind() {
    const auto id = AnyBinding();
    if (!id) return;
    const absl::Status status = life_->life().bindings().Remove("t", *id);
    if (DetailOf(status).reason == "BINDING_IN_USE") return;
    Note(status, Fate::kGone, expected_.bindings[*id]);
  }

  void Pose(const std::string& id) {
    const auto found = expected_.posed.find(id);
    if (found == expected_.posed.end()) return;
    Expected::Posed& posed = found->second;
    if (posed.stream == nullptr) posed.stream = &life_->Join(id);
    const auto place = [&] {
      return 1.0 + 0.01 * static_cast<double>(Below(100));
    };
    const PoseUpdate update = Below(2) == 0
                                  ? MovedBy({place(), place(), place()})
                                  : MoveVertex(static_cast<int32_t>(Below(8)),
                                               {place(), place(), place()});
    ASSERT_TRUE(posed.stream->participant->Submit(++posed.sent, update));
    life_->Run();
    while (posed.stream->participant->Take()) {
    }
    posed.poses.push_back(life_->Find(id)->posed().pose.vertices);
    ASSERT_EQ(life_->Find(id)->state().revision, posed.poses.size() - 1);
    if (Below(3) == 0) life_->Sync().IgnoreError();
  }

  void End() {
    for (auto& [id, posed] : expected_.posed) {
      posed.durable = life_->Find(id)->state().durable_revision;
      EXPECT_LE(posed.durable, posed.poses.size() - 1);
      posed.stream = nullptr;
      posed.sent = 0;
    }
    disk_.Inject({.kind = Kind::kPowerLoss});
    life_.reset();
    disk_.Restart(random_());
  }

  // What is there against what may be. What is found is what is expected from
  // then on.
  void Compare() {
    const auto settle = [](std::map<std::string, Fate>& fates, auto is_there) {
      for (auto& [id, fate] : fates) {
        const bool there = is_there(id);
        EXPECT_TRUE(fate == Fate::kEither || there == (fate == Fate::kThere))
            << id;
        fate = there ? Fate::kThere : Fate::kGone;
      }
    };
    settle(expected_.bindings, [&](const std::string& id) {
      return life_->life().bindings().catalogue().Find("t", id).ok();
    });
    settle(expected_.sessions, [&](const std::string& id) {
      return life_->sessions().catalogue().Find("t", id).ok();
    });
    for (const auto& session : life_->sessions().catalogue().All()) {
      ComparePose(*session);
    }
    std::erase_if(expected_.posed, [&](const auto& entry) {
      return expected_.sessions[entry.first] != Fate::kThere;
    });
  }

  void ComparePose(const Session& session) {
    const SessionState state = session.state();
    Expected::Posed& posed = expected_.posed[state.id];
    EXPECT_EQ(state.durable_revision, state.revision);
    const Positions found = session.posed().pose.vertices;
    if (posed.poses.empty()) {
      // Its creation was refused, and yet it is there: at rest.
      EXPECT_EQ(state.revision, 0u);
      posed.binding_id = state.binding_id;
      posed.poses = {found};
    }
    EXPECT_EQ(state.binding_id, posed.binding_id);
    EXPECT_GE(state.revision, posed.durable);
    ASSERT_LT(state.revision, posed.poses.size());
    EXPECT_EQ(found, posed.poses[state.revision]);
    posed.poses.resize(state.revision + 1);
  }

  std::mt19937_64 random_;
  SimulatedDisk disk_;
  std::optional<SessionLife> life_;
  Expected expected_;
  std::map<double, std::string> known_;  // Ids of bindings by size.
};

TEST(RandomLives, EndWithWhatWasAcknowledged) {
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(absl::StrCat("seed ", seed));
    RandomLives(seed).Run();
    if (HasFailure()) return;
  }
}

}  // namespace
}  // namespace deform::server
