#include "server/rpc/convert.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform::server {
namespace {

using testing::HasSubstr;

Shape Cube() { return Cuboid(Vec3::Constant(-1), Vec3::Constant(1)); }

v1::CreateBindingRequest GoodRequest() {
  v1::CreateBindingRequest request;
  request.set_model_id("m-1");
  request.set_scheme("green");
  auto* cage = request.mutable_rig()->mutable_cage();
  cage->set_dimension(3);
  const Shape cube = Cube();
  for (int64_t i = 0; i < cube.positions.size(); ++i) {
    cage->add_vertices(cube.positions.data()[i]);
  }
  for (int64_t i = 0; i < cube.faces.size(); ++i) {
    cage->add_corners(cube.faces.data()[i]);
  }
  return request;
}

TEST(ConvertBinding, TakesACage) {
  const BindSpec spec = FromProto(GoodRequest()).value();
  EXPECT_EQ(spec.tenant, "default");
  EXPECT_EQ(spec.model_id, "m-1");
  EXPECT_EQ(std::get<Cage>(spec.rig).vertices(), Cube().positions);
  EXPECT_EQ(std::get<Cage>(spec.rig).faces(), Cube().faces);
  EXPECT_EQ(spec.exits.kind, ExitRegions::Kind::kNone);
  EXPECT_EQ(spec.unbindable, Unbindable::kFail);
}

TEST(ConvertBinding, TakesHandlesAndOptions) {
  v1::CreateBindingRequest request = GoodRequest();
  auto* handles = request.mutable_rig()->mutable_handles();
  handles->set_dimension(2);
  for (const double x : {0.0, 0.0, 1.0, 0.0, 0.0, 1.0}) {
    handles->add_positions(x);
  }
  request.mutable_options()->add_handle_weights(0.5);
  request.mutable_options()->set_lambda(3);
  request.set_unbindable(v1::UNBINDABLE_REPORT);
  const BindSpec spec = FromProto(request).value();
  EXPECT_EQ(std::get<Handles>(spec.rig).size(), 3);
  EXPECT_EQ(RestVertices(spec.rig)(2, 1), 1);
  EXPECT_EQ(spec.options.handle_weights, std::vector<double>{0.5});
  EXPECT_EQ(spec.options.lambda, 3);
  EXPECT_EQ(spec.unbindable, Unbindable::kReport);
}

TEST(ConvertBinding, TakesTheServersWeightToleranceIfItNamesNone) {
  v1::CreateBindingRequest request = GoodRequest();
  EXPECT_EQ(FromProto(request, nullptr, 1e-5)->weight_tolerance, 1e-5);
  request.set_weight_tolerance(1e-3);
  EXPECT_EQ(FromProto(request, nullptr, 1e-5)->weight_tolerance, 1e-3);
  request.set_weight_tolerance(0);
  EXPECT_EQ(FromProto(request, nullptr, 1e-5)->weight_tolerance, 0);
}

TEST(ConvertBinding, RefusesWeightTolerancesOutOfRange) {
  v1::CreateBindingRequest request = GoodRequest();
  for (const double tolerance : {-1e-5, 1e-7, 0.02, std::nan(""),
                                 std::numeric_limits<double>::infinity()}) {
    request.set_weight_tolerance(tolerance);
    const absl::Status refused = FromProto(request).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(DetailOf(refused).reason, "WEIGHT_TOLERANCE_OUT_OF_RANGE");
    EXPECT_EQ(DetailOf(refused).field, "weight_tolerance");
    EXPECT_EQ(refused.message(),
              absl::StrCat("weight tolerance must be 0 (dense weights) or in "
                           "[1e-06, 0.01], not ",
                           tolerance));
  }
}

TEST(ConvertBinding, AddsHandlesAtTheBoxOfTheModel) {
  const Mesh model = MeshOf(Icosphere(0.5, 1));
  v1::CreateBindingRequest request = GoodRequest();
  auto* handles = request.mutable_rig()->mutable_handles();
  handles->set_dimension(3);
  for (const double x : {0.0, 0.1, 0.2}) handles->add_positions(x);
  request.set_add_box_handles(true);
  const Rig rig = FromProto(request, &model).value().rig;
  EXPECT_EQ(std::get<Handles>(rig).free_count(), 1);
  EXPECT_EQ(RestVertices(rig).bottomRows(8), BoxHandles(model));
  // Told back, they are what was asked for.
  v1::CreateBindingRequest again = request;
  again.set_add_box_handles(false);
  again.clear_rig();
  ToProto(rig, again.mutable_rig());
  EXPECT_EQ(again.rig().handles().positions_size(), 3);
  EXPECT_EQ(again.rig().handles().fixed_positions_size(), 24);
  const Rig told = FromProto(again).value().rig;
  EXPECT_EQ(RestVertices(told), RestVertices(rig));
  EXPECT_EQ(PoseRows(told), 1);
}

TEST(ConvertBinding, AddsNoBoxToARigOfAnotherKindOrDimension) {
  const Mesh model = MeshOf(Grid2d(2), 2);
  v1::CreateBindingRequest request = GoodRequest();
  request.set_add_box_handles(true);
  absl::Status status = FromProto(request, &model).status();
  EXPECT_EQ(DetailOf(status).reason, "WRONG_RIG");
  EXPECT_EQ(DetailOf(status).field, "add_box_handles");
  EXPECT_EQ(status.message(),
            "the corners of a box can be added to handles; a cage has none");
  request.mutable_rig()->mutable_handles()->set_dimension(3);
  status = FromProto(request, &model).status();
  EXPECT_EQ(DetailOf(status).reason, "DIMENSION_MISMATCH");
  EXPECT_EQ(status.message(), "the model is 2D and its rig 3D");
}

TEST(ConvertBinding, SortsClampedPoints) {
  v1::CreateBindingRequest request = GoodRequest();
  for (const uint64_t point : {9, 2, 9, 0}) request.add_clamped_points(point);
  EXPECT_EQ(FromProto(request)->clamped, (std::vector<int64_t>{0, 2, 9}));
}

TEST(ConvertBinding, TakesExits) {
  v1::CreateBindingRequest request = GoodRequest();
  request.mutable_exits()->mutable_automatic();
  EXPECT_EQ(FromProto(request)->exits.kind, ExitRegions::Kind::kAutomatic);
  request.mutable_exits()->mutable_faces()->add_faces(7);
  EXPECT_EQ(FromProto(request)->exits.kind, ExitRegions::Kind::kFaces);
  EXPECT_EQ(FromProto(request)->exits.faces, std::vector<int32_t>{7});
  request.mutable_exits()->mutable_per_point()->add_faces(-1);
  EXPECT_EQ(FromProto(request)->exits.kind, ExitRegions::Kind::kPerPoint);
  EXPECT_EQ(FromProto(request)->exits.face_of_point, std::vector<int32_t>{-1});
}

TEST(ConvertBinding, TurnsAnInsideOutCageOnRequest) {
  v1::CreateBindingRequest request = GoodRequest();
  auto* corners = request.mutable_rig()->mutable_cage()->mutable_corners();
  for (int f = 0; f < corners->size() / 3; ++f) {
    corners->SwapElements(3 * f, 3 * f + 1);
  }
  EXPECT_EQ(DetailOf(FromProto(request).status()).reason, "CAGE_INVERTED");
  request.set_flip_inside_out(true);
  EXPECT_TRUE(FromProto(request).ok());
}

struct BadBinding {
  const char* name;
  std::function<void(v1::CreateBindingRequest&)> spoil;
  const char* reason;
  const char* field;
  const char* message;
};

class BindingRefused : public testing::TestWithParam<BadBinding> {};

TEST_P(BindingRefused, SaysWhatToMend) {
  v1::CreateBindingRequest request = GoodRequest();
  GetParam().spoil(request);
  const absl::Status status = FromProto(request).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, GetParam().reason);
  EXPECT_EQ(DetailOf(status).field, GetParam().field);
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().message));
}

