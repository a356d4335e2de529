// The program killed under load, at random moments: what it acknowledged is
// there when it starts again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/cpp/client.h"
#include "core/base/error.h"
#include "core/deform/deformer.h"
#include "deform/v1/server.grpc.pb.h"
#include "tests/end_to_end/process.h"
#include "tests/end_to_end/raw_call.h"
#include "tests/end_to_end/running_server.h"
#include "tests/support/tcp_proxy.h"
#include "tests/support/temporary_folder.h"

namespace deform {
namespace {

constexpr char kSession[] = "posed";
constexpr int64_t kVertices = 8;

// DEFORM_KILLS=200 is the long form.
int Kills() {
  const char* kills = std::getenv("DEFORM_KILLS");
  return kills != nullptr ? std::atoi(kills) : 5;
}

// Where revision `number` of the session puts what it moves: every fourth all
// vertices, others one.
Vec3 PlaceOf(uint64_t number, int64_t vertex) {
  const double n = static_cast<double>(number % 1000);
  return Vec3(Cube().vertices().row(vertex)) +
         Vec3(0.001 * n, 0.0005 * n * static_cast<double>(vertex), -0.002 * n);
}
PoseUpdate UpdateOf(uint64_t revision) {
  PoseUpdate update;
  const bool whole = revision % 4 == 0;
  const int64_t first = whole ? 0 : static_cast<int64_t>(revision % kVertices);
  const int64_t count = whole ? kVertices : 1;
  if (!whole) update.vertices = {static_cast<int32_t>(first)};
  update.positions.resize(count, 3);
  for (int64_t i = 0; i < count; ++i) {
    update.positions.row(i) = PlaceOf(revision, first + i);
  }
  return update;
}
Pose PoseOf(uint64_t revision) {
  Pose pose = RestPose(Cube());
  // From the last that moved all vertices.
  for (uint64_t r = std::max<uint64_t>(1, revision - revision % 4);
       r <= revision; ++r) {
    ApplyPoseUpdate(UpdateOf(r), pose);
  }
  return pose;
}

// What the model looks like in that revision.
Positions DeformedBy(const Pose& pose) {
  static const auto binding =
      Bind({.model = std::make_shared<const Mesh>(Ball()),
            .rig = Cube(),
            .scheme = "green"},
           {})
          .value();
  Deformer deformer(binding, nullptr);
  DeformJob job{.deformer = &deformer, .pose = &pose};
  MoveTogether({&job, 1}, nullptr);
  return deformer.positions();
}

// All that was acknowledged, over all lives.
struct Acknowledged {
  std::set<std::string> models;
  std::set<std::string> bindings;
  std::set<std::string> sessions;
  // Asked for, and not answered: there or not.
  std::set<std::string> perhaps;
  uint64_t durable = 0;  // Revision of the posed session.
  uint64_t sent = 0;     // No revision is beyond this.
  uint64_t epoch = 0;
};

class Crashes : public testing::Test {
 protected:
  std::vector<std::string> Arguments() const {
    return {"--data-dir", Temporary().Path("crashed")};
  }

  // Kills the server at a random moment after so many answers.
  class Killer {
   public:
    Killer(Process& process, int64_t answers, uint64_t spins)
        : thread_([this, &process, answers, spins] {
            while (answers_ < answers && !given_up_) std::this_thread::yield();
            for (volatile uint64_t i = 0; i < spins;) i = i + 1;
            fired_ = true;
            process.Signal(SIGKILL);
          }) {}
    ~Killer() {
      given_up_ = true;
      thread_.join();
    }
    void Answered() { ++answers_; }
    bool fired() const { return fired_; }

   private:
    std::atomic<int64_t> answers_ = 0;
    std::atomic<bool> given_up_ = false;
    std::atomic<bool> fired_ = false;
    std::thread thread_;
  };

  // The session that is posed, and what is needed for it.
  void Begin(Client& client) {
    const BindingInfo binding = RunningServer::BindBall(client);
    known_.models.insert(binding.model_id);
    known_.bindings.insert(binding.binding_id);
    const SessionInfo session =
        client.CreateSession(binding.binding_id, kSession).value();
    known_.sessions.insert(kSession);
    known_.epoch = session.epoch;
  }

