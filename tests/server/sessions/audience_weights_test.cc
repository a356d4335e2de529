// Frames for those who hold what they are made of, and for the others.
#include <gtest/gtest.h>

#include "tests/server/sessions/audience_fixture.h"

namespace deform::server {
namespace {

class AudienceWeightsTest : public AudienceTest {
 protected:
  // Takes poses, as long as it holds the weights.
  int64_t AddForPoses(const WeightsId& weights,
                      Delivery delivery = Delivery::kLatest) {
    return audience_.Add({.delivery = delivery,
                          .format = pose_,
                          .otherwise = predicted_,
                          .weights = weights},
                         {}, now_);
  }

  // Takes leaf coefficients, as long as it holds the basis.
  int64_t AddForBasis(const WeightsId& weights) {
    return audience_.Add(
        {.format = basis_, .otherwise = predicted_, .weights = weights}, {},
        now_);
  }

  const FrameFormat basis_{.encoding = FindEncoding("basis"), .tolerance = 0.1};
  const FrameFormat pose_{.encoding = FindEncoding("pose")};
};

TEST_F(AudienceWeightsTest, WhoHoldsTheWeightsGetsPoses) {
  audience_.SetWeights({.binding = "a"});
  const int64_t seat = AddForPoses({.binding = "a"});
  Publish(1);
  const FrameToSend first = TakeFrame(seat);
  EXPECT_EQ(first.frame->encoding, pose_.encoding);
  EXPECT_FALSE(first.frame->reference_revision.has_value());
  TakeNothing(seat);
  Publish(2);
  EXPECT_EQ(TakeFrame(seat).frame->reference_revision, 1u);
}

TEST_F(AudienceWeightsTest, WhoDoesNotHoldThemGetsAnotherEncoding) {
  audience_.SetWeights({.binding = "a"});
  const int64_t seat = AddForPoses({});
  Publish(1);
  EXPECT_EQ(TakeFrame(seat).frame->encoding, predicted_.encoding);
  TakeNothing(seat);
  audience_.Hold(seat, {.binding = "other"});
  Publish(2);
  EXPECT_EQ(TakeFrame(seat).frame->encoding, predicted_.encoding);
  TakeNothing(seat);
  audience_.Hold(seat, {.binding = "a"});
  Publish(3);
  // A grid is no reference for a pose.
  const FrameToSend pose = TakeFrame(seat);
  EXPECT_EQ(pose.frame->encoding, pose_.encoding);
  EXPECT_FALSE(pose.frame->reference_revision.has_value());
}

TEST_F(AudienceWeightsTest, PosesAreOfTheWeightsThatTheRevisionHas) {
  audience_.SetWeights({.binding = "a"});
  const int64_t seat = AddForPoses({.binding = "a"}, Delivery::kEvery);
  Publish(1);
  TakeFrame(seat);
  TakeNothing(seat);
  audience_.SetWeights({.binding = "b"});
  Publish(2);
  EXPECT_EQ(TakeFrame(seat).frame->encoding, predicted_.encoding);
  TakeNothing(seat);
  // What it holds of the former rig is no reference any more.
  audience_.SetWeights({.binding = "a"});
  audience_.Hold(seat, {.binding = "a"});
  Publish(3);
  EXPECT_FALSE(TakeFrame(seat).frame->reference_revision.has_value());
}

TEST_F(AudienceWeightsTest, AFrameIsMadeAnewIfTheWeightsChangedMeanwhile) {
  audience_.SetWeights({.binding = "a"});
  const int64_t seat = AddForPoses({.binding = "a"}, Delivery::kEvery);
  Publish(1);
  TakeFrame(seat);
  const Frames made = Made(2, audience_.Wanted(true, now_));
  audience_.SetWeights({.binding = "b"});
  audience_.Publish(2, made, now_);
  TakeNothing(seat);
  EXPECT_TRUE(audience_.MustSeeThis(now_));
  Serve(2);
  EXPECT_EQ(TakeFrame(seat).frame->encoding, predicted_.encoding);
}

TEST_F(AudienceWeightsTest, WhoHoldsTheBasisGetsLeafCoefficients) {
  audience_.SetWeights({.binding = "a"});
  const int64_t seat = AddForBasis({.basis = "x"});
  Publish(1);
  EXPECT_EQ(TakeFrame(seat).frame->encoding, predicted_.encoding);
  TakeNothing(seat);
  audience_.SetWeights({.binding = "a", .basis = "y"});
  Publish(2);
  EXPECT_EQ(TakeFrame(seat).frame->encoding, predicted_.encoding);
  TakeNothing(seat);
  audience_.Hold(seat, {.basis = "y"});
  Publish(3);
  EXPECT_EQ(TakeFrame(seat).frame->encoding, basis_.encoding);
  // Nobody has no basis.
  TakeNothing(seat);
  audience_.Hold(seat, {});
  audience_.SetWeights({.binding = "a"});
  Publish(4);
  EXPECT_EQ(TakeFrame(seat).frame->encoding, predicted_.encoding);
}

TEST_F(AudienceWeightsTest, AFrameOfAFormerBasisServesNobodyElse) {
  audience_.SetWeights({.binding = "a", .basis = "x"});
  AddForBasis({.basis = "x"});
  Publish(1);
  // The weights have another form, which is no revision.
  audience_.SetWeights({.binding = "a", .basis = "y"});
  const int64_t late = AddForBasis({.basis = "y"});
  TakeNothing(late);
  EXPECT_TRUE(audience_.NeedsFrame(now_));
  Serve(1);
  EXPECT_EQ(TakeFrame(late).frame->encoding, basis_.encoding);
}

}  // namespace
}  // namespace deform::server