using Request = v1::CreateBindingRequest;
INSTANTIATE_TEST_SUITE_P(
    Requests, BindingRefused,
    testing::ValuesIn<BadBinding>({
        {"Tenant", [](Request& r) { r.set_tenant("a b"); }, "BAD_NAME",
         "tenant", "tenant \"a b\""},
        {"NoModel", [](Request& r) { r.clear_model_id(); }, "BAD_NAME",
         "model_id", "model_id \"\""},
        {"NoScheme", [](Request& r) { r.clear_scheme(); }, "MISSING_FIELD",
         "scheme", "ListSchemes"},
        {"LongScheme", [](Request& r) { r.set_scheme(std::string(1000, 'g')); },
         "BAD_NAME", "scheme", "ggg...\" is not 1 to 64"},
        {"NoRig", [](Request& r) { r.clear_rig(); }, "MISSING_FIELD", "rig",
         "rig is a cage or handles"},
        {"CageDimension",
         [](Request& r) { r.mutable_rig()->mutable_cage()->set_dimension(4); },
         "BAD_DIMENSION", "rig.cage.dimension", "2 or 3, not 4"},
        {"OddVertices",
         [](Request& r) { r.mutable_rig()->mutable_cage()->add_vertices(0); },
         "WRONG_LENGTH", "rig.cage.vertices",
         "has 25 numbers, which is no multiple of 3"},
        {"OddCorners",
         [](Request& r) { r.mutable_rig()->mutable_cage()->add_corners(0); },
         "WRONG_LENGTH", "rig.cage.corners", "has 37 numbers"},
        {"HugeCorner",
         [](Request& r) {
           r.mutable_rig()->mutable_cage()->set_corners(5, 4294967295u);
         },
         "INDEX_OUT_OF_RANGE", "rig.cage.corners", "entry 5 is 4294967295"},
        {"CornerBeyond",
         [](Request& r) { r.mutable_rig()->mutable_cage()->set_corners(3, 8); },
         "INDEX_OUT_OF_RANGE", "rig.cage.corners",
         "face 1 refers to vertex 8 of 8"},
        {"OpenCage",
         [](Request& r) {
           r.mutable_rig()->mutable_cage()->mutable_corners()->Truncate(33);
         },
         "CAGE_NOT_CLOSED", "rig.cage.corners", ""},
        {"HandlesDimension",
         [](Request& r) { r.mutable_rig()->mutable_handles(); },
         "BAD_DIMENSION", "rig.handles.dimension", "2 or 3, not 0"},
        {"OddHandles",
         [](Request& r) {
           r.mutable_rig()->mutable_handles()->set_dimension(3);
           r.mutable_rig()->mutable_handles()->add_positions(1);
         },
         "WRONG_LENGTH", "rig.handles.positions", "has 1 numbers"},
        {"NoHandles",
         [](Request& r) {
           r.mutable_rig()->mutable_handles()->set_dimension(3);
         },
         "DEGENERATE_HANDLES", "rig.handles.positions", ""},
        {"OddFixedHandles",
         [](Request& r) {
           r.mutable_rig()->mutable_handles()->set_dimension(3);
           r.mutable_rig()->mutable_handles()->add_fixed_positions(1);
         },
         "WRONG_LENGTH", "rig.handles.fixed_positions", "has 1 numbers"},
        {"HugeClampedPoint",
         [](Request& r) { r.add_clamped_points(~uint64_t{0}); },
         "INDEX_OUT_OF_RANGE", "clamped_points",
         "entry 0 is 18446744073709551615, beyond every point"},
        {"HugeExit",
         [](Request& r) {
           r.mutable_exits()->mutable_faces()->add_faces(1u << 31);
         },
         "INDEX_OUT_OF_RANGE", "exits.faces.faces", "entry 0 is 2147483648"},
        {"Unbindable",
         [](Request& r) { r.set_unbindable(static_cast<v1::Unbindable>(9)); },
         "UNKNOWN_VALUE", "unbindable", "unbindable 9 is not known"},
    }),
    [](const auto& test) { return test.param.name; });

