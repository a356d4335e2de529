// Models and bindings over a real connection.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <future>
#include <optional>
#include <thread>
#include <utility>

#include "core/base/error.h"
#include "deform/v1/binding.grpc.pb.h"
#include "deform/v1/model.grpc.pb.h"
#include "tests/end_to_end/long_binding.h"
#include "tests/end_to_end/raw_call.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

TEST(Models, AreRegisteredOnceByContent) {
  RunningServer server;
  const ModelInfo first = server.client().RegisterModel(Ball(), "ball").value();
  EXPECT_FALSE(first.existed);
  EXPECT_EQ(first.vertex_count, 162);
  EXPECT_EQ(first.face_count, 320);
  EXPECT_THAT(first.box_max, SizeIs(3));
  EXPECT_THAT(first.box_max, testing::Each(testing::DoubleNear(0.5, 1e-15)));
  const ModelInfo again = server.client().RegisterModel(Ball(), "copy").value();
  EXPECT_TRUE(again.existed);
  EXPECT_EQ(again.model_id, first.model_id);
  EXPECT_EQ(again.display_name, "ball");
  EXPECT_THAT(server.client().ListModels().value(), SizeIs(1));
}

TEST(Models, LargerThanAMessageComeInChunks) {
  RunningServer server;
  // 655,362 points and 1,310,720 faces: 31 MB, 30 chunks.
  const ModelInfo model =
      server.client().RegisterModel(MeshOf(Icosphere(1, 8)), "large").value();
  EXPECT_EQ(model.vertex_count, 655'362);
}

TEST(Models, OfOneTenantAreNothingToAnother) {
  RunningServer server;
  Client other = server.Connect("other");
  const ModelInfo model = server.client().RegisterModel(Ball(), "mine").value();
  EXPECT_THAT(other.ListModels().value(), IsEmpty());
  EXPECT_EQ(DetailOf(other.GetModel(model.model_id).status()).reason,
            "MODEL_NOT_FOUND");
  EXPECT_EQ(DetailOf(other.DeleteModel(model.model_id)).reason,
            "MODEL_NOT_FOUND");
  const ModelInfo theirs = other.RegisterModel(Ball(), "theirs").value();
  EXPECT_FALSE(theirs.existed);
  EXPECT_NE(theirs.model_id, model.model_id);
}

TEST(Models, ThatAreNotThereAreNamed) {
  RunningServer server;
  const absl::Status status = server.client().GetModel("m-none").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(status.message(), "no model \"m-none\"");
  EXPECT_EQ(DetailOf(status).resource_type, "model");
  EXPECT_EQ(DetailOf(status).resource_name, "m-none");
}

TEST(Models, StayWhileABindingUsesThem) {
  RunningServer server;
  const BindingInfo binding = server.BindBall();
  const absl::Status used = server.client().DeleteModel(binding.model_id);
  EXPECT_EQ(used.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(used).reason, "MODEL_IN_USE");
  EXPECT_THAT(std::string(used.message()),
              HasSubstr("is used by binding " + binding.binding_id));
  ASSERT_TRUE(server.client().DeleteBinding(binding.binding_id).ok());
  EXPECT_TRUE(server.client().DeleteModel(binding.model_id).ok());
}

// Uploads by hand: what `send` writes, and how the call ends.
absl::Status Upload(
    const std::string& address,
    const std::function<void(grpc::ClientWriter<v1::RegisterModelRequest>&)>&
        send) {
  const auto stub = v1::ModelService::NewStub(PlainChannel(address));
  grpc::ClientContext context;
  v1::RegisterModelResponse response;
  const auto writer = stub->RegisterModel(&context, &response);
  send(*writer);
  writer->WritesDone();
  return FromGrpc(writer->Finish());
}

v1::RegisterModelRequest Header(uint64_t vertices) {
  v1::RegisterModelRequest request;
  request.mutable_header()->set_dimension(3);
  request.mutable_header()->set_vertex_count(vertices);
  return request;
}

v1::RegisterModelRequest Chunk(uint64_t offset, const std::string& data) {
  v1::RegisterModelRequest request;
  request.mutable_chunk()->set_offset(offset);
  request.mutable_chunk()->set_crc32(
      ::crc32(0, reinterpret_cast<const Bytef*>(data.data()), data.size()));
  request.mutable_chunk()->set_data(data);
  return request;
}

TEST(Uploads, BeginWithTheirHeader) {
  RunningServer server;
  const absl::Status chunk = Upload(server.address(), [](auto& writer) {
    writer.Write(Chunk(0, std::string(24, '\0')));
  });
  EXPECT_EQ(DetailOf(chunk).reason, "HEADER_FIRST");
  EXPECT_EQ(DetailOf(Upload(server.address(), [](auto&) {})).reason,
            "HEADER_FIRST");
  const absl::Status twice = Upload(server.address(), [](auto& writer) {
    writer.Write(Header(1));
    writer.Write(Header(1));
  });
  EXPECT_EQ(DetailOf(twice).reason, "CHUNK_EXPECTED");
  EXPECT_EQ(twice.message(), "after the header an upload has chunks only");
}

TEST(Uploads, ThatBreakOffLeaveNothing) {
  RunningServer server;
  const absl::Status status = Upload(server.address(), [](auto& writer) {
    writer.Write(Header(100));
    writer.Write(Chunk(0, std::string(240, '\0')));
  });
  EXPECT_EQ(status.message(), "the upload ended after 240 of 2400 bytes");
  EXPECT_THAT(server.client().ListModels().value(), IsEmpty());
}

TEST(Uploads, BeyondTheLimitAreRefusedByTheirHeader) {
  server::Options options = TestOptions();
  options.max_model_bytes = {1000};
  RunningServer server(options);
  const absl::Status status =
      server.client().RegisterModel(Ball(), "ball").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(status.message(),
            "the header announces 7.547 KiB; the server takes 1000 B "
            "(max-model-bytes)");
}

TEST(Uploads, ThatStandStillAreCutOff) {
  server::Options options = TestOptions();
  options.stall_timeout = {0.2};
  RunningServer server(options);
  const auto stub = v1::ModelService::NewStub(PlainChannel(server.address()));
  grpc::ClientContext context;
  v1::RegisterModelResponse response;
  const auto writer = stub->RegisterModel(&context, &response);
  writer->Write(Header(100));
  EXPECT_EQ(writer->Finish().error_code(), grpc::StatusCode::CANCELLED);
}

TEST(Messages, ThatAreTooLargeOrGarbledAreRefused) {
  RunningServer server;
  EXPECT_EQ(RawCall(server.address(), "/deform.v1.ModelService/GetModel",
                    std::string((64 << 20) + 1, '\0'))
                .status.code(),
            absl::StatusCode::kResourceExhausted);
  EXPECT_FALSE(RawCall(server.address(), "/deform.v1.ModelService/GetModel",
                       "\xff\xff\xff")
                   .status.ok());
  EXPECT_TRUE(server.client().ListModels().ok());
}

TEST(Bindings, AreThereWhenAskedForAgain) {
  RunningServer server;
  const BindingInfo first = server.BindBall();
  EXPECT_FALSE(first.existed);
  EXPECT_EQ(first.vertex_count, 8);
  EXPECT_EQ(first.normal_count, 12);
  EXPECT_LT(first.quality.reproduction_error, 1e-6);  // Float weights.
  const BindingInfo again = server.BindBall();
  EXPECT_TRUE(again.existed);
  EXPECT_EQ(again.binding_id, first.binding_id);
  EXPECT_EQ(server.client().GetRig(first.binding_id)->vertices,
            Cube().vertices());
}

TEST(Bindings, TellProgressAndThenTheBinding) {
  RunningServer server;
  const ModelInfo model =
      server.client().RegisterModel(MeshOf(Icosphere(0.5, 6)), "").value();
  int64_t last = -1;
  const auto binding = server.client().CreateBinding(
      {.model_id = model.model_id, .rig = CageOf(Icosphere(1, 2))},
      [&](int64_t done, int64_t total) {
        EXPECT_GE(done, last);
        EXPECT_EQ(total, model.vertex_count);
        last = done;
        return true;
      });
  EXPECT_TRUE(binding.ok());
  EXPECT_GE(last, 0);
}

TEST(Bindings, SayWhichPointsCannotBeBound) {
  RunningServer server;
  Shape ball = Icosphere(0.5, 2);
  ball.positions.row(17) << 9, 9, 9;
  const ModelInfo model =
      server.client().RegisterModel(MeshOf(ball), "").value();
  const auto failed = server.client().CreateBinding(
      {.model_id = model.model_id, .rig = Cube()});
  EXPECT_EQ(failed.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(failed.status()).reason, "EXTERIOR_NO_EXIT_FACE");
  EXPECT_THAT(std::string(failed.status().message()), HasSubstr("17"));
  const auto reported =
      server.client().CreateBinding({.model_id = model.model_id,
                                     .rig = Cube(),
                                     .unbindable = Unbindable::kReport});
  EXPECT_EQ(reported->unbound_count, 1);
  EXPECT_EQ(reported->unbound[0].points, std::vector<int64_t>{17});
  // Lists leave out what grows with the model.
  const auto listed = server.client().ListBindings(model.model_id).value();
  ASSERT_THAT(listed, SizeIs(1));
  EXPECT_EQ(listed[0].unbound_count, 1);
  EXPECT_THAT(listed[0].unbound, IsEmpty());
}

TEST(Bindings, RefuseACageWithAHoleByName) {
  RunningServer server;
  const ModelInfo model = server.client().RegisterModel(Ball(), "").value();
  RigArrays open = Cube();
  open.faces.conservativeResize(11, 3);
  const absl::Status status =
      server.client()
          .CreateBinding({.model_id = model.model_id, .rig = open})
          .status();
  EXPECT_EQ(DetailOf(status).reason, "CAGE_NOT_CLOSED");
  EXPECT_EQ(DetailOf(status).field, "rig.cage.corners");
}

// Deletes the model as soon as nothing computes with it any more.
void AwaitFree(Client& client, const std::string& model_id) {
  while (!client.DeleteModel(model_id).ok()) {
    std::this_thread::yield();
  }
}

TEST(Bindings, StopWhenTheCallerCancels) {
  RunningServer server;
  const v1::CreateBindingRequest request = LongBindingRequest(server.client());
  const auto stub = v1::BindingService::NewStub(PlainChannel(server.address()));
  grpc::ClientContext context;
  const auto reader = stub->CreateBinding(&context, request);
  v1::CreateBindingResponse response;
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_TRUE(response.has_progress());
  context.TryCancel();
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  AwaitFree(server.client(), request.model_id());
  EXPECT_THAT(server.client().ListBindings().value(), IsEmpty());
}

TEST(Bindings, StopAtTheDeadline) {
  RunningServer server;
  const v1::CreateBindingRequest request = LongBindingRequest(server.client());
  const auto stub = v1::BindingService::NewStub(PlainChannel(server.address()));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::milliseconds(100));
  const auto reader = stub->CreateBinding(&context, request);
  v1::CreateBindingResponse response;
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  AwaitFree(server.client(), request.model_id());
}

