#include "core/weights/handle_edit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using Kind = HandleEdit::Kind;

Positions Corners() { return Cuboid({-1, -1, -1}, {1, 1, 1}).positions; }

// Six free handles and two fixed ones.
Handles SomeHandles() {
  return Handles::Create(3, Corners().topRows(6), Corners().bottomRows(2))
      .value();
}

HandleEdit Add(const Vec3& at, double weight = 0) {
  return {.kind = Kind::kAdd, .position = at, .weight = weight};
}
HandleEdit Move(int64_t handle, const Vec3& to) {
  return {.kind = Kind::kMove, .handle = handle, .position = to};
}
HandleEdit Remove(int64_t handle) {
  return {.kind = Kind::kRemove, .handle = handle};
}

TEST(EditHandles, KeepsTheOrderOfThoseThatAreLeft) {
  const HandleEdit edits[] = {Add({5, 0, 0}), Remove(1), Move(3, {0, 7, 0}),
                              Add({6, 0, 0}), Remove(4)};
  const EditedHandles edited = EditHandles(SomeHandles(), {}, edits).value();
  EXPECT_THAT(edited.previous, ElementsAre(0, 2, 3, 5, -1, -1));
  EXPECT_EQ(edited.handles.free_count(), 6);
  EXPECT_EQ(edited.handles.fixed_count(), 2);
  Positions expected(8, 3);
  expected << Corners().row(0), Corners().row(2), 0, 7, 0, Corners().row(5), 5,
      0, 0, 6, 0, 0, Corners().bottomRows(2);
  EXPECT_EQ(edited.handles.positions(), expected);
}

TEST(EditHandles, KeepsUserWeightsWithTheirHandles) {
  const HandleEdit edits[] = {Remove(0), Add({5, 0, 0}, 0.5)};
  SchemeOptions options;
  EXPECT_THAT(
      EditHandles(SomeHandles(), options, edits)->options.handle_weights,
      ElementsAre(0, 0, 0, 0, 0, 0.5));
  options.handle_weights = {1, 2, 3, 4, 5, 6};
  EXPECT_THAT(
      EditHandles(SomeHandles(), options, edits)->options.handle_weights,
      ElementsAre(2, 3, 4, 5, 6, 0.5));
  // No weights stay no weights.
  options.handle_weights.clear();
  const HandleEdit light[] = {Remove(0), Add({5, 0, 0})};
  EXPECT_THAT(
      EditHandles(SomeHandles(), options, light)->options.handle_weights,
      IsEmpty());
}

TEST(EditHandles, KeepsTheOtherOptions) {
  SchemeOptions options;
  options.lambda = 3;
  const HandleEdit edits[] = {Add({5, 0, 0})};
  EXPECT_EQ(EditHandles(SomeHandles(), options, edits)->options.lambda, 3);
}

struct BadEdits {
  std::string name;
  std::vector<HandleEdit> edits;
  std::string reason;
  std::string message;
};

class EditHandlesRefuses : public testing::TestWithParam<BadEdits> {};

TEST_P(EditHandlesRefuses, WithAMessageThatSaysWhatToMend) {
  const absl::Status status =
      EditHandles(SomeHandles(), {}, GetParam().edits).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, GetParam().reason);
  EXPECT_EQ(status.message(), GetParam().message);
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    Edits, EditHandlesRefuses,
    testing::ValuesIn<BadEdits>({
        {"None",
         {},
         "NO_EDITS",
         "there are no edits: add, move or remove a handle"},
        {"HandleBeyond",
         {Add({5, 0, 0}), Remove(8)},
         "INDEX_OUT_OF_RANGE",
         "edit 1 names handle 8 of 6"},
        {"NegativeHandle",
         {Move(-1, {5, 0, 0})},
         "INDEX_OUT_OF_RANGE",
         "edit 0 names handle -1 of 6"},
        {"FixedHandle",
         {Remove(7)},
         "FIXED_HANDLE",
         "edit 0 names handle 7, which is fixed, as all from 6 on"},
        {"Twice",
         {Move(2, {5, 0, 0}), Remove(2)},
         "HANDLE_EDITED_TWICE",
         "edit 1 names handle 2 again; once is enough"},
        {"NotANumber",
         {Move(2, {5, kNan, 0})},
         "NON_FINITE",
         "edit 0: place 0 has a coordinate that is not finite"},
        {"NoneIsLeft",
         {Remove(0), Remove(1), Remove(2), Remove(3), Remove(4), Remove(5)},
         "DEGENERATE_HANDLES",
         "all handles are fixed: at least one must be free to be posed"},
    }),
    [](const auto& test) { return test.param.name; });

TEST(EditHandles, RefusesWhatNoLongerSpansTheSpace) {
  const Handles handles = Handles::Create(3, Corners()).value();
  std::vector<HandleEdit> edits;
  for (const int64_t handle : {0, 1, 2, 3}) edits.push_back(Remove(handle));
  EXPECT_EQ(EditHandles(handles, {}, edits).status().message(),
            "all 4 handles lie in one plane: they must span 3 dimensions");
  edits.push_back(Remove(4));
  EXPECT_EQ(EditHandles(handles, {}, edits).status().message(),
            "a 3D rig needs at least 4 handles, not 3");
}

TEST(EditHandles, StaysInThePlaneIn2d) {
  const Handles handles = Handles::Create(2, Grid2d(1).positions).value();
  const HandleEdit edits[] = {Add({5, 0, 1})};
  EXPECT_EQ(EditHandles(handles, {}, edits).status().message(),
            "handle 4 of a 2D rig has z = 1, not 0");
}

}  // namespace
}  // namespace deform