TEST(ConvertPose, TakesVerticesPositionsAndBlend) {
  v1::Pose pose;
  pose.add_vertices(4);
  for (const double x : {1.0, 2.0}) pose.add_positions(x);
  pose.set_stretch_blend(0);
  const PoseUpdate update = FromProto(pose, 2).value();
  EXPECT_EQ(update.vertices, std::vector<int32_t>{4});
  EXPECT_EQ(update.positions.row(0), Eigen::RowVector3d(1, 2, 0));
  EXPECT_EQ(update.stretch_blend, 0.0);
  pose.clear_stretch_blend();
  EXPECT_FALSE(FromProto(pose, 2)->stretch_blend.has_value());
}

TEST(ConvertPose, RefusesOddLengthsAndHugeIndices) {
  v1::Pose pose;
  pose.add_positions(1);
  absl::Status status = FromProto(pose, 3).status();
  EXPECT_EQ(DetailOf(status).reason, "WRONG_LENGTH");
  EXPECT_EQ(DetailOf(status).field, "pose.positions");
  EXPECT_EQ(status.message(),
            "pose.positions has 1 numbers, which is no multiple of 3");
  pose.add_vertices(3000000000u);
  status = FromProto(pose, 3).status();
  EXPECT_EQ(DetailOf(status).reason, "INDEX_OUT_OF_RANGE");
  EXPECT_EQ(DetailOf(status).field, "pose.vertices");
}

