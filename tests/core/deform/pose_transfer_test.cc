#include "core/deform/pose_transfer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <random>

#include "core/base/error.h"
#include "core/deform/deformer.h"
#include "core/weights/handle_edit.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::ElementsAre;
using Kind = HandleEdit::Kind;

// Handles at the corners of a cube and four among them, and a ball of points.
class PoseTransferTest : public testing::TestWithParam<const char*> {
 protected:
  PoseTransferTest() : from_(BindTo(FirstHandles())) {}

  static Handles FirstHandles() {
    Positions handles(12, 3);
    handles << Cuboid({-1, -1, -1}, {1, 1, 1}).positions,
        Tetrahedron().positions * 0.3;
    return Handles::Create(3, handles).value();
  }
  std::shared_ptr<const Binding> BindTo(const Handles& handles) const {
    return Bind({.model = model_, .rig = handles, .scheme = GetParam()}, {})
        .value();
  }

  // The handles of from_ after `edits`, bound, and what becomes of `pose`.
  PoseTransfer Edited(std::vector<HandleEdit> edits, const Pose& pose) {
    const EditedHandles edited =
        EditHandles(std::get<Handles>(from_->rig()), {}, edits).value();
    to_ = BindTo(edited.handles);
    return PoseTransfer::Create(*from_, *to_, edited.previous, pose).value();
  }

  // Every handle moved a little, somehow.
  Pose SomePose() const {
    Pose pose = RestPose(from_->rig());
    std::mt19937 random(7);
    std::uniform_real_distribution<double> some(-0.2, 0.2);
    for (double& x : pose.vertices.reshaped()) x += some(random);
    return pose;
  }

  static Positions DeformBy(const std::shared_ptr<const Binding>& binding,
                            const Pose& pose) {
    Deformer deformer(binding, nullptr);
    deformer.MoveTo(pose);
    return deformer.positions();
  }

  std::shared_ptr<const Mesh> model_ =
      std::make_shared<const Mesh>(MeshOf(Icosphere(0.5, 2)));
  std::shared_ptr<const Binding> from_;
  std::shared_ptr<const Binding> to_;
};

INSTANTIATE_TEST_SUITE_P(Schemes, PoseTransferTest,
                         testing::Values("s_cc", "t_cc"),
                         [](const auto& test) { return test.param; });

TEST_P(PoseTransferTest, CarriesPointsOfTheModelAsTheyAreDeformed) {
  const Pose pose = SomePose();
  const Positions carried =
      CarriedPlaces(*from_, pose, model_->positions()).value();
  // Float weights.
  EXPECT_LT((carried - DeformBy(from_, pose)).cwiseAbs().maxCoeff(), 2e-6);
}

TEST_P(PoseTransferTest, CarriesHandlesToWhereTheyAre) {
  const Pose pose = SomePose();
  const Positions carried =
      CarriedPlaces(*from_, pose, RestVertices(from_->rig())).value();
  EXPECT_LT((carried - pose.vertices).cwiseAbs().maxCoeff(), 1e-15);
}

TEST_P(PoseTransferTest, CarriesPlacesOutsideAlongASimilarityExactly) {
  Positions places(2, 3);
  places << 5, 0, 0, 1.001, 0.2, -0.3;
  Pose pose = RestPose(from_->rig());
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  const auto map = [&](const Positions& p) -> Positions {
    return (1.5 * p * turn).rowwise() + Eigen::RowVector3d(4, 5, 6);
  };
  pose.vertices = map(pose.vertices);
  const Positions carried = CarriedPlaces(*from_, pose, places).value();
  EXPECT_LT((carried - map(places)).cwiseAbs().maxCoeff(), 1e-13);
}

TEST_P(PoseTransferTest, CarriesPlacesOutsideWithTheHandlesNearby) {
  // A corner pulled out takes what is just outside of it along.
  Pose pose = RestPose(from_->rig());
  const Vec3 pull(0.3, 0.2, 0.1);
  pose.vertices.row(7) += pull.transpose();
  const Positions place = RestVertices(from_->rig()).row(7) * 1.001;
  const Positions carried = CarriedPlaces(*from_, pose, place).value();
  EXPECT_LT((carried - place - pull.transpose()).norm(), 1e-3);
}

TEST_P(PoseTransferTest, KeepsHandlesWhereTheyAreAndDropsRemovedOnes) {
  const Pose pose = SomePose();
  const PoseTransfer transfer =
      Edited({{.kind = Kind::kRemove, .handle = 9}}, pose);
  EXPECT_EQ(transfer.pose().vertices.topRows(9), pose.vertices.topRows(9));
  EXPECT_EQ(transfer.pose().vertices.bottomRows(2),
            pose.vertices.bottomRows(2));
}

