// Frames with normals, over a real connection.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/Geometry>

#include "core/base/error.h"
#include "core/frames/normals.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

// What two bytes may take, and roundings of positions to float: edges of the
// largest ball here are 0.004 long, or 1e-3 D.
constexpr double kByteError = 0.017;
constexpr double kRounding = 1e-3;

std::string SessionOf(Client& client, const Mesh& mesh, const Cage& cage) {
  const ModelInfo model = client.RegisterModel(mesh, "model").value();
  const BindingInfo binding =
      client.CreateBinding({.model_id = model.model_id, .rig = cage}).value();
  return client.CreateSession(binding.binding_id)->session_id;
}

PoseUpdate Bulge(double by) {
  return {.vertices = {7}, .positions = Positions::Constant(1, 3, 1 + by)};
}

// Of the normals that come with exact positions.
double LargestError(const Frame& frame, const Faces& faces) {
  std::vector<float> plain(frame.positions.size());
  ComputeNormals(frame.positions, faces, plain);
  EXPECT_EQ(frame.normals.size(), plain.size());
  double largest = 0;
  for (size_t i = 0; i < plain.size(); i += 3) {
    const Vec3 a(plain[i], plain[i + 1], plain[i + 2]);
    const Vec3 b(frame.normals[i], frame.normals[i + 1], frame.normals[i + 2]);
    largest = std::max(largest, std::atan2(a.cross(b).norm(), a.dot(b)));
  }
  return largest;
}

TEST(FrameNormals, AreTheSameInEveryEncodingAndChunk) {
  RunningServer server;
  // 163,842 points: two chunks of floats, and several on a grid.
  const Mesh mesh = MeshOf(Icosphere(0.5, 7));
  const std::string session = SessionOf(server.client(), mesh, Cube());
  std::vector<DeformStream> streams;
  for (const char* encoding : {"float32", "quantized16", "predicted"}) {
    streams.push_back(server.client()
                          .Deform(session, {.delivery = Delivery::kEvery,
                                            .tolerance_fraction = 1e-4,
                                            .encodings = {encoding},
                                            .normals = true})
                          .value());
  }
  Frame exact, other;
  for (int i = 0; i < 3; ++i) {
    if (i > 0) streams[0].Send(Bulge(0.3 * i)).value();
    ASSERT_TRUE(streams[0].NextFrame(exact).ok());
    EXPECT_LT(LargestError(exact, mesh.faces()), kByteError + kRounding);
    for (const size_t s : {1, 2}) {
      ASSERT_TRUE(streams[s].NextFrame(other).ok());
      EXPECT_EQ(other.revision, exact.revision);
      EXPECT_EQ(other.normals, exact.normals);
    }
  }
}

TEST(FrameNormals, ComeToWhoAsksForThem) {
  RunningServer server;
  const std::string session = server.BallSession();
  auto with = server.client().Deform(session, {.normals = true}).value();
  auto without = server.client().Deform(session).value();
  Frame frame;
  const uint64_t sequence = with.Send(Bulge(0.5)).value();
  do {
    ASSERT_TRUE(with.NextFrame(frame).ok());
    EXPECT_LT(LargestError(frame, Ball().faces()), kByteError + kRounding);
    EXPECT_EQ(frame.bytes, Ball().size() * (12 + 2));
  } while (frame.answers_sequence < sequence);
  ASSERT_TRUE(without.NextFrame(frame).ok());
  EXPECT_TRUE(frame.normals.empty());
  EXPECT_EQ(frame.bytes, Ball().size() * 12);
}

TEST(FrameNormals, ComeWithFewFramesToo) {
  RunningServer server;
  const std::string session = server.BallSession();
  auto editor = server.client().Deform(session).value();
  auto viewer =
      server.client().Deform(session, {.max_fps = 50, .normals = true}).value();
  Frame frame;
  ASSERT_TRUE(viewer.NextFrame(frame).ok());
  editor.Send(Bulge(0.5)).value();
  while (frame.revision < 1) {
    ASSERT_TRUE(viewer.NextFrame(frame).ok());
    EXPECT_LT(LargestError(frame, Ball().faces()), kByteError + kRounding);
  }
}

TEST(FrameNormals, OfModelsWithoutThemAreRefused) {
  RunningServer server;
  const auto refused = [&](const Mesh& mesh, const Cage& cage) {
    return server.client()
        .Deform(SessionOf(server.client(), mesh, cage), {.normals = true})
        .status();
  };
  const Mesh points = Mesh::Create(3, Ball().positions(), Faces(0, 3)).value();
  const absl::Status pointless = refused(points, Cube());
  EXPECT_EQ(pointless.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(pointless).reason, "NO_NORMALS");
  EXPECT_EQ(std::string(pointless.message()),
            "the model has no faces, so its vertices have no normals: join "
            "without");
  Faces triangle(1, 3);
  triangle << 0, 1, 2;
  Positions corners(3, 3);
  corners << 0, 0, 0, 0.2, 0, 0, 0, 0.2, 0;
  const absl::Status flat = refused(Mesh::Create(2, corners, triangle).value(),
                                    CageOf(RegularLoop2d(1, 4)));
  EXPECT_EQ(DetailOf(flat).reason, "NO_NORMALS");
  EXPECT_EQ(std::string(flat.message()),
            "a model in two dimensions has no normals: join without");
}

}  // namespace
}  // namespace deform