  void Compare(Client& client) {
    std::set<std::string> models;
    std::set<std::string> bindings;
    std::set<std::string> sessions;
    const auto listed_models = client.ListModels().value();
    const auto listed_bindings = client.ListBindings().value();
    const auto listed_sessions = client.ListSessions().value();
    for (const auto& model : listed_models) models.insert(model.model_id);
    for (const auto& binding : listed_bindings) {
      bindings.insert(binding.binding_id);
      EXPECT_TRUE(client.GetRig(binding.binding_id).ok());
    }
    for (const auto& session : listed_sessions) {
      sessions.insert(session.session_id);
    }
    ExpectAll(known_.models, models);
    ExpectAll(known_.bindings, bindings);
    ExpectAll(known_.sessions, sessions);
    known_.models = models;
    known_.bindings = bindings;
    known_.sessions = sessions;
    known_.perhaps.clear();
    ComparePose(client);
  }

  // Nothing that was acknowledged is missing, and nothing is there that was
  // removed or never asked for.
  void ExpectAll(const std::set<std::string>& acknowledged,
                 const std::set<std::string>& found) {
    for (const std::string& id : acknowledged) {
      EXPECT_TRUE(found.contains(id) || known_.perhaps.contains(id))
          << id << " is lost";
    }
    for (const std::string& id : found) {
      EXPECT_TRUE(acknowledged.contains(id) || known_.perhaps.contains(id) ||
                  known_.perhaps.contains("new"))
          << id << " is back";
    }
  }

  void ComparePose(Client& client) {
    auto stream = client.Deform(kSession).value();
    const uint64_t revision = stream.joined().revision;
    EXPECT_GE(revision, known_.durable);
    EXPECT_LE(revision, known_.sent);
    EXPECT_EQ(stream.joined().pose.vertices, PoseOf(revision).vertices);
    Frame frame;
    ASSERT_TRUE(stream.NextFrame(frame).ok());
    EXPECT_EQ(frame.revision, revision);
    EXPECT_GT(frame.epoch, known_.epoch);
    // Float weights and frames, in units of D of the cube.
    EXPECT_LT((frame.DoublePositions() - DeformedBy(PoseOf(revision)))
                  .cwiseAbs()
                  .maxCoeff(),
              1e-6 * 3.5);
    known_.sent = revision;
    known_.durable = revision;
    known_.epoch = frame.epoch;
  }

  // Calls of all kinds until one fails: the server is dead then.
  void Live(const std::string& address, Killer& killer) {
    Client client = Client::Connect(address).value();
    auto stream =
        client
            .Deform(kSession, {.delivery = Delivery::kEvery,
                               .reconnect_for = std::chrono::milliseconds(0)})
            .value();
    Frame frame;
    while (Change(client, killer) && Pose(stream, frame, killer)) {
    }
    EXPECT_TRUE(killer.fired()) << "a call failed while the server lived";
  }

  // A few poses in flight; each is a revision.
  bool Pose(DeformStream& stream, Frame& frame, Killer& killer) {
    const uint64_t poses = 1 + random_() % 3;
    for (uint64_t i = 0; i < poses; ++i) {
      if (!stream.Send(UpdateOf(known_.sent + 1)).ok()) return false;
      ++known_.sent;
    }
    do {
      if (!stream.NextFrame(frame).ok()) return false;
      // It may be ahead of the frame, which was made before it was sent.
      EXPECT_LE(frame.durable_revision, known_.sent);
      known_.durable = std::max(known_.durable, frame.durable_revision);
      killer.Answered();
    } while (frame.revision < known_.sent);
    return true;
  }

  bool Change(Client& client, Killer& killer) {
    known_.perhaps = {"new"};
    bool answered = false;
    switch (random_() % 6) {
      case 0:
        answered = Register(client);
        break;
      case 1:
        answered = Remove(client);
        break;
      case 2: {
        const auto session = client.GetSession(kSession);
        answered = session.ok();
        if (!answered) break;
        known_.durable = std::max(known_.durable, session->durable_revision);
        break;
      }
      default:
        return true;
    }
    if (answered) {
      known_.perhaps.clear();
      killer.Answered();
    }
    return answered;
  }

