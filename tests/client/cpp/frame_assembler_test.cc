#include "client/cpp/frame_assembler.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>

namespace deform {
namespace {

using testing::HasSubstr;

constexpr int kPoints = 3;

v1::FrameChunk Chunk(int first, int count, bool last) {
  v1::FrameChunk chunk;
  chunk.set_revision(7);
  chunk.set_epoch(1);
  chunk.set_answers_sequence(5);
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

FrameAssembler NewAssembler() {
  return FrameAssembler(*FindEncoding("float32"), 3, kPoints);
}

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

TEST(FrameAssembler, KeepsTheOriginUntilTheNextKeyframe) {
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

struct BadChunks {
  const char* name;
  std::function<std::vector<v1::FrameChunk>()> chunks;  // The last is wrong.
  const char* message;
};

void PrintTo(const BadChunks& chunks, std::ostream* out) {
  *out << chunks.name;
}

class FrameAssemblerRefuses : public testing::TestWithParam<BadChunks> {};

TEST_P(FrameAssemblerRefuses, ABadChunk) {
  FrameAssembler assembler = NewAssembler();
  Frame frame;
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
         "the first frame is no keyframe"},
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
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform
