// Whatever several people do to a session in any order, it is where a plain
// account of their doings says.
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "server/sessions/session.h"
#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

using Direction = EditHistory::Direction;
using std::chrono::milliseconds;

constexpr int kPeople = 3;
constexpr int32_t kVertices = 8;

// What should be true, told in the simplest way: x of each vertex, who holds it
// until when, and of each person what every edit found and left.
struct Account {
  struct Edit {
    uint64_t number = 0;
    std::map<int32_t, std::pair<double, double>> places;
  };
  struct Person {
    std::vector<Edit> done;
    std::vector<Edit> undone;
  };
  struct Lock {
    int owner = 0;
    int64_t until_ms = 0;
  };

  std::vector<double> x;
  std::map<int32_t, Lock> locks;
  std::vector<Person> people{kPeople};
  int64_t now_ms = 0;

  bool MayMove(int who, int32_t vertex) const {
    const auto lock = locks.find(vertex);
    return lock == locks.end() || lock->second.owner == who ||
           lock->second.until_ms <= now_ms;
  }
  bool MayMove(int who, const std::set<int32_t>& vertices) const {
    for (const int32_t vertex : vertices) {
      if (!MayMove(who, vertex)) return false;
    }
    return true;
  }

  bool Put(int who, const std::set<int32_t>& vertices, double to,
           uint64_t edit) {
    if (!MayMove(who, vertices)) return false;
    Person& person = people[who];
    if (edit != 0) {
      const bool goes_on = person.undone.empty() && !person.done.empty() &&
                           person.done.back().number == edit;
      if (!goes_on) person.done.push_back({.number = edit});
      person.undone.clear();
    }
    for (const int32_t vertex : vertices) {
      if (edit != 0) {
        auto& places = person.done.back().places;
        const auto found = places.find(vertex);
        const bool mine =
            found != places.end() && found->second.second == x[vertex];
        places[vertex] = {mine ? found->second.first : x[vertex], to};
      }
      x[vertex] = to;
    }
    return true;
  }

  // The reason why not, or "".
  std::string Reverse(int who, Direction direction) {
    const bool undo = direction == Direction::kUndo;
    auto& from = undo ? people[who].done : people[who].undone;
    auto& to = undo ? people[who].undone : people[who].done;
    if (from.empty()) return undo ? "NOTHING_TO_UNDO" : "NOTHING_TO_REDO";
    std::set<int32_t> untouched;
    for (const auto& [vertex, place] : from.back().places) {
      if (x[vertex] == (undo ? place.second : place.first)) {
        untouched.insert(vertex);
      }
    }
    if (!untouched.empty() && !MayMove(who, untouched)) return "HANDLE_LOCKED";
    for (const int32_t vertex : untouched) {
      const auto& place = from.back().places[vertex];
      x[vertex] = undo ? place.first : place.second;
    }
    to.push_back(from.back());
    from.pop_back();
    return untouched.empty() ? "EDIT_OVERWRITTEN" : "";
  }

  bool Take(int who, const std::set<int32_t>& vertices, int64_t lease_ms) {
    if (!MayMove(who, vertices)) return false;
    for (const int32_t vertex : vertices) {
      locks[vertex] = {who, now_ms + lease_ms};
    }
    return true;
  }
  void Release(int who) {
    std::erase_if(locks,
                  [who](const auto& l) { return l.second.owner == who; });
  }
};

class Company {
 public:
  explicit Company(uint32_t seed) : random_(seed) {
    for (int who = 0; who < kPeople; ++who) Join(who);
    const Pose pose = session_->posed().pose;
    for (int32_t i = 0; i < kVertices; ++i) {
      account_.x.push_back(pose.vertices(i, 0));
    }
  }

  void DoSomething() {
    const int who = Below(kPeople);
    switch (Below(12)) {
      case 0:
        return Lock(who);
      case 1:
        people_[who].participant->Unlock(++people_[who].sequence,
                                         std::vector<int32_t>{}, 0);
        return account_.Release(who);
      case 2:
      case 3:
        return Reverse(who, Direction::kUndo);
      case 4:
        return Reverse(who, Direction::kRedo);
      case 5:
        rooms_.clock.Advance(milliseconds(700));
        account_.now_ms += 700;
        return;
      case 6:
        rooms_.executor.RunAll();
        return;
      case 7:  // Its stream breaks, and it comes back.
        people_[who].participant.reset();
        return Join(who);
      default:
        return Put(who);
    }
  }