TEST(ConvertJoin, KeepsTheEncodingsItKnowsInTheirOrder) {
  v1::Join join;
  join.set_session_id("s");
  EXPECT_TRUE(FromProto(join)->frames.encodings.empty());
  join.add_encodings("holographic");
  join.add_encodings("predicted");
  join.add_encodings("float32");
  EXPECT_EQ(FromProto(join)->frames.encodings,
            (std::vector<const FrameEncoding*>{FindEncoding("predicted"),
                                               FindEncoding("float32")}));
  EXPECT_EQ(FromProto(join)->delivery, Delivery::kLatest);
  join.set_delivery(v1::DELIVERY_EVERY);
  EXPECT_EQ(FromProto(join)->delivery, Delivery::kEvery);
}

TEST(ConvertJoin, KeepsWhatIsSaidOfTheTolerance) {
  v1::Join join;
  join.set_session_id("s");
  EXPECT_FALSE(FromProto(join)->frames.tolerance.has_value());
  EXPECT_FALSE(FromProto(join)->frames.tolerance_fraction.has_value());
  EXPECT_FALSE(FromProto(join)->frames.cheapest);
  join.set_tolerance(0.5);
  join.set_tolerance_fraction(0);
  join.set_cheapest_encoding(true);
  EXPECT_EQ(FromProto(join)->frames.tolerance, 0.5);
  EXPECT_EQ(FromProto(join)->frames.tolerance_fraction, 0.0);
  EXPECT_TRUE(FromProto(join)->frames.cheapest);
}

TEST(ConvertJoin, KeepsHowManyFramesAreWanted) {
  v1::Join join;
  join.set_session_id("s");
  EXPECT_EQ(FromProto(join)->frames.max_fps, 0);
  join.set_max_fps(30);
  EXPECT_EQ(FromProto(join)->frames.max_fps, 30);
  EXPECT_FALSE(FromProto(join)->frames.normals);
  join.set_normals(true);
  EXPECT_TRUE(FromProto(join)->frames.normals);
}

