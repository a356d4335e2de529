#include "server/rpc/frame_message.h"

#include <gtest/gtest.h>

#include <cstring>

#include "deform/v1/session.pb.h"
#include "server/rpc/message_bytes.h"

namespace deform::server {
namespace {

// Two chunks of 2 and 1 vertices.
std::shared_ptr<Frame> TwoChunks() {
  auto frame = std::make_shared<Frame>();
  frame->info = {.revision = 300,
                 .origin = {1, 2, 3},
                 .columns_applied = 20,
                 .exit_mismatch = 0.5,
                 .deform_time = std::chrono::microseconds(77)};
  frame->encoding = FindEncoding("float32");
  for (const int64_t vertices : {2, 1}) {
    Frame::Chunk chunk{.first_vertex = vertices == 2 ? 0 : 2,
                       .vertex_count = vertices,
                       .size = vertices * 12};
    chunk.bytes = std::make_unique<uint8_t[]>(chunk.size);
    std::memset(chunk.bytes.get(), static_cast<int>(vertices), chunk.size);
    frame->chunks.push_back(std::move(chunk));
  }
  return frame;
}

v1::FrameChunk Parsed(const FrameToSend& send, size_t chunk) {
  v1::DeformResponse response;
  EXPECT_TRUE(ParseMessage(FrameMessage(send, chunk, 4, 3), response));
  EXPECT_TRUE(response.has_frame());
  EXPECT_EQ(response.GetReflection()->GetUnknownFields(response).field_count(),
            0);
  return response.frame();
}

TEST(FrameMessage, IsAValidMessage) {
  const FrameToSend send{.frame = TwoChunks(),
                         .answers_sequence = 9,
                         .skipped_revisions = 2,
                         .tells_origin = true};
  const v1::FrameChunk first = Parsed(send, 0);
  EXPECT_EQ(first.revision(), 300u);
  EXPECT_EQ(first.epoch(), 4u);
  EXPECT_EQ(first.durable_revision(), 3u);
  EXPECT_EQ(first.answers_sequence(), 9u);
  EXPECT_EQ(first.encoding(), "float32");
  EXPECT_TRUE(first.keyframe());
  ASSERT_EQ(first.origin_size(), 3);
  EXPECT_EQ(first.origin(2), 3);
  EXPECT_EQ(first.first_vertex(), 0u);
  EXPECT_EQ(first.vertex_count(), 2u);
  EXPECT_FALSE(first.last());
  EXPECT_EQ(first.skipped_revisions(), 2u);
  EXPECT_EQ(first.columns_applied(), 20u);
  EXPECT_EQ(first.exit_mismatch(), 0.5);
  EXPECT_EQ(first.deform_us(), 77u);
  EXPECT_EQ(first.data(), std::string(24, '\2'));
}

TEST(FrameMessage, LaterChunksSayOnlyWhatIsTheirs) {
  const FrameToSend send{
      .frame = TwoChunks(), .skipped_revisions = 2, .tells_origin = true};
  const v1::FrameChunk last = Parsed(send, 1);
  EXPECT_TRUE(last.last());
  EXPECT_TRUE(last.keyframe());
  EXPECT_EQ(last.origin_size(), 0);
  EXPECT_EQ(last.skipped_revisions(), 0u);
  EXPECT_EQ(last.first_vertex(), 2u);
  EXPECT_EQ(last.data(), std::string(12, '\1'));
}

TEST(FrameMessage, TellsNoOriginThatIsKnown) {
  EXPECT_EQ(Parsed({.frame = TwoChunks()}, 0).origin_size(), 0);
}

TEST(FrameMessage, TellsWhatAFrameOnAGridRefersTo) {
  const auto frame = TwoChunks();
  frame->encoding = FindEncoding("predicted");
  frame->held = std::make_shared<const HeldRevision>(
      HeldRevision{.revision = 300, .step = 0.25, .content = Grid(3)});
  frame->error_bound = 0.5;
  EXPECT_TRUE(Parsed({.frame = frame}, 0).keyframe());
  frame->reference_revision = 298;
  for (const size_t chunk : {0, 1}) {
    EXPECT_FALSE(Parsed({.frame = frame}, chunk).keyframe());
    EXPECT_EQ(Parsed({.frame = frame}, chunk).reference_revision(), 298u);
  }
  EXPECT_EQ(Parsed({.frame = frame}, 0).step(), 0.25);
  EXPECT_EQ(Parsed({.frame = frame}, 0).error_bound(), 0.5);
}

TEST(FrameMessage, HasTheNormalsOfItsVertices) {
  const auto normals = std::make_shared<const FrameNormals>(
      FrameNormals{'a', 'b', 'c', 'd', 'e', 'f'});
  const FrameToSend send{.frame = TwoChunks(), .normals = normals};
  EXPECT_EQ(Parsed(send, 0).normals(), "abcd");
  EXPECT_EQ(Parsed(send, 0).data(), std::string(24, '\2'));
  EXPECT_EQ(Parsed(send, 1).normals(), "ef");
  EXPECT_EQ(Parsed(send, 1).data(), std::string(12, '\1'));
  EXPECT_EQ(Parsed({.frame = TwoChunks()}, 0).normals(), "");
}

TEST(OrderMessage, TellsTheIndicesInParts) {
  // 1 MiB holds 2^18 of them.
  constexpr int64_t kPoints = (1 << 18) + 3;
  Positions line = Positions::Zero(kPoints, 3);
  line.col(0).setLinSpaced(kPoints, 1, 0);
  const auto order = std::make_shared<const PointOrder>(line);
  ASSERT_EQ(OrderMessages(*order), 2u);
  std::string bytes;
  for (const size_t part : {0, 1}) {
    v1::DeformResponse response;
    ASSERT_TRUE(ParseMessage(OrderMessage(order, part), response));
    EXPECT_EQ(response.point_order().first(), bytes.size() / 4);
    bytes += response.point_order().data();
  }
  const std::vector<uint8_t> all = order->ToBytes();
  EXPECT_EQ(bytes, std::string(all.begin(), all.end()));
}

TEST(FrameMessage, DoesNotCopyTheData) {
  const auto frame = TwoChunks();
  const grpc::ByteBuffer message = FrameMessage({.frame = frame}, 0, 1, 0);
  std::vector<grpc::Slice> slices;
  ASSERT_TRUE(message.Dump(&slices).ok());
  EXPECT_EQ(slices.back().begin(), frame->chunks[0].bytes.get());
}

TEST(FrameMessage, DoesNotCopyTheNormals) {
  auto normals = std::make_shared<const FrameNormals>(FrameNormals(6));
  const std::weak_ptr<const FrameNormals> alive = normals;
  {
    const grpc::ByteBuffer message =
        FrameMessage({.frame = TwoChunks(), .normals = normals}, 1, 1, 0);
    std::vector<grpc::Slice> slices;
    ASSERT_TRUE(message.Dump(&slices).ok());
    ASSERT_EQ(slices.size(), 4u);
    EXPECT_EQ(slices[1].begin(), normals->data() + 4);
    normals.reset();
    EXPECT_FALSE(alive.expired());
  }
  EXPECT_TRUE(alive.expired());
}

TEST(FrameMessage, KeepsTheFrameUntilItIsSent) {
  auto frame = TwoChunks();
  const std::weak_ptr<Frame> alive = frame;
  {
    const grpc::ByteBuffer message = FrameMessage({.frame = frame}, 0, 1, 0);
    frame.reset();
    EXPECT_FALSE(alive.expired());
  }
  EXPECT_TRUE(alive.expired());
}

TEST(MessageBytes, RefusesWhatIsNoMessage) {
  const grpc::Slice slice(std::string("\xff\xff\xff"));
  v1::DeformRequest request;
  EXPECT_FALSE(ParseMessage(grpc::ByteBuffer(&slice, 1), request));
  EXPECT_TRUE(ParseMessage(SerializeMessage(v1::DeformRequest()), request));
}

}  // namespace
}  // namespace deform::server
