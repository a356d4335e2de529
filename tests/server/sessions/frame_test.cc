#include "server/sessions/frame.h"

#include <gtest/gtest.h>

#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

// Half a unit in the last place of float, for coordinates up to 1.
constexpr double kFloatUlp = 6e-8;

std::shared_ptr<const Binding> BindBall(int subdivisions) {
  return Bind({.model = std::make_shared<const Mesh>(
                   MeshOf(Icosphere(0.5, subdivisions))),
               .rig = BallCage(),
               .scheme = "green"},
              {})
      .value();
}

TEST(EncodeFrame, WritesEveryVertexRelativeToTheOrigin) {
  const Deformer deformer(BindBall(1), nullptr);
  const auto frame =
      EncodeFrame(deformer, *FindEncoding("float32"),
                  {.revision = 7, .origin = {0.1, 0, -0.2}}, nullptr);
  EXPECT_EQ(frame->info.revision, 7u);
  ASSERT_EQ(frame->chunks.size(), 1u);
  EXPECT_EQ(frame->chunks[0].vertex_count, kBallPoints);
  EXPECT_LT((Decoded(*frame) - deformer.positions()).cwiseAbs().maxCoeff(),
            kFloatUlp);
}

TEST(EncodeFrame, CutsLargeModelsIntoChunksInOrder) {
  ThreadPool pool({.threads = 2});
  const Deformer deformer(BindBall(7), &pool);  // 163,842 points: 1.9 MB.
  const auto frame = EncodeFrame(deformer, *FindEncoding("float32"), {}, &pool);
  ASSERT_EQ(frame->chunks.size(), 2u);
  int64_t next = 0;
  for (const Frame::Chunk& chunk : frame->chunks) {
    EXPECT_EQ(chunk.first_vertex, next);
    EXPECT_LE(chunk.size, kMaxChunkBytes);
    next += chunk.vertex_count;
  }
  EXPECT_EQ(next, deformer.binding().point_count());
  EXPECT_LT((Decoded(*frame) - deformer.positions()).cwiseAbs().maxCoeff(),
            kFloatUlp);
}

}  // namespace
}  // namespace deform::server