TEST(Bindings, CutOffWhoDoesNotReadTheirWeights) {
  server::Options options = TestOptions();
  options.stall_timeout = {0.2};
  RunningServer server(options);
  // 20 MB: more than a connection holds.
  const ModelInfo model =
      server.client().RegisterModel(MeshOf(Icosphere(0.5, 5)), "").value();
  v1::GetWeightsRequest request;
  request.set_binding_id(server.client()
                             .CreateBinding({.model_id = model.model_id,
                                             .rig = CageOf(Icosphere(1, 2))})
                             .value()
                             .binding_id);
  const auto stub = v1::BindingService::NewStub(PlainChannel(server.address()));
  grpc::ClientContext context;
  const auto reader = stub->GetWeights(&context, request);
  v1::GetWeightsResponse response;
  ASSERT_TRUE(reader->Read(&response));
  // What is not read is sent no more: no call is left to be waited for.
  EXPECT_TRUE(server.server().Drain(std::chrono::seconds(60)));
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
}

// One thread computes: who asks for weights waits for a report of another.
TEST(Bindings, DoNotTakeTheirOwnWorkForAPeerThatStands) {
  server::Options options = TestOptions();
  options.stall_timeout = {0.1};
  options.compute_threads = 1;
  RunningServer server(options);
  // Differences of mean value coordinates in a cage of 1280 faces: half a
  // second and more.
  const ModelInfo model =
      server.client().RegisterModel(MeshOf(Icosphere(0.5, 3)), "").value();
  const BindingInfo binding =
      server.client()
          .CreateBinding({.model_id = model.model_id,
                          .rig = CageOf(Icosphere(1, 3)),
                          .scheme = "mean_value"})
          .value();
  std::promise<void> measuring;
  std::thread reporter([&] {
    EXPECT_TRUE(
        server.client()
            .GetQuality(
                {.binding_id = binding.binding_id,
                 .pose = PoseUpdate{.positions = Icosphere(2, 3).positions}},
                [&, told = false](int64_t, int64_t) mutable {
                  if (!std::exchange(told, true)) measuring.set_value();
                  return true;
                })
            .ok());
  });
  measuring.get_future().wait();
  EXPECT_EQ(server.client().GetWeights(
                binding.binding_id, WeightPrecision::kRecomputedFloat64, 0, 1,
                [](const WeightRows&) { return absl::OkStatus(); }),
            absl::OkStatus());
  reporter.join();
}