TEST_P(PoseTransferTest, LeavesTheRestPoseAtRest) {
  const PoseTransfer transfer =
      Edited({{.kind = Kind::kAdd, .position = {0.1, 0.2, 0.3}},
              {.kind = Kind::kAdd, .position = {3, 0, 0}},
              {.kind = Kind::kMove, .handle = 9, .position = {0.2, 0, 0.1}}},
             RestPose(from_->rig()));
  EXPECT_LT((transfer.pose().vertices - RestVertices(to_->rig()))
                .cwiseAbs()
                .maxCoeff(),
            1e-15);
}

TEST_P(PoseTransferTest, PutsNewAndMovedHandlesWhereThePoseCarriedThem) {
  const Pose pose = SomePose();
  const Vec3 added(0.1, 0.2, 0.3), moved(-0.2, 0.1, 0);
  const PoseTransfer transfer =
      Edited({{.kind = Kind::kAdd, .position = added},
              {.kind = Kind::kMove, .handle = 9, .position = moved}},
             pose);
  Positions places(2, 3);
  places << added.transpose(), moved.transpose();
  const Positions carried = CarriedPlaces(*from_, pose, places).value();
  EXPECT_EQ(transfer.pose().vertices.row(12), carried.row(0));
  EXPECT_EQ(transfer.pose().vertices.row(9), carried.row(1));
  EXPECT_EQ(transfer.pose().vertices.row(8), pose.vertices.row(8));
}

TEST_P(PoseTransferTest, JumpsLessThanIfHandlesKeptTheirDisplacement) {
  const Pose pose = SomePose();
  const Positions before = DeformBy(from_, pose);
  const Vec3 moved(-0.3, 0.3, 0.2);
  const PoseTransfer transfer =
      Edited({{.kind = Kind::kMove, .handle = 9, .position = moved}}, pose);
  Pose kept = transfer.pose();
  kept.vertices.row(9) = moved.transpose() + pose.vertices.row(9) -
                         RestVertices(from_->rig()).row(9);
  const auto jump = [&](const Pose& after) {
    return (DeformBy(to_, after) - before).rowwise().norm().maxCoeff();
  };
  EXPECT_LT(jump(transfer.pose()), jump(kept));
}

TEST_P(PoseTransferTest, TakesLaterPosesOver) {
  const Pose pose = SomePose();
  const PoseTransfer transfer =
      Edited({{.kind = Kind::kRemove, .handle = 0},
              {.kind = Kind::kMove, .handle = 9, .position = {0.2, 0, 0.1}},
              {.kind = Kind::kAdd, .position = {0.1, 0.1, 0.1}}},
             pose);
  Pose later = pose;
  later.vertices.rowwise() += Eigen::RowVector3d(0.5, 0, 0);
  later.stretch_blend = 0.5;
  const Pose after = transfer.Transfer(later);
  Positions expected = transfer.pose().vertices;
  expected.topRows(11).rowwise() += Eigen::RowVector3d(0.5, 0, 0);
  EXPECT_LT((after.vertices - expected).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_EQ(after.stretch_blend, 0.5);
}

TEST_P(PoseTransferTest, TakesUpdatesOverByTheirHandles) {
  const Pose pose = SomePose();
  const PoseTransfer transfer =
      Edited({{.kind = Kind::kRemove, .handle = 3}}, pose);
  Positions places(3, 3);
  places << 1, 1, 1, 2, 2, 2, 3, 3, 3;
  PoseUpdate update{.vertices = {2, 3, 4}, .positions = places};
  const PoseUpdate partial = transfer.Transfer(update).value();
  EXPECT_THAT(partial.vertices, ElementsAre(2, 3));
  EXPECT_EQ(partial.positions.row(1), places.row(2));

  update = {.positions = pose.vertices};
  const PoseUpdate full = transfer.Transfer(update).value();
  EXPECT_EQ(full.positions.rows(), 11);
  EXPECT_EQ(full.vertices[3], 3);
  EXPECT_EQ(full.positions.row(3), pose.vertices.row(4));

  update = {.stretch_blend = 0.5};
  EXPECT_EQ(transfer.Transfer(update)->stretch_blend, 0.5);
}

TEST_P(PoseTransferTest, RefusesUpdatesOfRemovedHandlesAlone) {
  const PoseTransfer transfer =
      Edited({{.kind = Kind::kRemove, .handle = 3}}, SomePose());
  const absl::Status status =
      transfer
          .Transfer(
              PoseUpdate{.vertices = {3}, .positions = Positions::Ones(1, 3)})
          .status();
  EXPECT_EQ(DetailOf(status).reason, "RIG_CHANGED");
  EXPECT_EQ(status.message(),
            "the rig has changed: all handles that this pose moves were "
            "removed");
}

}  // namespace
}  // namespace deform