  // A model of its own, bound, with a session.
  bool Register(Client& client) {
    const double radius = 0.3 + 1e-4 * static_cast<double>(random_() % 1000);
    const auto model = client.RegisterModel(MeshOf(Icosphere(radius, 1)), "");
    if (!model.ok()) return false;
    known_.models.insert(model->model_id);
    const auto binding =
        client.CreateBinding({.model_id = model->model_id, .rig = Cube()});
    if (!binding.ok()) return false;
    known_.bindings.insert(binding->binding_id);
    const auto session = client.CreateSession(binding->binding_id, "");
    if (!session.ok()) return false;
    known_.sessions.insert(session->session_id);
    return true;
  }

  // Some binding with its sessions, but for the one that is posed.
  bool Remove(Client& client) {
    const auto sessions = client.ListSessions();
    if (!sessions.ok()) return false;
    for (const SessionInfo& session : *sessions) {
      if (session.session_id == kSession) continue;
      known_.perhaps.insert({session.session_id, session.binding_id});
      if (!client.DeleteSession(session.session_id).ok()) return false;
      known_.sessions.erase(session.session_id);
      // The model may have been registered twice: others may use the binding.
      const absl::Status status = client.DeleteBinding(session.binding_id);
      if (DetailOf(status).reason == "BINDING_IN_USE") return true;
      if (!status.ok()) return false;
      known_.bindings.erase(session.binding_id);
      return true;
    }
    return true;
  }