  void Compare() {
    rooms_.executor.RunAll();
    const Pose pose = session_->posed().pose;
    for (int32_t i = 0; i < kVertices; ++i) {
      ASSERT_EQ(pose.vertices(i, 0), account_.x[i]) << "vertex " << i;
    }
  }

 private:
  struct Person : FakeStream {
    uint64_t sequence = 0;
    uint64_t edit = 1;
    std::string token;
  };

  int Below(int bound) {
    return std::uniform_int_distribution<int>(0, bound - 1)(random_);
  }
  std::set<int32_t> SomeVertices() {
    std::set<int32_t> vertices;
    for (int i = Below(3); i >= 0; --i) vertices.insert(Below(kVertices));
    return vertices;
  }

  void Join(int who) {
    Person& person = people_[who];
    auto joined = session_->Join(Delivery::kLatest, FrameWishes{},
                                 person.receiver, {.token = person.token});
    ASSERT_TRUE(joined.ok()) << joined.status();
    ASSERT_EQ(joined->resumed, !person.token.empty());
    // What was refused last is no longer known as refused, and is not sent
    // again here.
    ASSERT_LE(joined->last_sequence, person.sequence);
    person.participant = std::move(joined->participant);
    person.token = joined->token;
    Refusal(who);  // Those of before come again.
  }

  // Of the request that was sent last; "" if it was not refused.
  std::string Refusal(int who) {
    std::string reason;
    while (auto next = people_[who].participant->Take()) {
      const auto* rejection = std::get_if<Rejection>(&*next);
      if (rejection != nullptr &&
          rejection->sequence == people_[who].sequence) {
        reason = DetailOf(rejection->status).reason;
      }
    }
    return reason;
  }

  void Put(int who) {
    Person& person = people_[who];
    if (Below(3) == 0) ++person.edit;
    const uint64_t edit = Below(4) == 0 ? 0 : person.edit;
    const std::set<int32_t> vertices = SomeVertices();
    // No two writes are alike.
    const double to = ++writes_;
    PoseUpdate update{.vertices = {vertices.begin(), vertices.end()}};
    const Pose now = session_->posed().pose;
    update.positions = now.vertices(update.vertices, Eigen::all);
    update.positions.col(0).setConstant(to);
    person.participant->Submit(++person.sequence, update, {.edit = edit});
    ASSERT_EQ(Refusal(who),
              account_.Put(who, vertices, to, edit) ? "" : "HANDLE_LOCKED");
  }

  void Reverse(int who, Direction direction) {
    Person& person = people_[who];
    person.participant->Reverse(++person.sequence, direction);
    ASSERT_EQ(Refusal(who), account_.Reverse(who, direction));
  }

  void Lock(int who) {
    Person& person = people_[who];
    const std::set<int32_t> vertices = SomeVertices();
    person.participant->Lock(
        ++person.sequence,
        std::vector<int32_t>(vertices.begin(), vertices.end()),
        milliseconds(2000), 0);
    ASSERT_EQ(Refusal(who),
              account_.Take(who, vertices, 2000) ? "" : "HANDLE_LOCKED");
  }

  std::mt19937 random_;
  SessionRooms rooms_;
  std::shared_ptr<Session> session_ = Session::Create(
      "s", rooms_.bindings().Use("t", rooms_.binding_id, "session s").value(),
      {}, rooms_.Environment());
  Account account_;
  Person people_[kPeople];
  double writes_ = 100;
};

TEST(ParticipantsProperty, AnyOrderOfDoingsEndsWhereAPlainAccountSays) {
  for (uint32_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    Company company(seed);
    for (int i = 0; i < 150; ++i) {
      company.DoSomething();
      if (testing::Test::HasFatalFailure()) return;
      if (i % 10 == 0) company.Compare();
    }
    company.Compare();
    if (testing::Test::HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace deform::server
