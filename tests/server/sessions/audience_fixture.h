// An audience whose frames are empty, and which decides when time passes.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "server/sessions/audience.h"

namespace deform::server {

class AudienceTest : public testing::Test {
 protected:
  int64_t Add(Delivery delivery = Delivery::kLatest) {
    return audience_.Add({.delivery = delivery, .format = float32_}, {}, now_);
  }
  // At most ten frames a second.
  int64_t AddLimited(const FrameFormat& format) {
    return audience_.Add(
        {.format = format, .interval = std::chrono::milliseconds(100)}, {},
        now_);
  }
  void Pass(int milliseconds) {
    now_ += std::chrono::milliseconds(milliseconds);
  }
  int64_t AddOnGrid(Delivery delivery = Delivery::kLatest) {
    return audience_.Add({.delivery = delivery, .format = predicted_}, {},
                         now_);
  }
  // Makes what is wanted of the revision.
  Frames Made(uint64_t revision, const std::vector<FrameKey>& keys) {
    Frames frames;
    std::shared_ptr<const HeldRevision> grid, pose;
    for (const FrameKey& key : keys) {
      auto frame = std::make_shared<Frame>();
      frame->info.revision = revision;
      if (key.format.encoding->uses_grid()) {
        if (grid == nullptr) {
          grid = std::make_shared<const HeldRevision>(
              HeldRevision{.revision = revision, .content = Grid(1)});
        }
        frame->held = grid;
      } else if (key.format.encoding->refers()) {
        if (pose == nullptr) {
          pose = std::make_shared<const HeldRevision>(
              HeldRevision{.revision = revision, .content = Pose()});
        }
        frame->held = pose;
      }
      frame->encoding = key.format.encoding;
      if (key.reference) {
        frame->reference_revision = key.reference->revision;
      }
      frames[key] = std::move(frame);
    }
    return frames;
  }
  void Publish(uint64_t revision) {
    audience_.Publish(revision, Made(revision, audience_.Wanted(true, now_)),
                      now_);
  }
  // Frames of the revision for those who lack one.
  void Serve(uint64_t revision) {
    audience_.Publish(revision, Made(revision, audience_.Wanted(false, now_)),
                      now_);
  }
  FrameToSend TakeFrame(int64_t seat) {
    return std::get<FrameToSend>(audience_.Take(seat, now_).value());
  }
  // It has been sent.
  void TakeNothing(int64_t seat) {
    EXPECT_FALSE(audience_.Take(seat, now_).has_value());
  }

  const FrameFormat float32_{.encoding = FindEncoding("float32")};
  const FrameFormat quantized16_{.encoding = FindEncoding("quantized16"),
                                 .tolerance = 0.1};
  const FrameFormat predicted_{.encoding = FindEncoding("predicted"),
                               .tolerance = 0.1};
  Audience audience_;
  Audience::TimePoint now_{};
};

}  // namespace deform::server
