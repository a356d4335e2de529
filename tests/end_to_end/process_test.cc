// The program itself: what it prints, how it ends.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <string>
#include <thread>

#include "client/cpp/client.h"
#include "core/base/error.h"
#include "deform/v1/binding.grpc.pb.h"
#include "tests/end_to_end/long_binding.h"
#include "tests/end_to_end/process.h"
#include "tests/end_to_end/raw_call.h"
#include "tests/end_to_end/running_server.h"
#include "tests/support/temporary_folder.h"

namespace deform {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

TEST(Deformd, SaysWhereItListensAndServesThere) {
  Daemon daemon;
  Client client = Client::Connect(daemon.address()).value();
  const BindingInfo binding = RunningServer::BindBall(client);
  auto stream =
      client.Deform(client.CreateSession(binding.binding_id)->session_id)
          .value();
  Frame frame;
  EXPECT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.point_count(), 162);
}

TEST(Deformd, ListensOnAUnixSocket) {
  const std::string path = "unix:" + Temporary().Path("socket");
  Process daemon({"--listen", path, "--in-memory", "--log-level", "off"});
  EXPECT_EQ(daemon.ReadLine(), "listening on " + path + "\n");
  EXPECT_TRUE(Client::Connect(path)->ListModels().ok());
}

TEST(Deformd, DrainsAndExitsWith0OnSigterm) {
  Daemon daemon;
  Client client = Client::Connect(daemon.address()).value();
  const BindingInfo binding = RunningServer::BindBall(client);
  auto stream =
      client
          .Deform(client.CreateSession(binding.binding_id)->session_id,
                  {.reconnect_for = std::chrono::milliseconds(0)})
          .value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  daemon.Signal(SIGTERM);
  const absl::Status end = stream.NextFrame(frame);
  EXPECT_EQ(end.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(DetailOf(end).reason, "SERVER_DRAINING");
  EXPECT_EQ(daemon.Wait(), 0);
}

// A call that keeps the server busy for seconds, unless it is stopped.
class LongBinding {
 public:
  explicit LongBinding(const std::string& address)
      : stub_(v1::BindingService::NewStub(PlainChannel(address))) {
    Client client = Client::Connect(address).value();
    reader_ = stub_->CreateBinding(&context_, LongBindingRequest(client));
    v1::CreateBindingResponse response;
    EXPECT_TRUE(reader_->Read(&response));
  }
  absl::Status Finish() {
    v1::CreateBindingResponse response;
    while (reader_->Read(&response)) {
    }
    return FromGrpc(reader_->Finish());
  }

 private:
  std::unique_ptr<v1::BindingService::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::CreateBindingResponse>> reader_;
};

TEST(Deformd, CancelsWhatOutlastsTheDrainTimeout) {
  Daemon daemon({"--in-memory", "--drain-timeout", "0.05"});
  LongBinding binding(daemon.address());
  daemon.Signal(SIGTERM);
  EXPECT_FALSE(binding.Finish().ok());
  EXPECT_EQ(daemon.Wait(), 0);
}

constexpr char kHealth[] = "/grpc.health.v1.Health/Check";
constexpr char kServing[] = "\x08\x01";
constexpr char kNotServing[] = "\x08\x02";

TEST(Deformd, TellsItsHealth) {
  Daemon daemon;
  EXPECT_EQ(RawCall(daemon.address(), kHealth, "").first, kServing);
}

TEST(Deformd, IsNotServingWhileItDrainsAndRefusesCalls) {
  Daemon daemon({"--in-memory", "--drain-timeout", "3600"});
  LongBinding binding(daemon.address());
  Client client = Client::Connect(daemon.address()).value();
  daemon.Signal(SIGTERM);
  while (RawCall(daemon.address(), kHealth, "").first != kNotServing) {
    std::this_thread::yield();
  }
  absl::Status refused;
  while ((refused = client.ListModels().status()).ok()) {
    std::this_thread::yield();
  }
  EXPECT_EQ(DetailOf(refused).reason, "SERVER_DRAINING");
  // Asked again it does not wait any longer.
  daemon.Signal(SIGTERM);
  EXPECT_EQ(daemon.Wait(), 128 + SIGTERM);
}

TEST(Deformd, DescribesItsServices) {
  Daemon daemon;
  // ServerReflectionRequest{list_services: "*"}
  const std::string services =
      RawCall(daemon.address(),
              "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
              "\x3a\x01*")
          .first;
  for (const char* name :
       {"deform.v1.ModelService", "deform.v1.BindingService",
        "deform.v1.SessionService", "grpc.health.v1.Health"}) {
    EXPECT_THAT(services, HasSubstr(name));
  }
}

TEST(Deformd, DoesNotShareAPort) {
  Daemon first;
  Process second({"--listen", first.address(), "--in-memory"});
  const std::string errors = second.ReadErrors();
  EXPECT_THAT(errors, HasSubstr("cannot listen on " + first.address()));
  EXPECT_EQ(std::count(errors.begin(), errors.end(), '\n'), 1) << errors;
  EXPECT_EQ(second.Wait(), 1);
}

TEST(Deformd, PrintsItsConfiguration) {
  Process process({"--max-sessions", "7", "--config-check"});
  EXPECT_THAT(process.ReadAll(), HasSubstr("\nmax-sessions = 7\n"));
  EXPECT_EQ(process.Wait(), 0);
}

TEST(Deformd, RefusesABadConfigurationByFileAndLine) {
  const std::string file =
      Temporary().Write("deformd.toml", "\nmax-sessions = \"many\"\n");
  Process process({"--config", file});
  EXPECT_EQ(process.ReadErrors(),
            "deformd: " + file + ":2: max-sessions: is a whole number\n");
  EXPECT_EQ(process.Wait(), 2);
}

TEST(Deformd, HelpsAndTellsItsVersion) {
  Process help({"--help"});
  EXPECT_THAT(help.ReadAll(), HasSubstr("Keep nothing on disk"));
  EXPECT_EQ(help.Wait(), 0);
  Process version({"--version"});
  EXPECT_THAT(version.ReadAll(), StartsWith("deformd "));
  EXPECT_EQ(version.Wait(), 0);
  Process unknown({"--frobnicate"});
  EXPECT_THAT(unknown.ReadErrors(), HasSubstr("--frobnicate"));
  EXPECT_EQ(unknown.Wait(), 2);
}

}  // namespace
}  // namespace deform