TEST(ConvertJoin, KeepsWhatTheClientHolds) {
  v1::Join join;
  join.set_session_id("s");
  join.mutable_held()->set_binding_id("b-1");
  join.mutable_held()->set_basis_id("ab12");
  EXPECT_EQ(FromProto(join)->frames.weights.binding, "b-1");
  EXPECT_EQ(FromProto(join)->frames.weights.basis, "ab12");
  EXPECT_FALSE(FromProto(join)->frames.TakesBasis());
  join.add_encodings("float32");
  join.add_encodings("basis");
  EXPECT_TRUE(FromProto(join)->frames.TakesBasis());
}

TEST(ConvertJoin, RefusesHeldWeightsThatCannotBe) {
  v1::Join join;
  join.set_session_id("s");
  join.mutable_held()->set_binding_id("no such name");
  absl::Status status = FromProto(join).status();
  EXPECT_EQ(DetailOf(status).reason, "BAD_NAME");
  EXPECT_EQ(DetailOf(status).field, "held.binding_id");
  EXPECT_THAT(std::string(status.message()), HasSubstr("held.binding_id"));
  join.mutable_held()->set_binding_id("b-1");
  join.mutable_held()->set_basis_id(std::string(200, 'a'));
  status = FromProto(join).status();
  EXPECT_EQ(DetailOf(status).reason, "BAD_NAME");
  EXPECT_EQ(DetailOf(status).field, "held.basis_id");
}

TEST(ConvertJoin, RefusesWhatItDoesNotKnow) {
  v1::Join join;
  EXPECT_EQ(DetailOf(FromProto(join).status()).field, "session_id");
  join.set_session_id("s");
  join.add_encodings("holographic");
  absl::Status status = FromProto(join).status();
  EXPECT_EQ(DetailOf(status).reason, "UNKNOWN_ENCODING");
  EXPECT_EQ(status.message(),
            "none of the encodings is known; known: float32, quantized16, "
            "predicted, basis, pose");
  join.set_delivery(static_cast<v1::Delivery>(5));
  status = FromProto(join).status();
  EXPECT_EQ(status.message(), "delivery 5 is not known");
}

TEST(ConvertPage, IsBounded) {
  EXPECT_EQ(ToPageRequest(0, "")->size, 100);
  EXPECT_EQ(ToPageRequest(1000, "")->size, 1000);
  EXPECT_EQ(ToPageRequest(7, "m-1")->after, "m-1");
  absl::Status status = ToPageRequest(1001, "").status();
  EXPECT_EQ(status.message(), "page_size is at most 1000, not 1001");
  EXPECT_EQ(DetailOf(status).reason, "PAGE_TOO_LARGE");
  status = ToPageRequest(1, "a b").status();
  EXPECT_EQ(status.message(), "page_token is not one of a page before");
  EXPECT_EQ(DetailOf(status).reason, "BAD_PAGE_TOKEN");
}

TEST(ConvertHeader, LimitsTheDisplayName) {
  v1::ModelHeader header;
  header.set_display_name(std::string(256, 'x'));
  EXPECT_TRUE(FromProto(header).ok());
  header.set_display_name(std::string(257, 'x'));
  const absl::Status status = FromProto(header).status();
  EXPECT_EQ(status.message(), "display_name has 257 bytes; at most 256");
  EXPECT_EQ(DetailOf(status).reason, "NAME_TOO_LONG");
}

TEST(ConvertRig, ComesBackAsItWas) {
  const BindSpec spec = FromProto(GoodRequest()).value();
  v1::Rig rig;
  ToProto(spec.rig, &rig);
  EXPECT_EQ(rig.SerializeAsString(), GoodRequest().rig().SerializeAsString());
}