// All weights of the binding: N x C.
RowMatrix AllWeights(Client& client, const BindingInfo& binding,
                     WeightPrecision precision) {
  RowMatrix all(binding.point_count,
                binding.vertex_count + binding.normal_count);
  int64_t next = 0;
  const absl::Status status = client.GetWeights(
      binding.binding_id, precision, 0, 0, [&](const WeightRows& rows) {
        EXPECT_EQ(rows.first_point, next);
        all.block(next, 0, rows.vertex.rows(), rows.vertex.cols()) =
            rows.vertex;
        all.block(next, rows.vertex.cols(), rows.normal.rows(),
                  rows.normal.cols()) = rows.normal;
        next += rows.vertex.rows();
        return absl::OkStatus();
      });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(next, binding.point_count);
  return all;
}

TEST(Weights, ComeAsCachedAndAsComputed) {
  RunningServer server;
  const ModelInfo model =
      server.client().RegisterModel(MeshOf(Icosphere(0.5, 5)), "").value();
  // 10,242 points, 42 + 80 columns: several messages of each kind.
  const BindingInfo binding =
      server.client()
          .CreateBinding(
              {.model_id = model.model_id, .rig = CageOf(Icosphere(1, 1))})
          .value();
  const RowMatrix cached =
      AllWeights(server.client(), binding, WeightPrecision::kCachedFloat32);
  const RowMatrix computed =
      AllWeights(server.client(), binding, WeightPrecision::kRecomputedFloat64);
  // Rounded to float, and far faces computed in it: cached weights promise
  // 1e-6.
  EXPECT_LT((cached - computed).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT(
      (computed.leftCols(42).rowwise().sum().array() - 1).abs().maxCoeff(),
      1e-13);
}

TEST(Weights, OfPointsThatAreNotThereAreRefused) {
  RunningServer server;
  const BindingInfo binding = server.BindBall();
  const absl::Status status = server.client().GetWeights(
      binding.binding_id, WeightPrecision::kCachedFloat32, 162, 1,
      [](const WeightRows&) { return absl::OkStatus(); });
  EXPECT_EQ(status.message(), "first_point is 162; the binding has 162 points");
}

TEST(Schemes, AreListed) {
  RunningServer server;
  const auto schemes = server.client().ListSchemes().value();
  ASSERT_THAT(schemes, testing::Not(IsEmpty()));
  EXPECT_EQ(schemes[0].scheme, "green");
  EXPECT_TRUE(schemes[0].takes_cage);
  EXPECT_TRUE(schemes[0].uses_normals);
}

TEST(Lists, ComeInPages) {
  RunningServer server;
  for (int i = 1; i <= 5; ++i) {
    ASSERT_TRUE(
        server.client().RegisterModel(MeshOf(Icosphere(i, 0)), "").ok());
  }
  const auto stub = v1::ModelService::NewStub(PlainChannel(server.address()));
  std::vector<std::string> ids;
  std::string token;
  int pages = 0;
  do {
    grpc::ClientContext context;
    v1::ListModelsRequest request;
    v1::ListModelsResponse response;
    request.set_page_size(2);
    request.set_page_token(token);
    ASSERT_TRUE(stub->ListModels(&context, request, &response).ok());
    for (const auto& model : response.models()) ids.push_back(model.model_id());
    token = response.next_page_token();
    ++pages;
  } while (!token.empty());
  EXPECT_EQ(pages, 3);
  EXPECT_THAT(ids, SizeIs(5));
  EXPECT_TRUE(std::is_sorted(ids.begin(), ids.end()));
}

}  // namespace
}  // namespace deform
