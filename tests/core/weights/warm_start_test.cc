// Bindings of edited handles that start from the solutions of the old one.
#include <gtest/gtest.h>

#include <random>

#include "core/weights/binding.h"
#include "core/weights/handle_edit.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using Kind = HandleEdit::Kind;

struct Edit {
  const char* name;
  std::vector<HandleEdit> edits;
};

class WarmStart : public testing::TestWithParam<std::tuple<const char*, Edit>> {
 protected:
  // The corners of a cube, and twelve handles within.
  static Handles FirstHandles() {
    Positions handles(20, 3);
    handles.topRows(8) = Cuboid({-1, -1, -1}, {1, 1, 1}).positions;
    std::mt19937 random(3);
    for (double& x : handles.bottomRows(12).reshaped()) {
      x = std::uniform_real_distribution<double>(-0.9, 0.9)(random);
    }
    return Handles::Create(3, handles).value();
  }
  BindRequest Request(const EditedHandles& edited) const {
    return {.model = model_,
            .rig = edited.handles,
            .scheme = std::get<0>(GetParam()),
            .options = edited.options};
  }

  const std::shared_ptr<const Mesh> model_ =
      std::make_shared<const Mesh>(MeshOf(Icosphere(0.8, 4)));
};

INSTANTIATE_TEST_SUITE_P(
    Edits, WarmStart,
    testing::Combine(
        testing::Values("s_cc", "t_cc"),
        testing::ValuesIn<Edit>({
            {"Add", {{.kind = Kind::kAdd, .position = {0.3, 0.2, 0.1}}}},
            {"AddOutside", {{.kind = Kind::kAdd, .position = {3, 0.2, 0.1}}}},
            {"Move",
             {{.kind = Kind::kMove, .handle = 12, .position = {0.1, 0.1, 0}}}},
            {"Remove", {{.kind = Kind::kRemove, .handle = 9}}},
            {"Several",
             {{.kind = Kind::kRemove, .handle = 9},
              {.kind = Kind::kMove, .handle = 10, .position = {-0.2, 0, 0}},
              {.kind = Kind::kAdd, .position = {0, 0.5, 0.1}}}},
        })),
    [](const auto& test) {
      return std::string(std::get<0>(test.param)) + "_" +
             std::get<1>(test.param).name;
    });

TEST_P(WarmStart, ChangesWeightsByRoundingAndIsNoSlower) {
  const EditedHandles first{FirstHandles(), {}, {}};
  const auto old = Bind(Request(first), {}).value();
  const EditedHandles edited =
      EditHandles(first.handles, {}, std::get<1>(GetParam()).edits).value();
  const auto cold = Bind(Request(edited), {}).value();
  const auto warm =
      Bind(Request(edited), {.known = old->solutions().get()}).value();
  EXPECT_LE(warm->quality().iterations_mean, cold->quality().iterations_mean);
  double difference = 0;
  for (int64_t i = 0; i < cold->point_count(); ++i) {
    for (int64_t c = 0; c < cold->column_count(); ++c) {
      difference =
          std::max(difference, std::abs(double{cold->weights().at(i, c)} -
                                        double{warm->weights().at(i, c)}));
    }
  }
  // One unit in the last place of a float below 1.
  EXPECT_LE(difference, 6e-8);
}

TEST_P(WarmStart, ByWhatItMadeItselfIsLeast) {
  const EditedHandles first{FirstHandles(), {}, {}};
  const auto cold = Bind(Request(first), {}).value();
  const auto again =
      Bind(Request(first), {.known = cold->solutions().get()}).value();
  EXPECT_LT(again->quality().iterations_mean,
            0.8 * cold->quality().iterations_mean);
}

TEST_P(WarmStart, SurvivesSolutionsThatMakeNoSense) {
  const EditedHandles first{FirstHandles(), {}, {}};
  const auto cold = Bind(Request(first), {}).value();
  Solutions wild = Solutions::Constant(model_->size(), 3, 1e30f);
  wild.row(7).setConstant(std::numeric_limits<float>::quiet_NaN());
  const auto warm = Bind(Request(first), {.known = &wild}).value();
  for (int64_t i = 0; i < cold->point_count(); i += 17) {
    for (int64_t c = 0; c < cold->column_count(); ++c) {
      ASSERT_NEAR(cold->weights().at(i, c), warm->weights().at(i, c), 6e-8);
    }
  }
}

}  // namespace
}  // namespace deform
