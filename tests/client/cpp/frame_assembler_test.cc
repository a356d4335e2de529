#include "client/cpp/frame_assembler.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <numeric>
#include <optional>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform {
namespace {

using testing::HasSubstr;

constexpr int kPoints = 3;

v1::FrameChunk Chunk(int first, int count, bool last) {
  v1::FrameChunk chunk;
  chunk.set_revision(7);
  chunk.set_epoch(1);
  chunk.set_answers_sequence(5);
  chunk.set_encoding("float32");
  chunk.set_first_vertex(first);
  chunk.set_vertex_count(count);
  chunk.set_last(last);
  std::vector<float> numbers;
  for (int i = 0; i < 3 * count; ++i) numbers.push_back(3.f * first + i);
  chunk.mutable_data()->assign(reinterpret_cast<const char*>(numbers.data()),
                               numbers.size() * sizeof(float));
  return chunk;
}

v1::FrameChunk Keyframe(int first, int count, bool last) {
  v1::FrameChunk chunk = Chunk(first, count, last);
  chunk.set_keyframe(true);
  for (const double x : {1000.0, 2000.0, 3000.0}) chunk.add_origin(x);
  return chunk;
}

FrameAssembler NewAssembler() { return FrameAssembler(3, kPoints); }

TEST(FrameAssembler, PutsChunksTogether) {
  FrameAssembler assembler = NewAssembler();
  Frame frame;
  EXPECT_FALSE(*assembler.Add(Keyframe(0, 2, false), frame));
  EXPECT_TRUE(*assembler.Add(Chunk(2, 1, true), frame));
  EXPECT_EQ(frame.revision, 7u);
  EXPECT_EQ(frame.answers_sequence, 5u);
  EXPECT_EQ(frame.point_count(), kPoints);
  const Positions positions = frame.DoublePositions();
  EXPECT_EQ(positions(0, 0), 1000);
  EXPECT_EQ(positions(2, 2), 3008);
}

TEST(FrameAssembler, KeepsTheOriginUntilTheNextIsTold) {
  FrameAssembler assembler = NewAssembler();
  Frame frame;
  ASSERT_TRUE(*assembler.Add(Keyframe(0, 3, true), frame));
  ASSERT_TRUE(*assembler.Add(Chunk(0, 3, true), frame));
  EXPECT_EQ(frame.origin, Vec3(1000, 2000, 3000));
}

TEST(FrameAssembler, DropsFramesOfAnOlderEpoch) {
  FrameAssembler assembler = NewAssembler();
  Frame frame;
  v1::FrameChunk newer = Keyframe(0, 3, true);
  newer.set_epoch(2);
  ASSERT_TRUE(*assembler.Add(newer, frame));
  v1::FrameChunk stale = Keyframe(0, 3, true);
  stale.set_revision(99);
  EXPECT_FALSE(*assembler.Add(stale, frame));
  EXPECT_EQ(frame.revision, 7u);
}

TEST(FrameAssembler, ANewerEpochAbandonsAHalfFrame) {
  FrameAssembler assembler = NewAssembler();
  Frame frame;
  ASSERT_FALSE(*assembler.Add(Keyframe(0, 2, false), frame));
  v1::FrameChunk newer = Keyframe(0, 3, true);
  newer.set_epoch(2);
  newer.set_revision(9);
  EXPECT_TRUE(*assembler.Add(newer, frame));
  EXPECT_EQ(frame.revision, 9u);
}

// Of points [first, ...).
v1::PointOrderChunk Order(uint64_t first, std::vector<int32_t> points) {
  v1::PointOrderChunk chunk;
  chunk.set_first(first);
  chunk.mutable_data()->assign(reinterpret_cast<const char*>(points.data()),
                               points.size() * sizeof(int32_t));
  return chunk;
}

// All points on a grid of step 0.5, each coordinate of the i-th of the order
// at `from + i`.
v1::FrameChunk OnGrid(uint64_t revision, int from,
                      std::optional<int> reference = std::nullopt) {
  const auto grid_from = [](int q) {
    Grid grid(kPoints);
    for (int d = 0; d < 3; ++d) {
      std::iota(grid.coordinate(d), grid.coordinate(d) + kPoints, q);
    }
    grid.Pad();
    return grid;
  };
  const Grid grid = grid_from(from);
  const Grid before = grid_from(reference.value_or(0));
  std::vector<uint8_t> bytes(kMaxChunkBytes);
  const ChunkSource source{.count = kPoints,
                           .grid = &grid,
                           .reference = reference ? &before : nullptr};
  const int64_t size =
      FindEncoding("predicted")->Encode(source, bytes.data()).value();
  v1::FrameChunk chunk;
  chunk.set_revision(revision);
  chunk.set_encoding("predicted");
  chunk.set_keyframe(!reference);
  if (!reference) {
    for (int d = 0; d < 3; ++d) chunk.add_origin(100);
  }
  chunk.set_step(0.5);
  chunk.set_vertex_count(kPoints);
  chunk.set_last(true);
  chunk.mutable_data()->assign(bytes.begin(), bytes.begin() + size);
  return chunk;
}
v1::FrameChunk Predicted(uint64_t revision, int from, uint64_t reference,
                         int reference_from) {
  v1::FrameChunk chunk = OnGrid(revision, from, reference_from);
  chunk.set_reference_revision(reference);
  return chunk;
}

TEST(FrameAssembler, AddsWhatAFrameDiffersByFromTheOneThatIsHeld) {
  FrameAssembler assembler = NewAssembler();
  ASSERT_TRUE(assembler.AddOrder(Order(0, {2, 1})).ok());
  ASSERT_TRUE(assembler.AddOrder(Order(2, {0})).ok());
  Frame frame;
  ASSERT_TRUE(*assembler.Add(OnGrid(4, 10), frame));
  EXPECT_TRUE(frame.keyframe);
  EXPECT_EQ(frame.DoublePositions()(2, 0), 100 + 10 * 0.5);
  EXPECT_EQ(frame.DoublePositions()(0, 1), 100 + 12 * 0.5);
  ASSERT_TRUE(*assembler.Add(Predicted(6, 20, 4, 10), frame));
  EXPECT_FALSE(frame.keyframe);
  EXPECT_EQ(frame.DoublePositions()(2, 2), 100 + 20 * 0.5);
}

v1::FrameChunk WithNormals(v1::FrameChunk chunk, const std::string& bytes) {
  chunk.set_normals(bytes);
  return chunk;
}

TEST(FrameAssembler, HasNormalsInTheOrderOfTheModel) {
  FrameAssembler assembler(3, kPoints, true);
  Frame frame;
  const std::string up("\0\0", 2), along_x("\x7f\0", 2), along_y("\0\x7f", 2);
  ASSERT_FALSE(
      *assembler.Add(WithNormals(Keyframe(0, 2, false), up + along_x), frame));
  ASSERT_TRUE(*assembler.Add(WithNormals(Chunk(2, 1, true), along_y), frame));
  EXPECT_EQ(frame.normals, (std::vector<float>{0, 0, 1, 1, 0, 0, 0, 1, 0}));
  EXPECT_EQ(frame.bytes, kPoints * (12 + 2));
  // Also where positions come in another.
  ASSERT_TRUE(assembler.AddOrder(Order(0, {2, 1, 0})).ok());
  v1::FrameChunk on_grid = OnGrid(8, 10);
  on_grid.set_epoch(1);
  ASSERT_TRUE(
      *assembler.Add(WithNormals(on_grid, along_x + up + along_y), frame));
  EXPECT_EQ(frame.normals, (std::vector<float>{1, 0, 0, 0, 0, 1, 0, 1, 0}));
}

TEST(FrameAssembler, WithoutNormalsHasNone) {
  FrameAssembler assembler = NewAssembler();
  Frame frame;
  frame.normals.resize(9);
  ASSERT_TRUE(*assembler.Add(Keyframe(0, 3, true), frame));
  EXPECT_TRUE(frame.normals.empty());
}

TEST(FrameAssembler, RefusesNormalsThatAreNotTwoBytesEach) {
  for (const std::string& bytes :
       {std::string(), std::string(5, 'n'), std::string(8, 'n')}) {
    FrameAssembler assembler(3, kPoints, true);
    Frame frame;
    const absl::Status status =
        assembler.Add(WithNormals(Keyframe(0, 3, true), bytes), frame).status();
    EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
    EXPECT_EQ(std::string(status.message()),
              absl::StrCat("there are ", bytes.size(), " bytes for 3 normals"));
  }
}

TEST(FrameAssembler, FramesOfFloatsInBetweenChangeNothingThatIsHeld) {
  FrameAssembler assembler = NewAssembler();
  ASSERT_TRUE(assembler.AddOrder(Order(0, {2, 1, 0})).ok());
  Frame frame;
  ASSERT_TRUE(*assembler.Add(OnGrid(4, 10), frame));
  v1::FrameChunk floats = Chunk(0, 3, true);
  floats.set_epoch(0);
  ASSERT_TRUE(*assembler.Add(floats, frame));
  ASSERT_TRUE(*assembler.Add(Predicted(8, 20, 4, 10), frame));
  EXPECT_EQ(frame.DoublePositions()(2, 2), 100 + 20 * 0.5);
}

TEST(FrameAssembler, ANewerEpochHoldsNothing) {
  FrameAssembler assembler = NewAssembler();
  ASSERT_TRUE(assembler.AddOrder(Order(0, {2, 1, 0})).ok());
  Frame frame;
  ASSERT_TRUE(*assembler.Add(OnGrid(4, 10), frame));
  v1::FrameChunk next = Predicted(5, 20, 4, 10);
  next.set_epoch(1);
  EXPECT_THAT(std::string(assembler.Add(next, frame).status().message()),
              HasSubstr("refers to revision 4, which is not held"));
}

struct BadOrder {
  const char* name;
  std::vector<v1::PointOrderChunk> chunks;  // The last is wrong.
  const char* message;
};
class FrameAssemblerRefusesOrder : public testing::TestWithParam<BadOrder> {};

TEST_P(FrameAssemblerRefusesOrder, ThatIsNone) {
  FrameAssembler assembler = NewAssembler();
  const auto& chunks = GetParam().chunks;
  for (size_t i = 0; i + 1 < chunks.size(); ++i) {
    ASSERT_TRUE(assembler.AddOrder(chunks[i]).ok());
  }
  const absl::Status status = assembler.AddOrder(chunks.back());
  EXPECT_EQ(DetailOf(status).reason, "BAD_POINT_ORDER");
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Orders, FrameAssemblerRefusesOrder,
    testing::ValuesIn<BadOrder>({
        {"TooLong", {Order(0, {0, 1, 2, 3})}, "where 0 of 3 points were"},
        {"Empty", {Order(0, {})}, "with 0 bytes"},
        {"Gap", {Order(0, {0}), Order(2, {2})}, "at point 2 with 4 bytes"},
        {"TwicePoint", {Order(0, {0, 1, 1})}, "names point 1 twice"},
        {"Again",
         {Order(0, {0, 1, 2}), Order(0, {0, 1, 2})},
         "it was complete"},
    }),
    [](const auto& test) { return test.param.name; });

struct BadChunks {
  const char* name;
  std::function<std::vector<v1::FrameChunk>()> chunks;  // The last is wrong.
  const char* message;
  bool with_order = false;
};

void PrintTo(const BadChunks& chunks, std::ostream* out) {
  *out << chunks.name;
}

class FrameAssemblerRefuses : public testing::TestWithParam<BadChunks> {};

TEST_P(FrameAssemblerRefuses, ABadChunk) {
  FrameAssembler assembler = NewAssembler();
  Frame frame;
  if (GetParam().with_order) {
    ASSERT_TRUE(assembler.AddOrder(Order(0, {2, 1, 0})).ok());
  }
  const std::vector<v1::FrameChunk> chunks = GetParam().chunks();
  for (size_t i = 0; i + 1 < chunks.size(); ++i) {
    ASSERT_TRUE(assembler.Add(chunks[i], frame).ok());
  }
  const absl::StatusOr<bool> result = assembler.Add(chunks.back(), frame);
  ASSERT_FALSE(result.ok());
  EXPECT_THAT(std::string(result.status().message()),
              HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Frames, FrameAssemblerRefuses,
    testing::ValuesIn<BadChunks>({
        {"WithoutOrigin", [] { return std::vector{Chunk(0, 3, true)}; },
         "the first frame tells no origin"},
        {"ShortOrigin",
         [] {
           v1::FrameChunk chunk = Keyframe(0, 3, true);
           chunk.mutable_origin()->RemoveLast();
           return std::vector{chunk};
         },
         "origin has 2 numbers, not 3"},
        {"Gap",
         [] {
           return std::vector{Keyframe(0, 1, false), Chunk(2, 1, true)};
         },
         "vertices from 2 on, 1 of them, where 1 of 3"},
        {"TooMany", [] { return std::vector{Keyframe(0, 4, true)}; },
         "4 of them, where 0 of 3"},
        {"HugeCount",
         [] {
           v1::FrameChunk chunk = Keyframe(0, 1, true);
           chunk.set_vertex_count(~uint64_t{0});
           return std::vector{chunk};
         },
         "where 0 of 3"},
        {"Endless", [] { return std::vector{Keyframe(0, 0, false)}; },
         "where 0 of 3"},
        {"ShortFrame", [] { return std::vector{Keyframe(0, 2, true)}; },
         "ends after 2 of 3"},
        {"ShortData",
         [] {
           v1::FrameChunk chunk = Keyframe(0, 3, true);
           chunk.mutable_data()->resize(35);
           return std::vector{chunk};
         },
         "35 bytes"},
        {"MixedRevisions",
         [] {
           v1::FrameChunk second = Chunk(1, 2, true);
           second.set_revision(8);
           return std::vector{Keyframe(0, 1, false), second};
         },
         "revision 8 begins within revision 7"},
        {"MixedEncodings",
         [] {
           v1::FrameChunk second = Chunk(1, 2, true);
           second.set_encoding("quantized16");
           return std::vector{Keyframe(0, 1, false), second};
         },
         "encoding \"quantized16\" within one of \"float32\""},
        {"UnknownEncoding",
         [] {
           v1::FrameChunk chunk = Keyframe(0, 3, true);
           chunk.set_encoding("lz");
           return std::vector{chunk};
         },
         "encoding \"lz\" is not known"},
        {"Normals",
         [] { return std::vector{WithNormals(Keyframe(0, 3, true), "n")}; },
         "a chunk has normals, which were not asked for"},
        {"GridWithoutOrder", [] { return std::vector{OnGrid(1, 0)}; },
         "the order of points has not come"},
        {"NothingHeld",
         [] {
           v1::FrameChunk chunk = OnGrid(2, 0);
           chunk.set_keyframe(false);
           chunk.set_reference_revision(1);
           return std::vector{chunk};
         },
         "revision 2 refers to revision 1, which is not held", true},
        {"OtherHeld",
         [] {
           return std::vector{OnGrid(1, 0), OnGrid(2, 0),
                              Predicted(3, 0, 1, 0)};
         },
         "revision 3 refers to revision 1, which is not held", true},
        {"NoStep",
         [] {
           v1::FrameChunk chunk = OnGrid(1, 0);
           chunk.set_step(0);
           return std::vector{chunk};
         },
         "the grid has step 0", true},
        {"ShortGrid",
         [] {
           v1::FrameChunk chunk = OnGrid(1, 0);
           chunk.mutable_data()->pop_back();
           return std::vector{chunk};
         },
         "a block ends in its residuals", true},
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform
