// Bytes and time of frame encodings on a model of 172,802 points that hangs on
// 326 columns of Green coordinates, at 60 frames a second:
//
//   frames_bench [frames]                      the generated model
//   frames_bench [frames] MODEL.obj CAGE.obj   another; its faces are
//                                              subdivided once
//
// Motions: one cage vertex, or a region around it, along a smooth path of up to
// 0.15 D, at about 0.5 D/s; the same with jitter of 0.5 % D; and jitter of
// 0.2 % D of the whole cage. Tolerance: 1e-5 D; leaf coefficients are of
// weights compressed to that, and rounded within 3/4 of it, as a server does,
// but their error is that of both together. Bytes are the mean of all frames
// but the first; each frame is decoded and compared with the positions that
// were encoded. CPU time of one core, the best frame. Beside them, in the same
// run: a copy of the floats, and the plain version of what is packed.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <vector>

#include "core/deform/deformer.h"
#include "core/files/mesh_file.h"
#include "core/frames/basis_payload.h"
#include "core/frames/encoding.h"
#include "core/kernels/grid_blocks.h"
#include "core/weights/compress_binding.h"
#include "tests/bench/timing.h"
#include "tests/support/detailed_model.h"

namespace deform::bench {
namespace {

struct Scene {
  std::shared_ptr<const Binding> binding;
  std::shared_ptr<const Binding> compressed;
  double diagonal;  // D
};

// Every triangle becomes four.
Mesh Subdivided(const MeshFile& file) {
  std::map<std::pair<int32_t, int32_t>, int32_t> middles;
  std::vector<Vec3> points;
  for (const auto& row : file.positions.rowwise()) points.push_back(row);
  const auto middle = [&](int32_t a, int32_t b) {
    const auto [at, is_new] = middles.try_emplace(
        std::minmax(a, b), static_cast<int32_t>(points.size()));
    if (is_new) points.push_back(0.5 * (points[a] + points[b]));
    return at->second;
  };
  for (const auto& face : file.faces.rowwise()) {
    for (int k = 0; k < 3; ++k) middle(face[k], face[(k + 1) % 3]);
  }
  Positions positions(points.size(), 3);
  for (size_t i = 0; i < points.size(); ++i) positions.row(i) = points[i];
  return Mesh::Create(3, std::move(positions), Faces(0, 3)).value();
}

Scene BindGreen(Mesh model, Cage cage, ThreadPool* pool) {
  const double diagonal = cage.diagonal();
  auto dense = Bind({.model = std::make_shared<const Mesh>(std::move(model)),
                     .rig = std::move(cage),
                     .scheme = "green"},
                    {.pool = pool})
                   .value();
  auto compressed =
      CompressBinding(*dense, &dense->weights(), 1e-5, {.pool = pool}).value();
  return {std::move(dense), std::move(compressed), diagonal};
}

Scene MakeScene(const char* model, const char* cage, ThreadPool* pool) {
  if (model == nullptr) {
    const DetailedModel detailed = MakeDetailedModel(9, 12, 40);
    return BindGreen(MeshOf(detailed.model), CageOf(detailed.cage), pool);
  }
  const MeshFile file = ReadMeshFile(cage).value();
  return BindGreen(Subdivided(ReadMeshFile(model).value()),
                   Cage::Create(3, file.positions, file.faces).value(), pool);
}

struct Motion {
  const char* name;
  double region;       // Radius of what is dragged, D; 0: one vertex.
  double jitter;       // Of the dragged vertex, D.
  double cage_jitter;  // Of all, D.
};
constexpr Motion kMotions[] = {{"drag of a vertex", 0, 0, 0},
                               {"drag of a region", 0.3, 0, 0},
                               {"jittering drag", 0, 0.005, 0},
                               {"jitter of the cage", 0, 0, 0.002}};

// Where a hand is after `seconds`, in units of D.
Vec3 Hand(double seconds) {
  const auto wave = [&](double hertz, double phase) {
    return std::sin(2 * std::numbers::pi * hertz * seconds + phase);
  };
  return {0.12 * wave(0.7, 0) + 0.03 * wave(1.9, 1),
          0.10 * wave(0.5, 0.5) + 0.02 * wave(2.3, 0), 0.08 * wave(0.9, 2)};
}

Pose PoseAt(const Scene& scene, const Motion& motion, int frame,
            std::mt19937& random) {
  Pose pose = RestPose(scene.binding->rig());
  const Positions rest = pose.vertices;
  std::normal_distribution<double> normal;
  const double unit = scene.diagonal;
  const int64_t held = rest.rows() / 5;
  if (motion.cage_jitter > 0) {
    pose.vertices += Positions::NullaryExpr(rest.rows(), 3, [&] {
      return motion.cage_jitter * unit * normal(random);
    });
    return pose;
  }
  Vec3 hand = unit * Hand(frame / 60.0);
  for (int d = 0; d < 3; ++d) hand[d] += motion.jitter * unit * normal(random);
  for (int64_t k = 0; k < rest.rows(); ++k) {
    const double distance = (rest.row(k) - rest.row(held)).norm() / unit;
    double share = k == held ? 1 : 0;
    if (motion.region > 0) {
      share = std::exp(-std::pow(distance / motion.region, 2));
    }
    pose.vertices.row(k) += share * hand.transpose();
  }
  return pose;
}

// What encodings cost on one motion.
struct Cost {
  double bytes = 0;  // A frame.
  double encode = std::numeric_limits<double>::infinity();
  double decode = encode;
  double error = 0;  // The largest, in units of the tolerance.
};

void Print(const char* name, const Cost& cost, double raw) {
  std::printf("  %-26s %8.1f KB  1/%-5.2f %7.3f ms %7.3f ms  error %.3f\n",
              name, cost.bytes / 1024, raw / cost.bytes, 1e3 * cost.encode,
              1e3 * cost.decode, cost.error);
}

template <typename Body>
void Time(double& best, Body body) {
  best = std::min(best, BestCpuSeconds(1, body));
}

double LargestError(std::span<const float> a, std::span<const float> b) {
  double largest = 0;
  for (size_t i = 0; i < a.size(); i += 3) {
    double squares = 0;
    for (size_t d = i; d < i + 3; ++d)
      squares += std::pow(double{a[d]} - b[d], 2);
    largest = std::max(largest, std::sqrt(squares));
  }
  return largest;
}

// One way to send frames, whole.
class Way {
 public:
  Way(const char* encoding, int64_t points, double tolerance)
      : encoding_(*FindEncoding(encoding)),
        points_(points),
        tolerance_(tolerance),
        chunk_(kMaxChunkBytes),
        positions_(points * 3) {}
  virtual ~Way() = default;

  Cost cost;

  // Encodes, decodes and compares.
  virtual void Send(const std::vector<float>& positions, bool counts) = 0;

 protected:
  // `source` and `target` without their range.
  void SendChunks(ChunkSource source, ChunkTarget target,
                  std::span<const float> positions, bool counts) {
    double encode = 0, decode = 0;
    const int64_t most = encoding_.PointsPerChunk(3);
    for (int64_t first = 0; first < points_; first += most) {
      source.first = target.first = first;
      source.count = target.count = std::min(most, points_ - first);
      if (!encoding_.uses_grid()) {
        source.positions = positions.subspan(first * 3, source.count * 3);
        target.positions =
            std::span(positions_).subspan(first * 3, source.count * 3);
      }
      int64_t size = 0;
      encode += BestCpuSeconds(
          1, [&] { size = encoding_.Encode(source, chunk_.data()).value(); });
      decode += BestCpuSeconds(1, [&] {
        if (!encoding_
                 .Decode({chunk_.data(), static_cast<size_t>(size)}, target)
                 .ok()) {
          std::abort();
        }
      });
      if (counts) bytes_ += static_cast<double>(size);
    }
    cost.encode = std::min(cost.encode, encode);
    cost.decode = std::min(cost.decode, decode);
    if (counts) ++frames_;
    if (frames_ > 0) cost.bytes = bytes_ / frames_;
  }

  void Compare(std::span<const float> positions) {
    cost.error =
        std::max(cost.error, LargestError(positions_, positions) / tolerance_);
  }

  const FrameEncoding& encoding_;
  const int64_t points_;
  const double tolerance_;
  std::vector<uint8_t> chunk_;
  std::vector<float> positions_;  // Decoded.

 private:
  double bytes_ = 0;
  int frames_ = 0;
};

class Stateless final : public Way {
 public:
  using Way::Way;
  void Send(const std::vector<float>& positions, bool counts) override {
    SendChunks({.tolerance = tolerance_}, {}, positions, counts);
    Compare(positions);
  }
};

enum class Reference { kNone, kFirst, kPrevious };

class OnGrid final : public Way {
 public:
  OnGrid(const PointOrder& order, double tolerance, Reference reference)
      : Way("predicted", order.size(), tolerance),
        order_(order),
        reference_(reference) {}

  double put_on_grid = std::numeric_limits<double>::infinity();
  double take_off = put_on_grid;

  void Send(const std::vector<float>& positions, bool counts) override {
    auto grid = std::make_unique<Grid>(0);
    Time(put_on_grid,
         [&] { *grid = PutOnGrid(positions, 3, tolerance_, order_).value(); });
    auto received = std::make_unique<Grid>(points_);
    SendChunks({.grid = grid.get(), .reference = sent_.get()},
               {.grid = received.get(), .reference = received_.get()}, {},
               counts);
    Time(take_off,
         [&] { TakeOffGrid(*received, tolerance_, order_, 3, positions_); });
    Compare(positions);
    if (reference_ == Reference::kPrevious ||
        (reference_ == Reference::kFirst && sent_ == nullptr)) {
      sent_ = std::move(grid);
      received_ = std::move(received);
    }
  }

 private:
  const PointOrder& order_;
  const Reference reference_;
  std::unique_ptr<Grid> sent_, received_;
};

// Leaf coefficients, for who holds the leaf bases.
class OfLeaves {
 public:
  // Rounds within `share` of the tolerance.
  OfLeaves(const Scene& scene, double tolerance, double share)
      : tolerance_(tolerance),
        share_(share),
        basis_(LeafBasis::Of(scene.compressed)),
        positions_(basis_->point_count() * 3) {}

  Cost cost;

  void Send(const Deformer& deformer, const Vec3& origin,
            std::span<const float> positions, bool counts) {
    std::vector<uint8_t> bytes;
    Time(cost.encode, [&] {
      bytes = EncodeLeafPose(LeafPoseOf(deformer), *basis_, share_ * tolerance_,
                             nullptr)
                  .value();
    });
    Time(cost.decode, [&] {
      if (!PlacePoints(DecodeLeafPose(bytes, *basis_).value(), *basis_, origin,
                       nullptr, positions_)
               .ok()) {
        std::abort();
      }
    });
    cost.error =
        std::max(cost.error, LargestError(positions_, positions) / tolerance_);
    if (!counts) return;
    ++frames_;
    cost.bytes += (static_cast<double>(bytes.size()) - cost.bytes) / frames_;
  }

 private:
  const double tolerance_;
  const double share_;
  const std::shared_ptr<const LeafBasis> basis_;
  std::vector<float> positions_;  // Decoded.
  int frames_ = 0;
};

// The plain version of predicting and packing by the reference alone, as the
// measure of what vectors give.
double PlainSeconds(const Grid& grid, const Grid& reference) {
  std::vector<uint32_t> folded(kGridBlock);
  std::vector<uint8_t> out(kGridBlock * 4);
  return BestCpuSeconds(3, [&] {
    for (int64_t first = 0; first < grid.size(); first += kGridBlock) {
      const GridBlock a{{reference.coordinate(0) + first,
                         reference.coordinate(1) + first,
                         reference.coordinate(2) + first}};
      const GridBlock q{{grid.coordinate(0) + first, grid.coordinate(1) + first,
                         grid.coordinate(2) + first}};
      MeasureExtentPlain(a, q);
      SumMomentsPlain(a, q, 10, {10, 10, 10});
      for (int d = 0; d < 3; ++d) {
        FoldResidualsPlain(a, d, q.of[d], {.gradient = {1, 1, 1}},
                           folded.data());
        for (int64_t g = 0; g < kGridBlock; g += kGridGroup) {
          PackBitsPlain(folded.data() + g, 3, out.data());
        }
      }
    }
  });
}

void Measure(const Scene& scene, const PointOrder& order, const Motion& motion,
             int frames, ThreadPool* pool) {
  const int64_t points = scene.binding->point_count();
  const double tolerance = 1e-5 * scene.diagonal;
  Deformer deformer(scene.binding, pool);
  Deformer with_leaves(scene.compressed, nullptr);
  Stateless copy("float32", points, tolerance);
  Stateless quantized("quantized16", points, tolerance * 4);
  OnGrid keyframe(order, tolerance, Reference::kNone);
  OnGrid first(order, tolerance, Reference::kFirst);
  OnGrid previous(order, tolerance, Reference::kPrevious);
  OfLeaves rounded(scene, tolerance, 0.75);
  OfLeaves as_floats(scene, tolerance, 0);
  std::mt19937 random(1);
  std::vector<float> positions(points * 3);
  const Vec3 origin = scene.binding->model()->box().center();
  for (int frame = -1; frame < frames; ++frame) {
    // The first is the rest pose, whatever the motion.
    if (frame >= 0) {
      const Pose pose = PoseAt(scene, motion, frame, random);
      deformer.MoveTo(pose);
      with_leaves.MoveTo(pose);
    }
    deformer.CopyRelative(0, points, origin, positions.data());
    for (Way* way : std::initializer_list<Way*>{&copy, &quantized, &keyframe,
                                                &first, &previous}) {
      way->Send(positions, frame > 0);
    }
    for (OfLeaves* way : {&rounded, &as_floats}) {
      way->Send(with_leaves, origin, positions, frame > 0);
    }
  }
  const auto raw = static_cast<double>(points * 12);
  std::printf("\n%s, %d frames\n", motion.name, frames);
  Print("float32", copy.cost, raw);
  Print("quantized16 (tolerance x 4)", quantized.cost, raw);
  Print("predicted, keyframe", keyframe.cost, raw);
  Print("predicted from rest", first.cost, raw);
  Print("predicted from the last", previous.cost, raw);
  Print("leaf coefficients", rounded.cost, raw);
  Print("leaf coefficients, floats", as_floats.cost, raw);
  std::printf("  onto the grid %.3f ms, off it %.3f ms\n",
              1e3 * previous.put_on_grid, 1e3 * previous.take_off);
}

}  // namespace
}  // namespace deform::bench

int main(int argc, char** argv) {
  using namespace deform;  // NOLINT
  const int frames = argc > 1 ? std::atoi(argv[1]) : 60;
  if (frames < 2 || argc == 3 || argc > 4) {
    std::fprintf(stderr, "frames_bench [frames [MODEL.obj CAGE.obj]]\n");
    return 2;
  }
  ThreadPool pool({.threads = 0});
  const bench::Scene scene = bench::MakeScene(
      argc > 2 ? argv[2] : nullptr, argc > 3 ? argv[3] : nullptr, &pool);
  const PointOrder order(scene.binding->model()->positions());
  std::printf(
      "%lld points, %lld columns; bytes, ratio to float32, encode, "
      "decode, largest error in tolerances\n",
      static_cast<long long>(scene.binding->point_count()),
      static_cast<long long>(scene.binding->column_count()));
  const auto basis = LeafBasis::Of(scene.compressed);
  std::printf("leaf bases: %.1f KB once, for %lld coefficients\n",
              static_cast<double>(basis->byte_count()) / 1024,
              static_cast<long long>(basis->coefficient_rows() * 3));
  for (const bench::Motion& motion : bench::kMotions) {
    bench::Measure(scene, order, motion, frames, &pool);
  }
  Grid from(order.size()), to(order.size());
  std::printf("\nplain version of the loops: %.3f ms\n",
              1e3 * bench::PlainSeconds(to, from));
}