TEST(ConvertBindQuality, TellsEveryFigure) {
  v1::BindingQuality out;
  ToProto({.reproduction_error = 1,
           .partition_error = 2,
           .weight_min = -3,
           .weight_max = 4,
           .weight_sum_max = 5,
           .iterations_total = int64_t{6} << 32,
           .iterations_max = 7,
           .iterations_mean = 8,
           .residual_max = 9,
           .residual_mean = 10},
          &out);
  EXPECT_EQ(out.reproduction_error(), 1);
  EXPECT_EQ(out.partition_error(), 2);
  EXPECT_EQ(out.weight_min(), -3);
  EXPECT_EQ(out.weight_max(), 4);
  EXPECT_EQ(out.weight_sum_max(), 5);
  EXPECT_EQ(out.iterations_total(), uint64_t{6} << 32);
  EXPECT_EQ(out.iterations_max(), 7u);
  EXPECT_EQ(out.iterations_mean(), 8);
  EXPECT_EQ(out.residual_max(), 9);
  EXPECT_EQ(out.residual_mean(), 10);
}

class ConvertBindingRecord : public testing::Test {
 protected:
  BindingRecord RecordOf(const BindRequest& request) {
    auto binding = Bind(request, {}).value();
    auto memory =
        cache_.budget().Reserve(binding->weights().bytes(), "weights need");
    BindingRecord record{.facts = *binding, .weights = cache_.MakeSlot()};
    record.weights->Put(std::move(binding), *std::move(memory));
    return record;
  }

  WeightsCache cache_{3 * kBallBytes / 2, "limit"};
  // 42 points in 3 tiles of 16, 8 vertices and 12 normals.
  static constexpr int64_t kBallBytes = 48 * 20 * 4;
};

TEST_F(ConvertBindingRecord, TellsWhetherTheWeightsAreHere) {
  const BindingRecord record = RecordOf(
      {.model = std::make_shared<const Mesh>(MeshOf(Icosphere(0.5, 1))),
       .rig = CageOf(Cube()),
       .scheme = "green"});
  v1::Binding binding;
  ToProto(record, Detail::kSummary, &binding);
  EXPECT_EQ(binding.weight_state(), v1::WEIGHT_STATE_RESIDENT);
  EXPECT_EQ(binding.weight_bytes(), static_cast<uint64_t>(kBallBytes));
  EXPECT_EQ(binding.weight_users(), 0u);
  EXPECT_GT(binding.last_use_time().seconds(), 0);
  const auto user = record.weights->Get();
  ToProto(record, Detail::kSummary, &binding);
  EXPECT_EQ(binding.weight_users(), 1u);
}

TEST_F(ConvertBindingRecord, TellsWhatIsKnownOfEvictedWeights) {
  const BindingRecord record = RecordOf(
      {.model = std::make_shared<const Mesh>(MeshOf(Icosphere(0.5, 1))),
       .rig = CageOf(Cube()),
       .scheme = "green"});
  ASSERT_TRUE(cache_.budget().Reserve(kBallBytes, "others need").ok());
  v1::Binding binding;
  ToProto(record, Detail::kSummary, &binding);
  EXPECT_EQ(binding.weight_state(), v1::WEIGHT_STATE_EVICTED);
  EXPECT_EQ(binding.weight_bytes(), static_cast<uint64_t>(kBallBytes));
  EXPECT_EQ(binding.normal_count(), 12u);
}

TEST_F(ConvertBindingRecord, LeavesTheListsOutOfASummary) {
  Shape ball = Icosphere(0.5, 1);
  ball.positions.row(3) << 5, 0, 0;  // Outside the cube.
  const BindingRecord record =
      RecordOf({.model = std::make_shared<const Mesh>(MeshOf(ball)),
                .rig = CageOf(Cube()),
                .scheme = "green",
                .unbindable = Unbindable::kReport});
  v1::Binding full;
  ToProto(record, Detail::kFull, &full);
  EXPECT_EQ(full.unbound_count(), 1u);
  ASSERT_EQ(full.unbound_size(), 1);
  EXPECT_EQ(full.unbound(0).points(0), 3u);
  v1::Binding summary;
  ToProto(record, Detail::kSummary, &summary);
  EXPECT_EQ(summary.unbound_count(), 1u);
  EXPECT_EQ(summary.unbound_size(), 0);
}

}  // namespace
}  // namespace deform::server