  Acknowledged known_;
  std::mt19937_64 random_{20};
};

TEST_F(Crashes, LoseNothingThatWasAcknowledged) {
  const int kills = Kills();
  for (int life = 0; life <= kills; ++life) {
    SCOPED_TRACE(absl::StrCat("life ", life));
    Daemon daemon(Arguments());
    Client client = Client::Connect(daemon.address()).value();
    if (life == 0) {
      Begin(client);
    } else {
      Compare(client);
    }
    if (HasFailure() || life == kills) return;
    Killer killer(daemon, 1 + static_cast<int64_t>(random_() % 60),
                  random_() % 3'000'000);
    Live(daemon.address(), killer);
  }
}

// A stream that is not told: it joins again by itself, and what it sent and the
// server had not made durable comes again, answered or not.
TEST_F(Crashes, LoseNoPoseOfADragThatGoesOn) {
  const int kills = Kills();
  std::optional<Daemon> daemon(std::in_place, Arguments());
  TcpProxy proxy(daemon->address());
  Client client = Client::Connect(proxy.address()).value();
  Begin(client);
  auto stream = client.Deform(kSession).value();
  deform::Pose expected = RestPose(Cube());
  uint64_t sent = 0;
  const auto send = [&](uint64_t count) {
    for (const uint64_t last = sent + count; sent < last; ++sent) {
      const PoseUpdate update = {
          .vertices = {static_cast<int32_t>(sent % kVertices)},
          .positions = PlaceOf(sent, sent % kVertices).transpose()};
      ApplyPoseUpdate(update, expected);
      ASSERT_EQ(stream.Send(update).value(), sent + 1);
    }
  };
  Frame frame;
  for (int life = 0; life < kills; ++life) {
    SCOPED_TRACE(absl::StrCat("life ", life));
    const uint64_t answered = sent + 1 + random_() % 6;
    send(8);
    do {
      ASSERT_TRUE(stream.NextFrame(frame).ok());
    } while (frame.answers_sequence < answered);
    daemon.reset();
    send(1);
    daemon.emplace(Arguments());
    proxy.SetTarget(daemon->address());
    do {
      ASSERT_TRUE(stream.NextFrame(frame).ok());
    } while (frame.answers_sequence < sent);
    Client other = Client::Connect(daemon->address()).value();
    ASSERT_EQ(other.Deform(kSession)->joined().pose.vertices,
              expected.vertices);
  }
  EXPECT_EQ(stream.reconnections(), kills);
}

std::vector<std::string> DataDir(const std::string& path) {
  return {"--data-dir", path};
}

TEST(Backups, ServeAsTheServerDidAtThatInstant) {
  std::string backup;
  std::string session;
  {
    Daemon daemon(DataDir(Temporary().Path("original")));
    Client client = Client::Connect(daemon.address()).value();
    session = client.CreateSession(RunningServer::BindBall(client).binding_id)
                  ->session_id;
    auto stream = client.Deform(session).value();
    ASSERT_TRUE(stream.Send(UpdateOf(4)).ok());
    while (client.GetSession(session)->durable_revision < 1) {
      std::this_thread::yield();
    }
    backup = client.Backup("monday").value();
    EXPECT_EQ(DetailOf(client.Backup("monday").status()).reason,
              "DIRECTORY_EXISTS");
    EXPECT_EQ(DetailOf(client.Backup("../monday").status()).reason, "BAD_NAME");
    ASSERT_TRUE(client.DeleteSession(session).ok());
  }
  auto arguments = DataDir(Temporary().Path("restored"));
  arguments.insert(arguments.end(), {"--restore", backup});
  Daemon daemon(arguments);
  Client client = Client::Connect(daemon.address()).value();
  EXPECT_EQ(client.GetSession(session)->revision, 1u);
  EXPECT_EQ(client.Deform(session)->joined().pose.vertices, PoseOf(4).vertices);
}

TEST(Backups, AreNotRestoredOverWhatIsThere) {
  const std::string path = Temporary().Path("there");
  { Daemon daemon(DataDir(path)); }
  Process process({"--data-dir", path, "--restore", path});
  EXPECT_THAT(process.ReadErrors(), testing::HasSubstr("File exists"));
  EXPECT_EQ(process.Wait(), 1);
  Process in_memory({"--in-memory", "--restore", path});
  EXPECT_THAT(in_memory.ReadErrors(), testing::HasSubstr("--in-memory"));
  EXPECT_EQ(in_memory.Wait(), 2);
}

TEST(Backups, AreNoMoreThanTheServerMayKeep) {
  auto arguments = DataDir(Temporary().Path("full"));
  arguments.insert(arguments.end(), {"--max-backups", "2"});
  Daemon daemon(arguments);
  Client client = Client::Connect(daemon.address()).value();
  EXPECT_TRUE(client.Backup("monday").ok());
  const std::string tuesday = client.Backup("tuesday").value();
  const absl::Status full = client.Backup("wednesday").status();
  EXPECT_EQ(full.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(DetailOf(full).reason, "TOO_MANY_BACKUPS");
  EXPECT_THAT(std::string(full.message()),
              testing::HasSubstr("holds 2 backups, its limit (max-backups): "
                                 "move some elsewhere"));
  std::filesystem::rename(tuesday, Temporary().Path("moved"));
  EXPECT_TRUE(client.Backup("wednesday").ok());
}

TEST(Backups, AreNotMadeOfAServerThatKeepsNothing) {
  RunningServer server;
  EXPECT_EQ(DetailOf(server.client().Backup("monday").status()).reason,
            "NOTHING_STORED");
}

uint64_t CollectOrphans(const std::string& address) {
  const auto stub = v1::ServerService::NewStub(PlainChannel(address));
  grpc::ClientContext context;
  v1::CollectOrphansResponse response;
  EXPECT_TRUE(
      stub->CollectOrphans(&context, v1::CollectOrphansRequest(), &response)
          .ok());
  return response.files_removed();
}

TEST(Orphans, AreRemovedWhileTheServerServes) {
  const std::string path = Temporary().Path("orphans");
  Daemon daemon(DataDir(path));
  Client client = Client::Connect(daemon.address()).value();
  const BindingInfo binding = RunningServer::BindBall(client);
  EXPECT_EQ(CollectOrphans(daemon.address()), 0u);
  const std::string orphan = path + "/models/default/m-nobody";
  std::ofstream(orphan) << "of a crash";
  EXPECT_EQ(CollectOrphans(daemon.address()), 1u);
  EXPECT_FALSE(std::filesystem::exists(orphan));
  EXPECT_TRUE(client.GetRig(binding.binding_id).ok());
  EXPECT_TRUE(
      std::filesystem::exists(path + "/models/default/" + binding.model_id));
}

TEST_F(Crashes, LeaveADirectoryThatAnotherServerDoesNotTake) {
  Daemon daemon(Arguments());
  Process second({"--listen", "127.0.0.1:0", "--data-dir",
                  Temporary().Path("crashed"), "--log-level", "warn"});
  EXPECT_THAT(second.ReadErrors(), testing::HasSubstr("is used by process"));
  EXPECT_EQ(second.Wait(), 1);
}

}  // namespace
}  // namespace deform
